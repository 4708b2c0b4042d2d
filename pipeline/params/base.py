"""The base of all parameter schemas, and the type of input paths."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import PurePosixPath
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict
from pydantic_core import PydanticCustomError


class Params(BaseModel):
    """A frozen section of the configuration. Unknown keys, infinite numbers and NaN are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def _inside_project(path: str) -> str:
    pure = PurePosixPath(path)
    if pure.is_absolute() or ".." in pure.parts or pure.parts[:1] != ("data",):
        raise ValueError(f"{path!r} is not below data/ (inputs must be there and listed in data/registry.txt)")
    return path


DataFile = Annotated[str, AfterValidator(_inside_project)]
"""A path below `data/`, as text."""


def one_of(names: Iterable[str]) -> AfterValidator:
    """Return a validator that refuses a text that is none of the names of a table, as of a `Literal` of them."""
    known = tuple(names)
    *others, last = map(repr, known)
    expected = f"{', '.join(others)} or {last}" if others else last

    def require_known(name: str) -> str:
        if name not in known:
            raise PydanticCustomError("literal_error", "Input should be {expected}", {"expected": expected})
        return name

    return AfterValidator(require_known)
