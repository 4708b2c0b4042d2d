"""The figures of `make parity-gpu`, their limits, and the page that shows them, docs/evidence/parts/gpu-parity.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.stats

from baselines.base.markdown import markdown_table

FLAGS_LIMIT = 0.999
REWARD_LIMIT = 1e-4
ITERATIONS = 20  # of MuJoCo Warp's solver, at which it gives up; see `minexplore.extra.warp.physics`
KS_LIMIT = 0.01  # p-value below which two samples are taken to differ
_DECIMALS = 5  # of samples: far below one cell of coverage, far above the digits of 32 bits
EPISODES = "episodes-"  # a part's name begins so, and ends with a policy's


@dataclass(frozen=True)
class ParityRow:
    """A line of the page: what was measured, what is wanted, and whether that holds."""

    figure: str
    measured: str
    wanted: str
    holds: bool


def rows(found: dict[str, dict[str, Any]]) -> list[ParityRow]:
    """Return the lines of the page for the parts that were measured, by name in `found`."""
    lines: list[ParityRow] = []
    for name, part in found.items():
        lines += _episodes(name, part) if name.startswith(EPISODES) else _ROWS[name](part)
    return lines


def _looks(part: dict[str, Any]) -> list[ParityRow]:
    title, shown = (
        f"largest difference of a range, {part['rays']:,} rays",
        f"{part['largest_difference_m'] * 1e3:.3f} mm",
    )
    cells = part["cells_that_differ"]
    return [
        ParityRow(title, shown, "<= 1 mm", part["rays_beyond_1_mm"] == 0),
        ParityRow("cells that differ at equal poses", f"{cells}", "0", cells == 0),
    ]


def _steps(part: dict[str, Any]) -> list[ParityRow]:
    count, other, reward = part["control_steps"], part["flags_that_differ"], part["largest_reward_difference"]
    agree, near = 1 - other / count, 1 - part["places_beyond_0.1_mm"] / count
    flags = f"equal collision flags after one of {count:,} control steps, {part['with_contact']:,} with contact"
    rewards = f"largest difference of {part['rewards_compared']:,} rewards at equal cells and flags"
    places = f"{near:.1%}, farthest {part['largest_distance_m'] * 1e3:.1f} mm"
    return [
        ParityRow(flags, f"{agree:.3%} ({other} differ)", f">= {FLAGS_LIMIT:.1%}", agree >= FLAGS_LIMIT),
        ParityRow(rewards, f"{reward:.1e}", f"<= {REWARD_LIMIT:g}", reward <= REWARD_LIMIT),
        ParityRow("places within 0.1 mm after such a step", places, "-", True),
        *_sound("hard driving", part),
    ]


def _stress(part: dict[str, Any]) -> list[ParityRow]:
    most = part["largest_iterations"]
    return [
        *_sound(f"{part['contacts']:,} control steps with contact", part),
        ParityRow("most iterations of the contact solver in them", f"{most}", f"< {ITERATIONS}", most < ITERATIONS),
    ]


def _sound(title: str, part: dict[str, Any]) -> list[ParityRow]:
    """Return the lines of what must never be: escapes, states that are not finite, contacts that were left out."""
    counts = [part[name] for name in ("outside", "not_finite", "overflows")]
    shown = ", ".join(map(str, counts))
    if "least_clearance_m" in part:
        shown += f"; least clearance {part['least_clearance_m']:.3f} m"
    return [
        ParityRow(f"{title}: robots outside, not finite, with contacts left out", shown, "0, 0, 0", not any(counts))
    ]


def _episodes(name: str, part: dict[str, Any]) -> list[ParityRow]:
    lines = []
    for figure, values in compare_samples(part).items():
        title = f"{figure} of {part['episodes']} whole episodes of {name.removeprefix(EPISODES)}, KS test"
        shown = f"p = {values['p']:.3f} (CPU {values['cpu']:.4g}, Warp {values['warp']:.4g})"
        lines.append(ParityRow(title, shown, f"p >= {KS_LIMIT:g}", values["p"] >= KS_LIMIT))
    return lines


_ROWS = {"looks": _looks, "steps": _steps, "stress": _stress}


def compare_samples(part: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Return means of return and coverage on both, and the p-value of a two-sample KS test.

    Samples are rounded to `_DECIMALS`: one coverage has other last digits in 32 and in 64 bits, and many episodes end
    with the same one, so that the test would find these digits.
    """
    cpu, warp = np.round(part["cpu"], _DECIMALS), np.round(part["warp"], _DECIMALS)
    return {
        name: {
            "cpu": float(cpu[:, k].mean()),
            "warp": float(warp[:, k].mean()),
            "p": float(scipy.stats.ks_2samp(cpu[:, k], warp[:, k]).pvalue),
        }
        for k, name in enumerate(("return", "coverage"))
    }


def tables(lines: list[ParityRow], device: str, robots: int, env: str) -> str:
    """Return what was measured, and where."""
    rows = ((row.figure, row.measured, row.wanted + ("" if row.holds else ": **missed**")) for row in lines)
    where = f"Measured on {device}, {robots} robots at a time; whole episodes are those of `{env}`."
    return f"{where}\n\n{markdown_table(('figure', 'measured', 'wanted'), rows)}"
