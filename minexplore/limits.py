"""What the numbers of a task or a robot may be, and how much of a stranger's file is read."""

from __future__ import annotations

import math
import numbers
import os
import re
import stat
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

_BLOCK = 1 << 20  # bytes that are searched at once
_ESCAPED = re.compile(rb"\\.", re.DOTALL)  # backslashes stand in texts only
_OPENING, _CLOSING, _MARKS = (np.frombuffer(marks, np.uint8) for marks in (b"[{", b"]}", b"[{,"))
# A link is followed, a pipe is not waited for; Windows has no such flags.
_READING = os.O_RDONLY | sum(getattr(os, name, 0) for name in ("O_NONBLOCK", "O_BINARY", "O_NOCTTY"))


class UnreadableError(ValueError):
    """A file is not read; the message ends the sentence `FILE: ...`."""


@dataclass(frozen=True)
class Span:
    """Numbers from `low` to `high`, both included; with `whole`, whole ones only."""

    low: float
    high: float
    whole: bool = False

    def accepts(self, value: Any) -> bool:
        """Return whether a value is a number within the span; NaN and truth values are none."""
        kind = numbers.Integral if self.whole else numbers.Real
        return isinstance(value, kind) and not isinstance(value, bool) and self.low <= value <= self.high  # type: ignore[operator]

    def __str__(self) -> str:
        """Return what is accepted, as a sentence's part."""
        number = "a whole number" if self.whole else "a number"
        most = "" if math.isinf(self.high) else f" to {self.high:,.10g}"
        return f"{number} from {self.low:,.10g}{most}{' or more' if not most else ''}"


def has_display() -> bool:
    """Return whether a window can be shown: on Linux whether an X or Wayland display is announced."""
    return bool(sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def check_numbers(kind: str, params: Any, spans: Mapping[str, Span]) -> None:
    """Refuse a field of `params` that lies outside its span.

    Raises
    ------
    ValueError
        Naming the kind of parameters, the field, its value, and what is accepted.
    """
    for name, span in spans.items():
        value = getattr(params, name)
        if not span.accepts(value):
            raise ValueError(f"{kind}: {name} = {value!r:.100}: want {span}")


def read_plain_file(path: Path, most_bytes: int, may_link: bool = True) -> bytes:
    """Return a plain file's bytes.

    Parameters
    ----------
    path : Path
    most_bytes : int
    may_link : bool
        Whether `path` may be a link to such a file.

    Raises
    ------
    UnreadableError
        If it is something else, cannot be read or is larger, or no file can have this path.
    """
    flags = _READING | (0 if may_link else getattr(os, "O_NOFOLLOW", 0))
    try:
        with open(path, "rb", opener=lambda name, _: os.open(name, flags)) as file:
            about = os.fstat(file.fileno())
            if not stat.S_ISREG(about.st_mode):
                raise UnreadableError("not a plain file")
            if about.st_size > most_bytes:
                raise UnreadableError(f"too large, {about.st_size:,} bytes, at most {most_bytes:,} are read")
            data = file.read(most_bytes + 1)
    except IsADirectoryError as error:
        raise UnreadableError("not a plain file") from error
    except OSError as error:
        raise UnreadableError(f"cannot be read ({error.strerror})") from error
    except UnreadableError:
        raise
    except ValueError as error:  # of a zero byte, or of what no name of a file encodes
        raise UnreadableError("no path of a file") from error
    if len(data) > most_bytes:
        raise UnreadableError(f"too large, at most {most_bytes:,} bytes are read")
    return data


def require_small_json(data: bytes, most_values: int, most_keys: int, deepest: int) -> None:
    """Refuse JSON of too many values or keys, or of too deep nesting, before anything is made of it.

    Values are counted by their commas and brackets outside of texts.

    Raises
    ------
    UnreadableError
        Naming the count and the limit.
    """
    depth, is_text, values, keys = 0, False, 0, 0
    for at in range(0, len(plain := _ESCAPED.sub(b"", data) if b"\\" in data else data), _BLOCK):
        marks = np.frombuffer(plain, np.uint8, min(_BLOCK, len(plain) - at), at)
        texts = np.cumsum(marks == ord('"'), dtype=np.int32) + is_text
        outside = texts % 2 == 0
        steps = np.isin(marks, _OPENING).astype(np.int8) - np.isin(marks, _CLOSING)
        depths = depth + np.cumsum(np.where(outside, steps, 0), dtype=np.int32)
        values += int(np.count_nonzero(np.isin(marks, _MARKS) & outside))
        keys += int(np.count_nonzero((marks == ord(":")) & outside))
        if depths.max() > deepest:
            raise UnreadableError(f"values are nested deeper than {deepest} levels")
        if values > most_values or keys > most_keys:
            raise UnreadableError(f"more than {most_values:,} values or {most_keys:,} keys, the most that are read")
        depth, is_text = int(depths[-1]), bool(texts[-1] % 2)
