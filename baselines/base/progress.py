"""Progress of a long command: a bar on a terminal, elsewhere a line every half minute."""

from __future__ import annotations

import sys
import threading
import time

from tqdm import tqdm

EVERY_S = 30.0


class Progress:
    """Shows how many steps are `done`, their rate, and the `figures` that the caller sets."""

    def __init__(self, name: str, total: int, done: int = 0, unit: str = "steps") -> None:
        """Begin at `done` of `total`."""
        self.figures: dict[str, str] = {}
        self._bar = tqdm(total=total, initial=done, desc=name, unit=f" {unit}", disable=None)
        self._name, self._total, self.done, self._unit = name, total, done, unit
        self._printed_s, self._printed = time.monotonic(), done
        self._closed = threading.Event()
        if self._bar.disable:  # standard error is no terminal
            threading.Thread(target=self._print_lines, daemon=True).start()

    def add(self, count: int) -> None:
        """Count steps."""
        self.done += count
        self._bar.set_postfix(self.figures, refresh=False)
        self._bar.update(count)

    def close(self) -> None:
        """End the bar or the lines."""
        self._closed.set()
        self._bar.close()

    def _print_lines(self) -> None:
        while not self._closed.wait(EVERY_S):
            now, done = time.monotonic(), self.done
            rate = (done - self._printed) / (now - self._printed_s)
            share = f"{done:,} of {self._total:,} {self._unit} ({100 * done / self._total:.1f} %)"
            parts = [share, f"{rate:,.0f} {self._unit}/s", *(f"{k} {v}" for k, v in list(self.figures.items()))]
            print(f"{self._name}: {', '.join(parts)}", file=sys.stderr, flush=True)
            self._printed_s, self._printed = now, done
