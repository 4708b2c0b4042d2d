"""Expected failures: every message names the thing, the value and the limit; commands exit with code 2."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable

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
    """Run a command; return its exit code: 2 after an expected error, 130 when it was ended by Ctrl-C or SIGTERM.

    An error of the operating system, such as a full disk, is expected as well, and so are words of the command line
    that no path can be, or that are no text.
    """
    signal.signal(signal.SIGTERM, interrupt)
    try:
        _require_texts(sys.argv[1:])
        command()
    except BaselineError as error:
        print(f"{name}: {_printable(str(error))}", file=sys.stderr)
        return 2
    except OSError as error:
        reason = f"{error.filename or name}: {error.strerror or type(error).__name__}"
        print(f"{name}: {_printable(reason)}", file=sys.stderr)
        return 2
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] in ("baselines", "minexplore"):
            raise
        print(f"{name}: {error.name} is not installed for {sys.executable}; run `make setup`", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"{name}: interrupted; run it again to go on", file=sys.stderr)
        return 130
    return 0


def _require_texts(words: list[str]) -> None:
    for word in words:
        if "\0" in word or word.encode(errors="replace").decode() != word:
            raise BaselineError(f"{word[:_MOST_SHOWN]}: a word of the command line with a zero byte or without UTF-8")


def _printable(text: str) -> str:
    """Return text with a blank for each character that a terminal would act on or cannot show."""
    return "".join(c if c.isprintable() else " " for c in text)
