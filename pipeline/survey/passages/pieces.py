"""Which piece of a survey is built: the longest that is joined by drivable legs, or the one that the user names."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path

import networkx as nx
import numpy as np

from pipeline.errors import InputError
from pipeline.guard.reading_process import one_line, warn_user
from pipeline.survey.passages.legs import SurveyLeg
from pipeline.survey.passages.relief import floor_of
from pipeline.survey.passages.sheet_cells import Cell
from pipeline.types import Piece

_NEAR_M = 10.0  # from a stated place to the station or area that it names
_NAMED = 10  # pieces that a message names
_NAME_CHARS = 40


def require_near(path: Path, piece: Piece, far_m: float, what: str) -> None:
    """Refuse a stated place that is too far from the nearest station or area; `InputError` says how far."""
    if not far_m <= _NEAR_M:
        raise InputError(f"{path}: survey.piece = {_text(piece)}: {what} is {far_m:.1f} m away, at most {_NEAR_M:g} m")


def find_station(path: Path, legs: list[SurveyLeg], drivable: list[SurveyLeg], piece: Piece) -> str:
    """Return the station that a user names by its name, or by a place in the coordinates of the legs.

    Parameters
    ----------
    path : Path
    legs : list of SurveyLeg
        All of the survey.
    drivable : list of SurveyLeg
        Without their steep parts.
    piece : str or (float, float, float)
        A name, or easting, northing and elevation, m: the nearest station of a drivable leg.

    Raises
    ------
    InputError
        If there is no such station, with names like it; if no drivable leg meets it; if the place is far from all.
    """
    names = np.array([name for leg in drivable for name in leg.stations], object)
    if not isinstance(piece, str):
        places = np.concatenate([np.column_stack([leg.positions_m, floor_of(leg)]) for leg in drivable])
        far = np.linalg.norm(places - piece, axis=1)
        at = str(names[far.argmin()])
        require_near(path, piece, float(far.min()), f"the nearest drivable station, {one_line(at, _NAME_CHARS)},")
        return at
    if piece in set(names):
        return piece
    if any(piece in leg.stations for leg in legs):
        raise InputError(f"{path}: survey.piece = {_text(piece)}: no drivable leg meets this station")
    near = get_close_matches(piece, list(dict.fromkeys(names)), n=3, cutoff=0.0)
    raise InputError(
        f"{path}: survey.piece = {_text(piece)}: no station has this name; names like it are "
        f"{', '.join(one_line(name, _NAME_CHARS) for name in near)}"
    )


def choose_piece(path: Path, cells: dict[str, Cell], graph: nx.Graph, station: str | None, named: bool) -> nx.Graph:
    """Return the connected piece with the longest legs, or the one of a station, and list the others.

    Parameters
    ----------
    path : Path
    cells : dict of Cell
    graph : networkx.Graph
        The neighbours of the cells, with `length` m.
    station : str or None
    named : bool
        Whether stations have names that the user knows; else pieces are listed by a place of theirs.
    """
    length = {
        frozenset(nodes): float(graph.subgraph(nodes).size(weight="length")) for nodes in nx.connected_components(graph)
    }
    pieces = sorted(length, key=lambda nodes: -length[nodes])
    kept = pieces[0] if station is None else next(nodes for nodes in pieces if station in nodes)
    others = [nodes for nodes in pieces if nodes is not kept]
    if others:
        warn_user(
            f"{path.name}: {len(pieces)} pieces are not joined by drivable legs; kept is the one of {length[kept]:.0f} "
            f"m about {_about(kept, cells, named)}, left out are {sum(map(length.__getitem__, others)):.0f} m; "
            "--piece builds another"
        )
        list_others(path, [(f"{length[nodes]:.0f} m", _about(nodes, cells, named)) for nodes in others])
    # A subgraph of few nodes has the order of a set of texts, another one in each process.
    return nx.restricted_view(graph, [node for nodes in others for node in nodes], [])


def list_others(path: Path, others: list[tuple[str, str]]) -> None:
    """List the pieces that are left out, each by its size and what names it, and the option that builds one."""
    listed = ", ".join(f"{size} about {about}" for size, about in others[:_NAMED])
    more = f", and {len(others) - _NAMED} more" if len(others) > _NAMED else ""
    warn_user(f"{path.name}: --piece (survey.piece) builds another piece: {listed}{more}")


def _about(piece: frozenset[str], cells: dict[str, Cell], named: bool) -> str:
    """Return what names a piece: its first station, or the place of that."""
    name = first_station(piece)
    if named and not name.startswith("unnamed "):
        return one_line(name, _NAME_CHARS)
    return ",".join(f"{value:.1f}" for value in cells[name].lines[0][0][:3])


def first_station(piece: frozenset[str]) -> str:
    """Return the first station of a piece; the names of places between two stations have two colons."""
    return min(piece, key=lambda name: (name.count(":") == 2, name))


def _text(piece: Piece) -> str:
    return repr(one_line(piece, _NAME_CHARS)) if isinstance(piece, str) else ",".join(f"{value:g}" for value in piece)
