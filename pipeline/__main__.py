"""`python -m pipeline COMMAND`: the chores around the stages."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

from pipeline.errors import MineError


def set_overrides() -> None:
    """Write `$OVERRIDES` to `params.yaml`, where `dvc repro` finds them; touch the file only to change it."""
    text = f"overrides: {json.dumps(os.environ.get('OVERRIDES', ''))}\n"
    path = Path("params.yaml")
    if not path.is_file() or path.read_text() != text:
        path.write_text(text)


def verify() -> None:
    """Walk the manifests from the survey to the world and name the first broken link."""
    from pipeline.store.verify import verify_chain, verify_world

    count = verify_chain(Path())
    print(f"{count} artifacts hold; world {verify_world(Path('artifacts/realism/world'))}")


def register(path: Path, origin: str, licence: str) -> None:
    """Add a file below `data/` to `data/registry.txt`."""
    from pipeline.store.registry import register as add

    entry = add(path, origin, licence)
    print(f"data/{entry.name}  {entry.sha256}  {entry.bytes} bytes")


def accept() -> None:
    """Accept the present metrics as the baseline that the regression gate compares with."""
    from pipeline.report.baseline import accept_baseline

    print(accept_baseline())


def table() -> None:
    """Write `docs/results.md` from the present metrics and print it."""
    from pipeline.report.baseline import write_results

    print(write_results())


def main() -> int:
    """Run one command; exit code 2 with one message on bad input."""
    parser = argparse.ArgumentParser(prog="python -m pipeline", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    for function in (set_overrides, verify, accept, table):
        name = function.__name__.replace("_", "-")
        commands.add_parser(name, help=function.__doc__).set_defaults(run=lambda a, f=function: f())
    add = commands.add_parser("register", help=register.__doc__)
    add.add_argument("path", type=Path)
    add.add_argument("--origin", default="unknown")
    add.add_argument("--licence", default="none stated")
    add.set_defaults(run=lambda a: register(a.path, a.origin, a.licence))
    arguments = parser.parse_args()
    try:
        arguments.run(arguments)
    except MineError as error:
        print(f"{arguments.command}: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
