"""`python -m pipeline COMMAND`: maintenance, proofs, exports, and worlds of your own mines."""

from __future__ import annotations

import argparse
import sys

from pipeline.commands import exports, maintenance, new, proofs, worlds
from pipeline.errors import run_command
from pipeline.places import require_project


def command_line() -> argparse.ArgumentParser:
    """Return the parser of all commands; its result has the function `run`."""
    parser = argparse.ArgumentParser(prog="python -m pipeline", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    for group in (maintenance, proofs, exports, new, worlds):
        group.add_to(commands)
    return parser


def parse(words: list[str]) -> argparse.Namespace:
    """Parse a command line; overrides are allowed before, between and after options."""
    parser = command_line()
    arguments, rest = parser.parse_known_args(words)
    if rest and (not hasattr(arguments, "overrides") or any(word.startswith("-") for word in rest)):
        parser.error(f"unrecognized arguments: {' '.join(rest)}")
    if rest:  # argparse accepts only one uninterrupted run of positional words
        arguments.overrides += rest
    return arguments


def main() -> int:
    """Run one command; exit code 2 with one message on bad input."""
    names = [word for word in sys.argv[1:] if not word.startswith("-")]
    return run_command(names[0] if names else "pipeline", _run)


def _run() -> None:
    """Run the command that is typed, in the project's folder unless it says that it works in every folder."""
    arguments = parse(sys.argv[1:])
    if not getattr(arguments, "anywhere", False):
        require_project()
    arguments.run(arguments)


if __name__ == "__main__":
    sys.exit(main())
