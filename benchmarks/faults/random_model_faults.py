"""Random changes of `mine.xml`: attributes, elements and vertices of collision parts."""

from __future__ import annotations

import re

import numpy as np

from minexplore.bundle import MODEL

Files = dict[str, bytes]

_ATTRIBUTE = re.compile(r' ([a-z_A-Z]+)="([^"]*)"')
_ELEMENT = re.compile(r"^ *<[a-z]+ [^>]*/>\n", re.MULTILINE)
NUMBER = re.compile(r"-?\d+\.?\d*(?:e-?\d+)?")
# Attributes and elements that MuJoCo knows and the builder does not write there.
_FOREIGN = """margin="0.2"|gap="0.1"|solref="0.5 0.1"|solimp="0 0 1"|condim="1"|contype="0"|conaffinity="0"|priority="5"
friction="0.01 0 0"|group="1"|mass="3"|density="1"|rgba="1 0 0 0"|euler="0 0 0.1"|axisangle="1 0 0 0.01"
quat="0.99 0.1 0 0"|pos="1 1 1"|size="1 1 1"|type="sphere"|class="rock"|gravcomp="1"|mocap="true"|childclass="rock"
scale="2 2 2"|maxhullvert="4"|active="false"|mode="track"|user="1"|fluidshape="ellipsoid"|material="ground_mud"
mesh="rock_0001"|shellinertia="true\"""".replace("\n", "|").split("|")
_ELEMENTS = """<option gravity="0 0 -3.7"/>|<option timestep="0.05" cone="elliptic"/>|<keyframe/>|<custom/>|<contact/>
<option><flag contact="disable"/></option>|<size njmax="1"/>|<include file="more.xml"/>|<geom type="box" size="1 1 1"/>
<geom name="floor_more" type="box" size="1 1 1" pos="9 2 0" group="0"/>|<site name="s"/>|<joint type="slide"/>
<body name="b"><freejoint/><geom size="1"/></body>|<freejoint/>|<camera name="c"/>|<frame pos="0 0 1"/>|<tendon/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>|<light name="spot_77" pos="1 1 1"/>|<material name="ground_more"/>
<mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>|<texture name="t" type="2d" builtin="flat" width="4" height="4"/>
<numeric name="n" data="1"/>|<default class="more"/>""".replace("\n", "|").split("|")


def pick(rng: np.random.Generator, items: list) -> int:
    """Return the number of one of the items."""
    return int(rng.integers(len(items)))


def other_number(value: float, rng: np.random.Generator) -> float:
    """Return a number that differs from `value`: close, far, opposite in sign, zero, or very large."""
    kinds = [value * 1.001 + 1e-3, value + float(rng.normal()), 2 * value + 1, -value - 0.5, 0.0 if value else 1.0, 1e9]
    return kinds[int(rng.integers(len(kinds)))]


def written(value: float) -> str:
    """Return a number as MuJoCo writes it."""
    return f"{value:.6g}"


def attribute_value(files: Files, rng: np.random.Generator) -> str:
    """Change a number or a text of an attribute."""
    text = files[MODEL].decode()
    found = list(_ATTRIBUTE.finditer(text))
    at = found[pick(rng, found)]
    numbers = list(NUMBER.finditer(at[2]))
    if numbers and rng.random() < 0.8:
        number = numbers[pick(rng, numbers)]
        value = at[2][: number.start()] + written(other_number(float(number[0]), rng)) + at[2][number.end() :]
    else:
        value = found[pick(rng, found)][2] if rng.random() < 0.7 else at[2] + "x"
    files[MODEL] = (text[: at.start(2)] + value + text[at.end(2) :]).encode()
    return f"{MODEL}: {at[1]}={at[2][:30]!r} -> {value[:30]!r}"


def attribute_dropped(files: Files, rng: np.random.Generator) -> str:
    """Drop an attribute."""
    text = files[MODEL].decode()
    found = list(_ATTRIBUTE.finditer(text))
    at = found[pick(rng, found)]
    files[MODEL] = (text[: at.start()] + text[at.end() :]).encode()
    return f"{MODEL}: {at[1]}={at[2][:30]!r} dropped"


def attribute_added(files: Files, rng: np.random.Generator) -> str:
    """Add an attribute that MuJoCo knows."""
    text = files[MODEL].decode()
    found = list(re.finditer(r"<[a-z]+(?= |/?>)", text))
    at, more = found[pick(rng, found)], _FOREIGN[pick(rng, _FOREIGN)]
    files[MODEL] = (text[: at.end()] + f" {more}" + text[at.end() :]).encode()
    return f"{MODEL}: {more} added to {at[0]}"


def element_moved(files: Files, rng: np.random.Generator) -> str:
    """Repeat, drop or move an element."""
    text = files[MODEL].decode()
    found = list(_ELEMENT.finditer(text))
    at, to = found[pick(rng, found)], found[pick(rng, found)].start()
    kind = int(rng.integers(3))
    without = text if kind == 0 else text[: at.start()] + text[at.end() :]
    to = min(to, len(without)) if kind == 0 or to <= at.start() else to - len(at[0])
    files[MODEL] = (without if kind == 1 else without[:to] + at[0] + without[to:]).encode()
    return f"{MODEL}: {at[0].strip()[:50]} {('repeated', 'dropped', 'moved')[kind]}"


def element_added(files: Files, rng: np.random.Generator) -> str:
    """Add an element that MuJoCo knows."""
    text = files[MODEL].decode()
    found = [m.end() for m in re.finditer(r">\n", text)][:-1]
    at, more = found[pick(rng, found)], _ELEMENTS[pick(rng, _ELEMENTS)]
    files[MODEL] = (text[:at] + more + "\n" + text[at:]).encode()
    return f"{MODEL}: {more[:60]} added"


def rock_vertex(files: Files, rng: np.random.Generator) -> str:
    """Move a vertex of a collision part."""
    text = files[MODEL].decode()
    found = list(re.finditer(r'vertex="([^"]*)"', text))
    at = found[pick(rng, found)]
    numbers = at[1].split(" ")
    number = pick(rng, numbers)
    numbers[number] = written(float(numbers[number]) + float(rng.choice([-3, -0.3, -0.05, 0.05, 0.3, 3])))
    files[MODEL] = (text[: at.start(1)] + " ".join(numbers) + text[at.end(1) :]).encode()
    return f"{MODEL}: coordinate {number} of a collision part -> {numbers[number]}"
