"""Forged results files: honest ones with fields, paths, curves or bytes changed, and every hash made to fit again."""

from __future__ import annotations

import copy
import hashlib
import json
from collections.abc import Callable
from typing import Any

import numpy as np

from baselines.result_file import Episode, Head
from benchmarks.fuzz import mutate
from minexplore.reward import COLLISION_PENALTY, COVERAGE_GAIN, IDLE_PENALTY, MILESTONES

Lines = list[dict[str, Any]]  # a results file: its head, then its episodes
Change = Callable[[Lines, np.random.Generator], None]

_VALUES: list[Any] = [  # of which most are no value of any field
    *(0, -1, 1, 2**31, 2**63, -(2**63) - 1, 10**400, 0.5, -0.0, 1e308, float("nan"), float("inf")),
    *(True, None, "", "0" * 64, "random", "../../etc/passwd", "\x1b[2J", "| x |", "a" * 10**6, "\ud800"),
    *([], {}, [[]], [0] * 10_000, {"a": {"b": [1]}}, [[1, 2, 3]], ["0"], [None]),
]


def forge(head: Head, episodes: list[Episode], rng: np.random.Generator) -> bytes:
    """Return a forged copy of a results file."""
    kind = int(rng.integers(10))
    lines: Lines = [json.loads(head.model_dump_json()), *(json.loads(e.model_dump_json()) for e in episodes)]
    if kind == 0:
        return mutate(seal(lines), rng)
    if kind == 1:
        return _random_text(rng)
    with np.errstate(all="ignore"):
        for change in rng.choice(len(CHANGES), size=int(rng.integers(1, 4))).tolist():
            CHANGES[change](lines, rng)
    return seal(lines)


def seal(lines: Lines) -> bytes:
    """Return the file's text with the hash of each line in the next one."""
    texts: list[str] = []
    for number, line in enumerate(lines):
        if number and isinstance(line, dict) and "previous" in line:
            line["previous"] = hashlib.sha256(json.dumps(lines[number - 1], sort_keys=True).encode()).hexdigest()
        texts.append(json.dumps(line))
    return ("\n".join(texts) + "\n").encode()


def pay(episode: dict[str, Any], total: int, useful: int | None = None) -> None:
    """Make an episode's idle steps and return agree with its cells, as a careful forger would."""
    gains = np.diff(episode["seen"])
    useful = int((gains > 0).sum()) if useful is None else useful
    episode["idle"] = max(0, episode["steps"] - useful)
    bonus = sum(b for share, b in MILESTONES if episode["seen"][0] < share * total <= episode["seen"][-1])
    returned = gains.sum() * COVERAGE_GAIN / total - episode["idle"] * IDLE_PENALTY + bonus
    episode["returned"] = round(float(returned) - episode["collided"] * COLLISION_PENALTY, 6)


def _random_text(rng: np.random.Generator) -> bytes:
    """Return text that looks like a results file, or like a trap for its reader."""
    size = int(rng.integers(1, 200_000))
    texts = [
        lambda: rng.bytes(size),
        lambda: b"[" * size,
        lambda: b'{"a":' * size + b"1" + b"}" * size + b"\n",
        lambda: b'{"format":"minexplore-results/1","seeds":[' + b"9" * size + b"]}\n",
        lambda: b"{}\n" * (size // 3),
        lambda: b"\n" * size,
        lambda: b'{"seeds":[' + b"0," * size + b"0]}\n",
        lambda: b'"' + b"\\u0000" * (size // 6) + b'"\n',
    ]
    return texts[int(rng.integers(len(texts)))]()


def _pick(lines: Lines, rng: np.random.Generator) -> dict[str, Any]:
    return lines[int(rng.integers(1, len(lines)))] if len(lines) > 1 else {}


def _set_any_field(lines: Lines, rng: np.random.Generator) -> None:
    line = lines[int(rng.integers(len(lines)))]
    keys = list(line)
    line[keys[int(rng.integers(len(keys)))]] = copy.deepcopy(_VALUES[int(rng.integers(len(_VALUES)))])


def _set_any_element(lines: Lines, rng: np.random.Generator) -> None:
    episode = _pick(lines, rng)
    key = ["seen", "path_cm"][int(rng.integers(2))]
    values = episode.get(key)
    if isinstance(values, list) and values:
        values[int(rng.integers(len(values)))] = copy.deepcopy(_VALUES[int(rng.integers(len(_VALUES)))])


def _remove_or_add_a_field(lines: Lines, rng: np.random.Generator) -> None:
    line = lines[int(rng.integers(len(lines)))]
    keys = list(line)
    if rng.integers(2) and keys:
        del line[keys[int(rng.integers(len(keys)))]]
    else:
        line["\x1b]0;name"] = 1


def _change_a_task(lines: Lines, rng: np.random.Generator) -> None:
    task = lines[0].get("task")
    if isinstance(task, dict) and task:
        task[list(task)[int(rng.integers(len(task)))]] = copy.deepcopy(_VALUES[int(rng.integers(len(_VALUES)))])


def _scale_a_number(lines: Lines, rng: np.random.Generator) -> None:
    episode, key = _pick(lines, rng), ["steps", "idle", "collided", "path_m", "returned"][int(rng.integers(5))]
    if isinstance(episode.get(key), int | float):
        kind = type(episode[key])
        episode[key] = kind(episode[key] * rng.uniform(0.5, 2) + rng.integers(-2, 3))


def _careful(change: Change) -> Change:
    """Return a change of plausible episodes only, which pays for the cells afterwards."""

    def changed(lines: Lines, rng: np.random.Generator) -> None:
        try:
            change(lines, rng)
            for episode in lines[1:]:
                if rng.integers(4):
                    pay(episode, lines[0]["cells"])
        except (TypeError, ValueError, KeyError, IndexError, OverflowError, ZeroDivisionError, AttributeError):
            return  # an earlier change has left nothing to be careful with

    return changed


def _see_more(lines: Lines, rng: np.random.Generator) -> None:
    episode = _pick(lines, rng)
    seen = np.array(episode["seen"])
    factor = rng.uniform(1.0, 1.5)
    episode["seen"] = np.minimum(seen[0] + (seen - seen[0]) * factor, lines[0]["cells"]).astype(int).tolist()


def _see_earlier(lines: Lines, rng: np.random.Generator) -> None:
    episode, ahead = _pick(lines, rng), int(rng.integers(1, 8))
    seen = episode["seen"]
    episode["seen"] = [seen[0], *seen[1 + ahead :], *[seen[-1]] * ahead][: len(seen)]


def _move_places(lines: Lines, rng: np.random.Generator) -> None:
    episode, reach = _pick(lines, rng), int(rng.integers(1, 400))
    path = np.array(episode["path_cm"])
    low, high = sorted(rng.integers(len(path), size=2).tolist())
    path[low : high + 1] += rng.integers(-reach, reach + 1, size=2)
    episode["path_cm"] = path.tolist()


def _take_anothers_way(lines: Lines, rng: np.random.Generator) -> None:
    ours, theirs = _pick(lines, rng), _pick(lines, rng)
    for key in ("steps", "seen", "path_cm", "idle", "collided", "path_m", "returned"):
        ours[key] = copy.deepcopy(theirs[key])


def _hide_collisions(lines: Lines, rng: np.random.Generator) -> None:
    episode = _pick(lines, rng)
    useful = episode["steps"] - episode["idle"]
    episode["collided"] = int(episode["collided"] * rng.uniform(0, 1))
    pay(episode, lines[0]["cells"], useful)


def _work_harder(lines: Lines, rng: np.random.Generator) -> None:
    episode = _pick(lines, rng)
    gained = int(episode["seen"][-1] - episode["seen"][0])
    pay(episode, lines[0]["cells"], min(episode["steps"], int(rng.integers(gained + 1))))


def _end_earlier(lines: Lines, rng: np.random.Generator) -> None:
    episode = _pick(lines, rng)
    samples = int(rng.integers(2, len(episode["seen"])))
    episode["steps"] = 20 * (samples - 1)
    episode["seen"], episode["path_cm"] = episode["seen"][:samples], episode["path_cm"][:samples]
    moved = np.linalg.norm(np.diff(np.array(episode["path_cm"]) / 100, axis=0), axis=1)
    episode["path_m"] = round(float(moved.sum()), 3)
    episode["collided"] = min(episode["collided"], episode["steps"])


def _reorder_seeds(lines: Lines, rng: np.random.Generator) -> None:
    order = rng.permutation(len(lines) - 1)
    lines[1:] = [lines[1 + k] for k in order.tolist()]
    if rng.integers(2):
        lines[0]["seeds"] = [line["seed"] for line in lines[1:]]
    else:
        for seed, line in zip(lines[0]["seeds"], lines[1:], strict=False):
            line["seed"] = seed


def _drop_or_repeat_an_episode(lines: Lines, rng: np.random.Generator) -> None:
    at = int(rng.integers(1, len(lines)))
    if rng.integers(2):
        del lines[at]
    else:
        lines.insert(at, copy.deepcopy(lines[at]))
        lines[at]["seed"] = int(rng.integers(40))
    lines[0]["seeds"] = [line["seed"] for line in lines[1:]]


CHANGES: list[Change] = [
    _set_any_field,
    _set_any_element,
    _remove_or_add_a_field,
    _change_a_task,
    _scale_a_number,
    *map(
        _careful,
        (
            _see_more,
            _see_earlier,
            _move_places,
            _take_anothers_way,
            _hide_collisions,
            _work_harder,
            _end_earlier,
            _reorder_seeds,
            _drop_or_repeat_an_episode,
        ),
    ),
]
