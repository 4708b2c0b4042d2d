"""Expected failures: every message names the thing, the value and the limit; commands exit with code 2."""

from __future__ import annotations

import sys
from collections.abc import Callable

from minexplore import ends

_MOST_SHOWN = 200  # characters of a word in a message


class BaselineError(Exception):
    """A policy, environment, setting, checkpoint or results file cannot be used."""


class RejectedError(BaselineError):
    """A results file claims what is impossible, or what its policy does not do."""


def need(package: str, extra: str = "baselines") -> BaselineError:
    """Return the error of a missing package that belongs to an extra."""
    return BaselineError(f"{package} is not installed; it comes with the extra `{extra}`: run `make setup-{extra}`")


def interrupt(kind: int, frame: object) -> None:
    """Handle a signal as Ctrl-C is handled."""
    raise KeyboardInterrupt


def run_command(name: str, command: Callable[[], None]) -> int:
    """Run a command; return its exit code, see `minexplore.ends`."""

    def checked() -> None:
        _require_texts(sys.argv[1:])
        command()

    return ends.run_command(name, checked, _refusal, "interrupted; run it again to go on")


def _require_texts(words: list[str]) -> None:
    for word in words:
        if "\0" in word or word.encode(errors="replace").decode() != word:
            raise BaselineError(f"{word[:_MOST_SHOWN]}: a word of the command line with a zero byte or without UTF-8")


def _refusal(error: Exception) -> str:
    if isinstance(error, BaselineError):
        return str(error)
    if isinstance(error, ModuleNotFoundError):
        if error.name is None or error.name.partition(".")[0] in ("baselines", "minexplore"):
            return ""
        return f"{error.name} is not installed for {sys.executable}; run `make setup`"
    return ""
