"""Progress of a long command: a bar on a terminal, elsewhere a line every half minute."""

from __future__ import annotations

import sys

from tqdm import tqdm

EVERY_S = 30.0


def progress_bar(name: str, total: int, done: int = 0, unit: str = "steps") -> tqdm:
    """Return a bar that begins at `done` of `total`."""
    every_s = 0.1 if sys.stderr.isatty() else EVERY_S
    return tqdm(total=total, initial=done, desc=name, unit=f" {unit}", mininterval=every_s, delay=every_s)
