"""What a reader answers: values, arrays, warnings or an error, as bytes of which nothing is executed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from minesurveys.errors import (
    DoubtError,
    GeometryError,
    InputError,
    MineError,
    ParamsError,
    UnexpectedError,
    describe_missing,
    describe_os_error,
    one_line,
)
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import Remark, collect_remarks, hand_on

HEADER_BYTES = 64_000_000
_ERRORS: dict[str, type[MineError]] = {kind.__name__: kind for kind in (InputError, ParamsError, GeometryError)}
_PICTURE = "shown"  # the array with the picture of a `DoubtError`
_DTYPES = ("uint8", "bool", "int32", "int64", "float32", "float64")


@dataclass(frozen=True)
class Payload:
    """What a reader hands back: plain JSON values, and arrays."""

    values: Any
    arrays: dict[str, np.ndarray] = field(default_factory=dict)


class Header(BaseModel):
    """The first part of an answer. The bytes of the arrays follow it."""

    model_config = ConfigDict(extra="forbid")

    error: str = ""
    message: str = ""
    remarks: list[Remark] = []
    values: Any = None
    arrays: list[tuple[str, str, list[int]]] = []


@dataclass(frozen=True)
class Answer:
    """An answer's header and arrays."""

    header: Header
    arrays: dict[str, np.ndarray] = field(default_factory=dict)

    def parts(self) -> Iterator[bytes | memoryview]:
        """Yield the bytes of the answer: the length of the header, the header, and each array."""
        head = json.dumps(self.header.model_dump(), allow_nan=True).encode()
        yield len(head).to_bytes(8, "little") + head
        for array in self.arrays.values():
            yield array.reshape(-1).view(np.uint8).data


def answer_to(task: Callable[..., Payload], arguments: dict[str, Any]) -> Answer:
    """Run a task in this process and return its answer, whatever it raises, with the reader's remarks."""
    with collect_remarks() as remarks:
        answer = _answer_to(task, arguments)
    answer.header.remarks = remarks
    return answer


def _answer_to(task: Callable[..., Payload], arguments: dict[str, Any]) -> Answer:
    try:
        payload = task(**arguments)
        arrays = {name: np.ascontiguousarray(array) for name, array in payload.arrays.items()}
        return Answer(Header(values=payload.values, arrays=_shapes(arrays)), arrays)
    except DoubtError as error:
        arrays = {_PICTURE: np.ascontiguousarray(error.picture)}
        return Answer(Header(error="DoubtError", message=str(error), arrays=_shapes(arrays)), arrays)
    except MineError as error:
        name = type(error).__name__
        return Answer(Header(error=name if name in _ERRORS else "InputError", message=str(error)))
    except MemoryError:
        return Answer(Header(error="MemoryError"))
    except (PermissionError, FileNotFoundError) as error:  # another user's file, or it vanished
        return Answer(Header(error="InputError", message=f"{describe_os_error(error)}; it cannot be read"))
    except ModuleNotFoundError as error:
        missing = describe_missing(error)
        kind = "InputError" if missing else "UnexpectedError"
        return Answer(Header(error=kind, message=missing or f"{type(error).__name__}: {error}"[:1000]))
    except Exception as error:  # a library's exception that the reader does not name
        no_memory = "bad_alloc" in str(error) or "Insufficient memory" in str(error)  # C++ libraries
        kind = "MemoryError" if no_memory else "UnexpectedError"
        return Answer(Header(error=kind, message=f"{type(error).__name__}: {error}"[:1000]))


def _shapes(arrays: dict[str, np.ndarray]) -> list[tuple[str, str, list[int]]]:
    return [(name, str(array.dtype), list(array.shape)) for name, array in arrays.items()]


def decode(subject: str, data: bytes | bytearray) -> Payload:
    """Return the payload of an answer's bytes. Its sizes and types are checked; nothing in it is executed.

    Raises
    ------
    MineError
        The error that the answer states, or an `InputError` if the answer is broken.
    """
    size = int.from_bytes(data[:8], "little")
    try:
        if size > min(HEADER_BYTES, len(data) - 8):
            raise ValueError("the header is longer than the answer")
        header = Header.model_validate(json.loads(data[8 : 8 + size]))
        hand_on(header.remarks)
        arrays, at = {}, 8 + size
        for name, dtype, shape in header.arrays:
            if dtype not in _DTYPES or min(shape, default=0) < 0:
                raise ValueError(f"an array of {dtype} {shape}")
            count = int(np.prod(shape, dtype=object))
            if at + count * np.dtype(dtype).itemsize > len(data):
                raise ValueError("an array is longer than the answer")
            arrays[name] = np.frombuffer(data, dtype, count, at).reshape(shape)
            at += arrays[name].nbytes
        if header.error:
            _raise_stated(subject, header, arrays.get(_PICTURE))
    except (ValueError, RecursionError, ValidationError) as error:
        raise InputError(f"{subject}: its reader gave a broken answer") from error
    return Payload(header.values, arrays)


def _raise_stated(subject: str, header: Header, shown: np.ndarray | None) -> NoReturn:
    if header.error == "MemoryError":
        most = f"{reader_limits().memory_bytes / 1e9:g} GB of memory (memory_bytes in {FILE})"
        raise InputError(f"{subject}: needs more than {most}")
    message = one_line(header.message)
    if header.error == "UnexpectedError":
        raise UnexpectedError(subject, message)
    if shown is not None and shown.ndim == 3 and shown.shape[2] == 3 and shown.dtype == np.uint8:
        raise DoubtError(message, shown)
    raise _ERRORS.get(header.error, InputError)(message)
