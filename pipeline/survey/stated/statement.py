"""One statement that a format can make about its coordinates, and what its reader does with it."""

from dataclasses import dataclass
from typing import Literal

Outcome = Literal["used", "listed", "refused"]


@dataclass(frozen=True)
class Statement:
    """A row of the table of statements.

    Parameters
    ----------
    format : str
        The format's name, as docs/reference/formats.md writes it.
    states : str
        What a file can state, such as "unit of heights".
    outcome : "used", "listed" or "refused"
        Used: the coordinates follow it. Listed: it changes nothing, and a remark says so. Refused: the file is.
    how : str
        One plain sentence for a user: what the value does, or what to do about it.
    test : str
        The test that writes the statement by a program of others and reads it back, "tests/...py::name".
    """

    format: str
    states: str
    outcome: Outcome
    how: str
    test: str
