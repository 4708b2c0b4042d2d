"""Read the text of tables as spreadsheets write them."""

from __future__ import annotations

import codecs
import math
import re
from pathlib import Path

from minesurveys.errors import InputError
from minesurveys.guard.plain_file import read_text_bytes
from minesurveys.guard.plain_number import plain_number
from minesurveys.remarks import warn_user

_LONE_CR = re.compile(r"\r(?!\n)")
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x0c\x0e-\x1f]")  # in no text that is not UTF-8
_OF_EXCEL = re.compile(r"\A\"?sep=.\"?\r?\n", re.IGNORECASE)  # a line for Excel alone, before that of the columns
_SEPARATORS = ",;\t"
_NAMES = {"utf-16-le": "UTF-16", "utf-16-be": "UTF-16", "cp1252": "Windows-1252"}


def read_csv_text(path: Path) -> str:
    """Return the text of a table whose lines end with LF or CR LF.

    It is UTF-8, or what spreadsheets write: UTF-16 with or without a byte order mark, or Windows-1252, with a warning.

    Raises
    ------
    InputError
        If the file cannot be read, is too large, is no text, or has lines that end with CR alone.
    """
    data = read_text_bytes(path)
    encoding = _encoding_of(data)
    try:
        text = _OF_EXCEL.sub("", data.decode(encoding).removeprefix("\ufeff"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: no text in UTF-8, UTF-16 or Windows-1252 (byte {error.start})") from error
    control = _CONTROL.search(text)
    if control and encoding in _NAMES:
        line = text.count("\n", 0, control.start()) + 1
        raise InputError(f"{path}:{line}: no text: it holds the control character {ord(control[0])}")
    if encoding in _NAMES:
        warn_user(
            f"read as {_NAMES[encoding]}, as it is not UTF-8; save it as CSV UTF-8 if names are wrong", of=path.name
        )
    lone = _LONE_CR.search(text)
    if lone:
        line = text.count("\n", 0, lone.start()) + 1
        raise InputError(f"{path}:{line}: a line end of CR alone; save the file with line ends of LF or CR LF")
    return text


def _encoding_of(data: bytes) -> str:
    """Return the encoding of a table by its byte order mark, by the zeros of UTF-16, or by what is no UTF-8."""
    for mark, encoding in ((codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be")):
        if data.startswith(mark):
            return encoding
    head = data[:64]  # of a table's first line, which is in English
    if head[1::2].count(0) > len(head) // 4:
        return "utf-16-le"
    if head[::2].count(0) > len(head) // 4:
        return "utf-16-be"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def separator_of(text: str) -> str:
    """Return what parts the columns of a table, by its first line: a comma, a semicolon or a tab."""
    return max(_SEPARATORS, key=text.partition("\n")[0].count)


def number_of(path: Path, line: int, column: str, text: str | None, reach: float) -> float:
    """Return the number in a field; `InputError` names the line and the column if it is none or is out of reach."""
    try:
        value = plain_number(text or "")
    except ValueError:
        raise InputError(f"{path}:{line}: {column} = {text and text[:60]!r} is not a number") from None
    if not math.isfinite(value):
        raise InputError(f"{path}:{line}: {column} = {text} is not a finite number")
    if abs(value) > reach:
        raise InputError(f"{path}:{line}: {column} = {text} is not within +-{reach:g}; count it from a local origin")
    return value
