"""Floors to drive on: heights of the union's floor vertices, solved over the mesh with the legs' floors fixed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from pipeline.volume.coarse import coarse_floors
from pipeline.volume.crossings import CROSSING_M, crossing_facets
from pipeline.volume.folded.leg_lines import along_legs, with_leg_lines
from pipeline.volume.folded.steps import DEEPEST_M, MIDDLE, Steps, are_steps, walls_on_floors
from pipeline.volume.keyed import near_facets, simplified
from pipeline.volume.ledges import FoldedLedges, fold_ledges, ledges_of
from pipeline.volume.network import NearLegs, SurveyNetwork
from pipeline.volume.slivers import without_slivers
from pipeline.volume.thin_rock import without_thin_rock
from pipeline.volume.union import Label, Volume, label_facets

EDGE_M = 0.8  # longest edge of the mesh on which heights are solved
_SIMPLE_M = 0.004  # of the solved mesh: floors keep within 1 cm of the survey
_FIX = 1e4  # weight of a leg's floor against the smoothness of the floor
_HOLD = 10.0  # the same where a wall goes down from a floor
_KEEP = 1e6  # the same where facets would cross: a floor that does not move crosses nothing
_DROP_M = 0.01  # of a wall that goes down from a floor, on average
_PULL = 1e-7  # weight of the union's own height, which decides where no leg passes
_HALVINGS = 6  # of rises at facets that would cross
_ROUNDS = 12  # of floors: each folds the walls that the one before turned over, and holds floors where facets cross
_TURNS = 7  # of these in which walls are folded: the others are for floors that cross
_STILL_M = 1e-7  # of a vertex that does not rise
_UNFOLDED_M = 0.1  # beside facets that cross
NEAR_M = 5.0  # along the survey: legs so near meet, and have one floor where their sections overlap
_OVERHANG = 0.1  # of a facet's normal, which points out of the free space: what hangs over is no ledge
_LONE = 1e-6  # holds vertices that are joined to no floor
_FADE_M = 1.0  # over the floor, and beside it: the walls' vertices move less with distance
_STEEPEST_FADE = 2.0  # heights that a rise fades over, at least: else walls turn over
_LEAST_M2 = 1e-6  # of a triangle in plan
_LEAST_M = 0.02  # of an edge in plan


def solve_floors(volume: Volume, network: SurveyNetwork) -> Volume:
    """Return the volume with a continuous floor through the floors of all legs that are flat enough.

    Ledges between floors of legs that meet become part of the floor, and walls that the floor's new heights turn over.
    Where passages break through each other's floors without a station in common, the ledge is as surveyed. On the
    floor's mesh, seen from above, the heights are those that keep its slopes as well as can be, with the legs' heights
    along them and no slope across ledges. Only heights of shared vertices change, so that the mesh stays closed.
    """
    fine = label_facets(volume.solid.refine_to_length(EDGE_M), volume.pieces, volume.numbers)
    near_legs = network.near_legs(NEAR_M)
    fine = with_leg_lines(fine, network, along_legs(fine, network, near_legs, fine.label == Label.FLOOR))
    is_ledge, steps = ledges_of(fine, near_legs), Steps(fine, near_legs)
    stays, held = np.zeros(len(is_ledge), bool), np.zeros(len(fine.vertices), bool)
    for n in range(_ROUNDS):
        folded = fold_ledges(fine, is_ledge | (fine.label == Label.FLOOR), is_ledge, stays, steps)
        rise = _solve(folded, network, near_legs, held)
        faces = folded.first[folded.volume.faces]
        real = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        turned = (turned_walls(folded, rise, fine) | _new_steps(folded, rise, stays, near_legs)) & ~is_ledge & ~stays
        if n < _TURNS and turned.any():
            is_ledge |= turned
            continue
        moved = folded.volume.vertices + rise[:, None] * [0, 0, 1.0]
        changed = (np.abs(rise) > _STILL_M)[faces[real]].any(axis=1) | folded.was_cut[real]
        crossing = np.unique(crossing_facets(moved, faces[real], CROSSING_M, changed))
        near = near_facets(fine.vertices[fine.faces], moved[faces[real][crossing]], _UNFOLDED_M)
        if not near.any() or held[fine.faces[near]].all():
            break
        stays |= near & is_ledge
        is_ledge &= ~near
        held[fine.faces[near]] = True
    if len(crossing):
        rise = _uncrossed(folded.volume.vertices, faces[real], rise)
    vertices = folded.volume.vertices + rise[:, None] * [0, 0, 1.0]
    label = np.where(folded.is_floor, Label.FLOOR, folded.volume.label)[real]
    moved = replace(folded.volume, faces=faces[real], source=folded.volume.source[real])
    simple = simplified(moved, vertices, label, _SIMPLE_M)
    along = along_legs(simple, network, near_legs, simple.label == Label.FLOOR)
    coarse = coarse_floors(simple, along.facet, along.weights, along.height_m)
    return without_thin_rock(without_slivers(coarse))


def _uncrossed(vertices: np.ndarray, faces: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """Return the rises (v,) m, halved at the corners of facets (f, 3) that would cross."""
    rise = rise.copy()
    changed = np.abs(rise) > _STILL_M
    for _ in range(_HALVINGS):
        pairs = crossing_facets(vertices + rise[:, None] * [0, 0, 1.0], faces, CROSSING_M, changed[faces].any(axis=1))
        crossing = np.unique(pairs)
        changed[:] = False
        changed[faces[crossing]] = True
        if not len(crossing):
            break
        rise[changed] *= 0.5
    return rise


def _solve(folded: FoldedLedges, network: SurveyNetwork, near: NearLegs, held: np.ndarray) -> np.ndarray:
    """Return by how much (v,) m each vertex rises."""
    volume, first = folded.volume, folded.first
    rise = np.zeros(len(volume.vertices))
    faces = first[volume.faces[folded.is_floor]]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    if not len(used):
        return rise
    local = np.full(len(rise), -1)
    local[used] = np.arange(len(used))
    places = volume.vertices[used]
    stiff = _stiffness(places, faces)
    sloping = volume.faces[folded.is_floor & ~folded.is_ledge]
    bends = _stiffness(volume.vertices, sloping) @ (volume.vertices[:, 2] - volume.vertices[:, 2].mean())
    slopes = _sums(local[first], bends, len(used))
    along = along_legs(volume, network, near, folded.is_floor)
    corners, target = local[first[volume.faces[along.facet]]], along.height_m
    rows = np.repeat(np.arange(len(target)), 3)
    B = coo_matrix((along.weights.ravel(), (rows, corners.ravel())), (len(target), len(used))).tocsr()
    weight = np.full(len(used), _PULL)
    weight[local[first[_over_drops(folded)]]] = _HOLD
    stay = local[first[np.flatnonzero(held)]]
    weight[stay[stay >= 0]] = _KEEP
    pull = csr_matrix((weight, (range(len(used)), range(len(used)))), shape=stiff.shape)
    level = float(places[:, 2].mean())
    heights = spsolve(
        (stiff + pull + _FIX * B.T @ B).tocsc(),
        slopes + weight * (places[:, 2] - level) + _FIX * B.T @ (target - level),
    )
    solved = local[first] >= 0
    rise[solved] = heights[local[first[solved]]] + level - volume.vertices[solved, 2]
    return _fade(folded, np.flatnonzero(solved), rise)


def _over_drops(folded: FoldedLedges) -> np.ndarray:
    """Return the corners (n,) of floors from which a wall goes down: another working breaks through there."""
    volume, first = folded.volume, folded.first
    faces = first[volume.faces]
    edges = np.concatenate([faces[:, k] for k in ([0, 1], [1, 2], [2, 0])])
    real = edges[:, 0] != edges[:, 1]
    facet = np.tile(np.arange(len(faces)), 3)[real]
    edges = edges[real]
    height = volume.vertices[:, 2]
    hangs = height[volume.faces].mean(axis=1)[facet] < height[edges].mean(axis=1) - _DROP_M
    code = np.sort(edges, axis=1) @ [len(height), 1]
    floors = np.unique(code[folded.is_floor[facet]])
    found: np.ndarray = np.unique(edges[hangs & ~folded.is_floor[facet] & np.isin(code, floors)])
    return found


def _sums(number: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    found: np.ndarray = np.bincount(number[number >= 0], values[number >= 0], count)
    return found


def _stiffness(places: np.ndarray, faces: np.ndarray) -> csr_matrix:
    """Return the Laplacian (v, v) of triangles seen from above; plumb ones hold their corners together by springs."""
    a, b, c = np.moveaxis(places[faces][:, :, :2], 1, 0)
    double = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    rows, cols, values = [], [], []
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        p, q, r = (places[faces[:, n], :2] for n in (i, j, k))
        cot = np.sum((p - r) * (q - r), axis=1) / np.maximum(np.abs(double), _LEAST_M2) / 2
        spring = 1 / np.maximum(np.linalg.norm(p - q, axis=1), _LEAST_M)
        # Obtuse triangles have negative weights, which are right; of slivers only the springs are.
        longest = np.maximum.reduce([np.sum((x - y) ** 2, axis=1) for x, y in ((p, q), (q, r), (r, p))])
        weight = np.where(np.abs(double) > 0.02 * longest, cot, spring)
        rows.append(faces[:, [i, j, i, j]])
        cols.append(faces[:, [j, i, i, j]])
        values.append(np.column_stack([-weight, -weight, weight, weight]))
    size = len(places)
    return coo_matrix(
        (np.concatenate(values).ravel(), (np.concatenate(rows).ravel(), np.concatenate(cols).ravel())), (size, size)
    ).tocsr()


def _fade(folded: FoldedLedges, used: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """Let the walls' vertices move with the floor's rim, less with height, so that walls keep their order.

    Their rise is harmonic on the mesh, and none from so high above the rim that no wall turns over.
    """
    volume = folded.volume
    vertices = volume.vertices
    reach = np.maximum(_FADE_M, _STEEPEST_FADE * np.abs(rise[used]))
    near, at = cKDTree(vertices[used]).query(vertices, distance_upper_bound=float(reach.max(initial=0.0)))
    moving = np.isfinite(near)
    moving[moving] = near[moving] < reach[at[moving]]
    moving[used] = False
    local = np.full(len(vertices), -1)
    local[moving] = np.arange(int(moving.sum()))
    a, b = (np.concatenate([folded.first[volume.faces[:, k]] for k in order]) for order in ((0, 1, 2), (1, 2, 0)))
    some = (moving[a] | moving[b]) & (a != b)
    a, b = a[some], b[some]
    weight = 1 / np.maximum(np.linalg.norm(vertices[a] - vertices[b], axis=1), _LEAST_M)
    ours = moving[a]
    pair = ours & moving[b]
    count = int(moving.sum())
    fixed = ours & ~moving[b]
    pull = np.bincount(local[a[ours]], weight[ours], count) + np.bincount(local[b[moving[b]]], weight[moving[b]], count)
    stiff = coo_matrix((weight[pair], (local[a[pair]], local[b[pair]])), (count, count))
    target = np.bincount(local[a[fixed]], weight[fixed] * rise[b[fixed]], count)
    other = moving[b] & ~ours
    target += np.bincount(local[b[other]], weight[other] * rise[a[other]], count)
    laplacian = coo_matrix((pull + _LONE, (np.arange(count), np.arange(count))), (count, count)) - stiff - stiff.T
    rise[moving] = spsolve(laplacian.tocsc(), target)
    return rise


def _new_steps(folded: FoldedLedges, rise: np.ndarray, stays: np.ndarray, near: NearLegs) -> np.ndarray:
    """Return which facets (f,) of the fine mesh are low steps between floors of legs that meet, as these have risen."""
    moved = replace(folded.volume, vertices=folded.volume.vertices + rise[:, None] * [0, 0, 1.0])
    some = walls_on_floors(moved, folded.is_floor, stays[folded.parent])
    found = np.zeros(len(stays), bool)
    found[folded.parent[are_steps(moved, folded.is_floor, some, MIDDLE, near)]] = True
    return found


def turned_walls(folded: FoldedLedges, rise: np.ndarray, fine: Volume) -> np.ndarray:
    """Return which facets (f,) of the fine mesh are low walls that turn over as their corners rise."""
    volume = folded.volume
    moved = volume.vertices + rise[:, None] * [0, 0, 1.0]
    a, b, c = np.moveaxis(moved[folded.first[volume.faces]], 1, 0)
    turned = (np.sum(np.cross(b - a, c - a) * volume.normals, axis=1) < 0) & ~folded.is_floor
    low = np.ptp(volume.vertices[volume.faces, 2], axis=1) < DEEPEST_M
    found = np.zeros(len(fine.faces), bool)
    found[folded.parent[turned & low]] = True
    return found & (fine.normals[:, 2] < _OVERHANG * np.linalg.norm(fine.normals, axis=1))
