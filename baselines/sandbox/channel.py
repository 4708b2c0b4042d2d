"""Messages between two processes that do not trust each other: a kind, a length, and bytes; nothing is unpickled."""

from __future__ import annotations

import os
import select
import struct
import time
from typing import NamedTuple

_HEADER = struct.Struct("<BI")
MAKE, RESET, ACT, DONE, FAILED = range(5)  # kinds of messages


class Message(NamedTuple):
    """One message."""

    kind: int
    payload: bytes


class ChannelError(Exception):
    """The other side is gone, is late, or sends what is not allowed."""


class Channel:
    """Sends and receives messages over two pipes, none longer than `most_bytes`, none later than a deadline."""

    def __init__(self, reading: int, writing: int, most_bytes: int) -> None:
        """Take the file descriptors of the pipes' ends."""
        self._reading, self._writing, self._most_bytes = reading, writing, most_bytes
        os.set_blocking(reading, False)
        os.set_blocking(writing, False)

    def send(self, kind: int, payload: bytes, until: float | None = None) -> None:
        """Send a message; `until` is a time of `time.monotonic`.

        Raises
        ------
        ChannelError
            If the other side does not take it in time, or is gone.
        """
        left = memoryview(_HEADER.pack(kind, len(payload)) + payload)
        while left:
            _wait(self._writing, select.POLLOUT, until)
            try:
                left = left[os.write(self._writing, left) :]
            except BlockingIOError:
                continue
            except OSError as error:
                raise ChannelError("it ended") from error

    def receive(self, until: float | None = None) -> Message:
        """Return the next message.

        Raises
        ------
        ChannelError
            If none comes in time, it is too long, or the other side is gone.
        """
        kind, length = _HEADER.unpack(self._read(_HEADER.size, until))
        if length > self._most_bytes:
            raise ChannelError(f"it sends {length:,} bytes, at most {self._most_bytes:,} are taken")
        return Message(kind, self._read(length, until))

    def _read(self, count: int, until: float | None) -> bytes:
        parts = bytearray()
        while len(parts) < count:
            _wait(self._reading, select.POLLIN, until)
            try:
                part = os.read(self._reading, count - len(parts))
            except BlockingIOError:
                continue
            if not part:
                raise ChannelError("it ended")
            parts += part
        return bytes(parts)


def _wait(descriptor: int, event: int, until: float | None) -> None:
    """Wait until a pipe can be read or written."""
    poll = select.poll()
    poll.register(descriptor, event)
    left_s = None if until is None else until - time.monotonic()
    if left_s is not None and left_s <= 0:
        raise ChannelError("it takes too long")
    if not poll.poll(None if left_s is None else 1000 * left_s + 1):
        raise ChannelError("it takes too long")
