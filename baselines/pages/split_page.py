"""The leaderboard's part on mines that nobody trained in: every results file checked mine by mine, and the tables."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from baselines.base.environments import built_ids
from baselines.base.errors import BaselineError, RejectedError
from baselines.base.markdown import markdown_table
from baselines.base.statistics import Figure, sample_times
from baselines.explorers import EXPLORERS
from baselines.pages.split_profiles import draw_profiles
from baselines.score import check, require_name
from baselines.scoring.bounds import Bound, bound_of, bounds_file, read_bounds
from baselines.scoring.split_file import Drive, read_drives, require_whole, split_folder
from baselines.scoring.split_statistics import difference, improvement, middle, strata_of, stratified
from baselines.scoring.verified_runs import was_driven_here
from minexplore.splits import STYLES
from pieces.results import PiecesError
from pieces.run import map_pieces
from pieces.work import HERE, Where, Work

_CURVE_POINTS = 601
_SEEN = 0.9  # of the cells that a robot can reach
_COLUMNS = ("share of bound", "area under coverage", "time to 90 %, s", "distance, m", "collisions per 100 m")
_HEADING = """## Unseen mines: the test split

{mines} mines of four styles ([families](docs/how-to/families.md)), one episode of {seconds:g} s in each. Interquartile
means over mines, in brackets 95 % intervals by a bootstrap within the styles. The bound of a mine is what no robot can
exceed; on average it is {loose} above the best walk that was found. `P` is the probability that a policy sees more of a
mine than the best classical explorer in the table does{best}; equal counts half. `more` is the difference of the shares
of the bound to that explorer in points; mines are drawn together, so its interval is that of the difference.
"""
_STYLES_HEADING = "Share of the bound by style, interquartile means over the mines of a style, and `P` there:"
UNVERIFIED_HEADING = "Unverified: what files claim, not driven again."
_PROFILES = """Performance profiles: in how many mines a policy sees more than a share of the bound.

![Performance profiles]({picture})
"""


@dataclass(frozen=True)
class _SplitRow:
    policy: str
    verified: bool
    shares: np.ndarray  # (mines,) of the bound
    figures: dict[str, Figure]
    never: int  # mines in which less than 90 % was seen

    def text(self, name: str) -> str:
        """Return a figure as the table shows it."""
        return _text(self.figures[name], 1, 100 if name in _COLUMNS[:2] else 1)


def in_order(rows: list[_SplitRow]) -> list[_SplitRow]:
    """Return rows by their share of the bound, the greatest first."""
    return sorted(rows, key=lambda row: -(_value(row) or 0.0))


def require_own_rows(kept: dict[Path, list[Drive]]) -> None:
    """Refuse a file that is not named as its policy.

    Raises
    ------
    RejectedError
        Naming the file and the policy.
    """
    for path, drives in kept.items():
        if path.stem != drives[0][0].policy:
            raise RejectedError(
                f"{path}: results of {drives[0][0].policy}, which are kept as {drives[0][0].policy}.jsonl"
            )


def _check_mine(mine: list[tuple[Path, Drive]]) -> None:
    """Check the episodes of all files in one mine, whose environment is made once."""
    for path, (head, episode) in mine:
        check(path, head, [episode])


def split_section(results: Path, split: str, picture: Path | None = None, where: Where = HERE) -> str:
    """Return the section of a split from a folder of results, or nothing if it holds none.

    Parameters
    ----------
    results : Path
    split : str
    picture : Path, optional
        Where the performance profiles are drawn.
    where : Where, optional
        Where the mines are checked.

    Raises
    ------
    BaselineError
        If a file does not hold all mines of the split, or a mine is not built or has no bound.
    RejectedError
        If a figure is out of its bounds, or a file has the name of another policy.
    """
    files = sorted((results / split_folder(split).name).glob("*.jsonl"))
    if not files:
        return ""
    kept = {path: read_drives(path) for path in files}
    for path, drives in kept.items():
        require_whole(path, drives, split)
    built_ids(split, len(kept[files[0]]))
    require_own_rows(kept)
    mines = [list(zip(files, mine, strict=True)) for mine in zip(*kept.values(), strict=True)]
    checks = Work("mines checked", _check_mine, None, "", kept=None, label=lambda mine: mine[0][1][0].env)
    try:
        map_pieces(checks, mines, where)
    except PiecesError as error:
        raise RejectedError(str(error)) from error
    rows = in_order([_row(path, drives) for path, drives in kept.items()])
    claimed, rows = [row for row in rows if not row.verified], [row for row in rows if row.verified]
    head, _ = kept[files[0]][0]
    seconds = float(head.task["max_steps"]) * float(head.task["control_s"])  # type: ignore[arg-type]
    loose = _looseness(read_bounds(bounds_file(head.env)))
    classical = [row for row in rows if row.policy in EXPLORERS]
    best = f", `{classical[0].policy}`" if classical else ""
    lines = [_HEADING.format(mines=len(kept[files[0]]), seconds=seconds, loose=loose, best=best)]
    better = [_beside(row, classical[0]) if classical and row is not classical[0] else ("", "") for row in rows]
    cells = ((*_cells(row), *beside) for row, beside in zip(rows, better, strict=True))
    lines.append(markdown_table(("policy", *_COLUMNS, "P", "more"), cells))
    lines += [_STYLES_HEADING, "", _by_style(rows, classical[0] if classical else None)]
    if claimed:  # it is compared with nothing
        lines += [UNVERIFIED_HEADING, "", markdown_table(("policy", *_COLUMNS), map(_cells, claimed))]
    if picture is not None:
        draw_profiles({row.policy: row.shares for row in rows}, picture)
        lines.append(_PROFILES.format(picture=picture.as_posix()))
    return "\n".join(lines)


def _cells(row: _SplitRow) -> list[str]:
    texts = [row.text(name) for name in _COLUMNS]
    texts[2] += f", never in {row.never}" if row.never else ""
    return [row.policy, *texts]


def _by_style(rows: list[_SplitRow], best: _SplitRow | None) -> str:
    """Return the table of shares in each style, with the improvement over a row; styles alternate over the mines."""
    cells = ((row.policy, *(_in_style(row, best, k) for k in range(len(STYLES)))) for row in rows)
    return markdown_table(("policy", *(style.replace("_", " ") for style in STYLES)), cells)


def _in_style(row: _SplitRow, best: _SplitRow | None, style: int) -> str:
    own = row.shares[style :: len(STYLES)]
    if not len(own):
        return ""
    share = _text(stratified(middle, own, strata=np.zeros(len(own), int)), 1, 100)
    if best is None or row is best:
        return share
    return f"{share}, P {improvement(own, best.shares[style :: len(STYLES)]):.2f}"


def _row(path: Path, drives: list[Drive]) -> _SplitRow:
    found: dict[str, list[float]] = {name: [] for name in _COLUMNS}
    never = 0
    for head, episode in drives:
        bound = bound_of(head.env, head.world_sha256)
        if bound is None:
            raise BaselineError(f"{path}: {head.env} has no bound; `python -m baselines.split --bounds` computes it")
        control = float(head.task["control_s"])  # type: ignore[arg-type]
        horizon = float(head.task["max_steps"]) * control  # type: ignore[arg-type]
        times, share = sample_times(episode, control), np.array(episode.seen) / head.cells
        curve = np.interp(np.linspace(0, horizon, _CURVE_POINTS), times, share)
        late = np.flatnonzero(share >= _SEEN)
        found["share of bound"].append(episode.seen[-1] / bound(horizon))
        found["area under coverage"].append(float(np.trapezoid(curve) / (_CURVE_POINTS - 1)))
        found["time to 90 %, s"].append(float(times[late[0]]) if len(late) else horizon)
        found["distance, m"].append(episode.path_m)
        found["collisions per 100 m"].append(100 * episode.collided / max(episode.path_m, 1.0))
        never += not len(late)
    strata = strata_of(len(drives))
    figures = {name: stratified(middle, np.array(values), strata=strata) for name, values in found.items()}
    verified = was_driven_here(path, path.parents[1], drives[0][0], [episode for _, episode in drives])
    if not verified:
        require_name(path, drives[0][0])
    return _SplitRow(drives[0][0].policy, verified, np.array(found["share of bound"]), figures, never)


def _looseness(bounds: dict[str, Bound]) -> str:
    """Return by how much the bounds exceed the best walks that were found."""
    ratios = [bound.most[-1] / bound.found[-1] for bound in bounds.values() if bound.found and bound.found[-1]]
    if not ratios:
        return "at an unknown distance"
    return f"{100 * (np.mean(ratios) - 1):.1f} % (at most {100 * (max(ratios) - 1):.0f} %, {len(ratios)} mines)"


def _beside(row: _SplitRow, other: _SplitRow) -> tuple[str, str]:
    """Return the probability of improvement over another policy, and the difference of the shares in points."""
    strata = strata_of(len(row.shares))
    better, more = (stratified(f, row.shares, other.shares, strata=strata) for f in (improvement, difference))
    points = [f"{100 * (v or 0.0):+.1f}" for v in (more.value, more.low, more.high)]
    return _text(better, 2), f"{points[0]} ({points[1]} to {points[2]})"


def _value(row: _SplitRow) -> float | None:
    return row.figures["share of bound"].value


def _text(figure: Figure, digits: int, scale: float = 1.0) -> str:
    unit = " %" if scale > 1 else ""
    values = [scale * v for v in (figure.value or 0.0, figure.low or 0.0, figure.high or 0.0)]
    return f"{values[0]:.{digits}f}{unit} ({values[1]:.{digits}f}-{values[2]:.{digits}f})"
