"""The table of all statements: what each format states about its coordinates, and what its reader does with it."""

from __future__ import annotations

import re

from pipeline.survey.stated import exchange, geodata, meshes, surveys
from pipeline.survey.stated.statement import Statement

STATEMENTS: tuple[Statement, ...] = (*geodata.STATEMENTS, *meshes.STATEMENTS, *exchange.STATEMENTS, *surveys.STATEMENTS)
_SUFFIX = re.compile(r"\.[a-z0-9]+")


def suffixes_stated() -> set[str]:
    """Return the suffixes of the formats that have rows."""
    return {suffix for row in STATEMENTS for suffix in _SUFFIX.findall(row.format)}


def by_format() -> dict[str, list[Statement]]:
    """Return the rows of each format, in the table's order."""
    found: dict[str, list[Statement]] = {}
    for row in STATEMENTS:
        found.setdefault(row.format, []).append(row)
    return found
