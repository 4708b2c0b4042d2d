"""Files of strangers' servers, bounded in size and in the time of the whole transfer; each fault is one error."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from queue import Empty, Queue
from urllib.parse import urljoin

import pooch
import requests

from minexplore.bundle import BundleError

TIME = "MINEXPLORE_DOWNLOAD_S"  # environment variable with the seconds that a transfer may take, at any rate
MOST_S = 3600.0  # of a whole transfer
START_S, LEAST_BYTES_S = 60.0, 10_000  # the least rate, which holds after the first minute
_MOST_TIME_S = 1e6
_SILENT_S = 60.0  # of a server that sends nothing at all
_PIECE_BYTES, _WAITING_PIECES = 1 << 14, 64
_MOST_REDIRECTS = 10


class _AnswerError(Exception):
    """A server's answer is none that is taken; the text says why."""


class Transfer:
    """The clock of a transfer of one or more files, which begins now."""

    def __init__(self) -> None:
        """Read the time that it may take.

        Raises
        ------
        BundleError
            If the environment variable states no time.
        """
        stated = os.environ.get(TIME)
        try:
            self._stated_s = None if stated is None else float(stated)
        except ValueError:
            self._stated_s = 0.0
        if self._stated_s is not None and not 0 < self._stated_s <= _MOST_TIME_S:
            raise BundleError(f"{TIME} = {stated!r:.80}: want seconds, up to {_MOST_TIME_S:,.0f}")
        self._begun, self._received = time.monotonic(), 0

    def add(self, received: int) -> None:
        """Count bytes that came."""
        self._received += received

    def left_s(self) -> float:
        """Return how long it may still take until the next bytes come, s."""
        most_s = min(MOST_S, START_S + self._received / LEAST_BYTES_S) if self._stated_s is None else self._stated_s
        return most_s - (time.monotonic() - self._begun)

    def __str__(self) -> str:
        """Return what came and what is wanted, as a sentence's part."""
        came = f"{self._received:,} bytes came in {time.monotonic() - self._begun:.0f} s"
        if self._stated_s is not None:
            return f"{came}: want an end within {self._stated_s:g} s, as {TIME} says"
        rate = f"{LEAST_BYTES_S:,} bytes/s after the first {START_S:g} s, and an end within {MOST_S:g} s"
        return f"{came}: want {rate}; {TIME}=SECONDS gives it so long at any rate"


def read_address(address: str, most_bytes: int, transfer: Transfer) -> bytes:
    """Return the bytes of an address that begins with http:// or https://.

    Raises
    ------
    BundleError
        As `keep_file`.
    """
    with requests.Session() as session:
        return b"".join(_pieces(session, address, most_bytes, transfer))


def keep_file(
    session: requests.Session, address: str, path: Path, sha256: str, most_bytes: int, transfer: Transfer, kind: str
) -> None:
    """Fetch a file by pooch, which keeps only what has the hash; one that is there with it is not fetched again.

    Parameters
    ----------
    session : requests.Session
    address : str
        It begins with http:// or https://, and so must what it redirects to.
    path : Path
        Where it is kept; nothing is left there of a transfer that fails.
    sha256 : str
    most_bytes : int
    transfer : Transfer
        Its clock runs over all files that are fetched with it.
    kind : str
        What the file is, for the message: `the registered file`.

    Raises
    ------
    BundleError
        If the server fails in any way, or is too slow, the file is larger or another one, or it cannot be kept.
    """

    def download(url: str, output: str, _: object) -> None:
        with Path(output).open("wb") as file:
            for piece in _pieces(session, url, most_bytes, transfer):
                file.write(piece)

    logger = pooch.get_logger()
    level = logger.level
    logger.setLevel("WARNING")  # it names every file
    try:
        pooch.retrieve(address, f"sha256:{sha256}", path.name, path.parent, downloader=download)
    except BundleError:
        raise
    except ValueError as error:
        raise BundleError(f"{address}: not {kind}: want sha256 {sha256[:12]}") from error
    except OSError as error:
        raise BundleError(f"{path}: cannot be kept ({error.strerror})") from error
    finally:
        logger.setLevel(level)


def _pieces(session: requests.Session, address: str, most_bytes: int, transfer: Transfer) -> Iterator[bytes]:
    """Yield the bytes of an address in pieces, as they come.

    A thread of its own waits for the server. No library has a limit for a whole transfer: theirs are of a single wait,
    and a server may send a byte of its name's answer, of its certificate, of a header or of its content before each
    ends.
    """
    waiting: Queue[bytes | Exception] = Queue(_WAITING_PIECES)
    stop = threading.Event()
    threading.Thread(target=_receive, args=(session, address, waiting, stop), daemon=True).start()
    size = 0
    try:
        while True:
            try:
                piece = waiting.get(timeout=transfer.left_s())
            except (Empty, ValueError):  # a time below 0 is a ValueError
                raise BundleError(f"{address}: too slow, {transfer}") from None
            if isinstance(piece, Exception):
                raise BundleError(f"{address}: cannot be fetched ({_reason(piece)})") from piece
            if not piece:
                return
            size += len(piece)
            transfer.add(len(piece))
            if size > most_bytes:
                raise BundleError(f"{address}: more than {most_bytes} bytes")
            yield piece
    finally:
        stop.set()
        with suppress(Empty):  # the thread may wait for a place
            while True:
                waiting.get_nowait()


def _receive(session: requests.Session, address: str, waiting: Queue[bytes | Exception], stop: threading.Event) -> None:
    """Hand over the bytes of an address, at the end none; or what any library says of the server's answer."""
    try:
        with _answer(session, address) as response:
            for piece in response.raw.stream(_PIECE_BYTES, decode_content=False):
                if stop.is_set():
                    return
                if piece:
                    waiting.put(piece)
        waiting.put(b"")
    except Exception as error:
        waiting.put(error)


def _answer(session: requests.Session, address: str) -> requests.Response:
    """Return the answer at the end of all redirects, whose contents are not read."""
    for _ in range(_MOST_REDIRECTS + 1):
        response = session.get(
            address, stream=True, timeout=_SILENT_S, allow_redirects=False, headers={"Accept-Encoding": "identity"}
        )
        target = session.get_redirect_target(response)
        if target is None:
            if response.status_code != requests.codes.ok:
                raise _AnswerError(f"HTTP {response.status_code}")
            if response.headers.get("Content-Encoding", "identity") != "identity":
                raise _AnswerError("it is packed; want the file as it is")
            return response
        response.close()
        address = urljoin(address, target)
    raise _AnswerError(f"more than {_MOST_REDIRECTS} redirects")


def _reason(error: Exception) -> str:
    return str(error) if isinstance(error, _AnswerError) else type(error).__name__
