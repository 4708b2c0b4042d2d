"""What can go wrong: every message names the thing, the value and what would be valid; commands exit with code 2."""

from __future__ import annotations

import sys
from collections.abc import Callable


class BaselineError(Exception):
    """A policy, environment, setting, checkpoint or results file cannot be used."""


def need(package: str, extra: str = "make setup-baselines") -> BaselineError:
    """Return the error of a package that an extra brings."""
    return BaselineError(f"{package} is not installed; it comes with the extra `baselines`: run `{extra}`")


def run_command(name: str, command: Callable[[], None]) -> int:
    """Run a command; return its exit code: 2 after an expected error, 130 when interrupted."""
    try:
        command()
    except BaselineError as error:
        print(f"{name}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"{name}: interrupted; run it again to go on", file=sys.stderr)
        return 130
    return 0
