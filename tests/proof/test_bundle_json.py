"""Any value in any field of any JSON file of a world is refused with one line, or is a value that a builder writes."""

import json
import shutil
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.faults.judge import prove
from minexplore.bundle import MADE_BY, BundleError
from minexplore.sealed.files import read_folder
from minexplore.sealed.json_text import read_json
from pipeline.errors import MineError
from pipeline.schema import check_world
from tests.composed import compose
from tests.mines import sealed

_NO_NUMBERS = ["NaN", "Infinity", "-Infinity", "1e400", "-1e400", "9" * 400, "1" + "0" * 25, "0." + "1" * 30]
_VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**24), 10**24),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(max_size=20),
    st.lists(st.integers(-2, 10**18), max_size=4),
    st.dictionaries(st.text(max_size=4), st.none(), max_size=2),
    st.sampled_from(["1", "nan", "1_0", "\x1b[31m\n", -1, 0, 1e300, 2**63, 10**24, [[[]]], 5e-324]),
)
_MARK = "the value"


@pytest.fixture(scope="session")
def world(small_world) -> Path:
    return small_world


@pytest.fixture(scope="module")
def params():
    return compose([]).validation


@pytest.fixture(scope="module")
def fields(world) -> list[tuple[str, tuple[str | int, ...]]]:
    """Return every place of every JSON file: of a list, its first and its last element."""
    files = read_folder(world)
    names = [name for name in files if name.endswith(("json", ".geojson")) and name != MADE_BY]  # see test_claims
    assert len(names) == 3
    return [(name, place) for name in names for place in places_in(json.loads(files[name]))]


def places_in(value: Any) -> list[tuple[str | int, ...]]:
    inner = value.items() if isinstance(value, dict) else ()
    if isinstance(value, list) and value:
        inner = [(at, value[at]) for at in sorted({0, len(value) - 1})]
    return [(), *((key, *rest) for key, one in inner for rest in places_in(one))]


def changed(content: Any, place: tuple[str | int, ...], value: Any) -> Any:
    """Return JSON with another value at a place; the content itself is changed."""
    if not place:
        return value
    at = content
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    return content


def written(world: Path, files: dict[str, bytes]) -> Path:
    """Write a changed world beside the good one."""
    folder = world.with_name("changed")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(world, folder, copy_function=lambda source, target: Path(target).hardlink_to(source))
    for name, data in files.items():
        (folder / name).unlink()
        (folder / name).write_bytes(data)
    return folder


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_number_that_is_none_is_refused_in_every_field_with_its_path(world, fields, data):
    name, place = data.draw(st.sampled_from(fields))
    files = read_folder(world)
    text = json.dumps(changed(json.loads(files[name]), place, _MARK))
    number = data.draw(st.sampled_from(_NO_NUMBERS))
    folder = written(world, {name: text.replace(f'"{_MARK}"', number).encode()})
    if name != "world.json":
        folder = written(world, sealed(files | {name: (folder / name).read_bytes()}))
    path = "".join(f"[{key}]" if isinstance(key, int) else f".{key[:40]}" for key in place).lstrip(".")
    with pytest.raises(BundleError) as caught:
        check_world(folder)
    assert str(caught.value).startswith(
        f"{folder}/{name}: {path or 'its content'} = {number[:40]}: want a finite number"
    )


@pytest.mark.parametrize(
    ("name", "place", "text"),
    [
        ("topology.json", ("legs", 0, "length_m"), "NAN"),
        ("topology.json", ("loops",), "1"),
        ("free_space.geojson", ("features", 0, "properties", "tolerance_m"), "0.16"),
        ("free_space.geojson", ("features", 0, "properties", "areas", "tunnel_m2"), "inf"),
    ],
)
def test_a_text_is_no_number_whatever_it_spells(world, params, name, place, text):
    files = read_folder(world)
    content = changed(json.loads(files[name]), place, text)
    folder = written(world, sealed(files | {name: (json.dumps(content) + "\n").encode()}))
    with pytest.raises(MineError, match=f"{name}: not a readable"):
        prove(folder, params)


@pytest.mark.slow
@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_value_in_any_field_is_refused_with_one_line_or_allowed(world, params, fields, data):
    prove_changed(world, params, fields, data)


@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_some_values_in_some_fields_are_refused_with_one_line_or_allowed(world, params, fields, data):
    prove_changed(world, params, fields, data)


def prove_changed(
    world: Path, params: Any, fields: list[tuple[str, tuple[str | int, ...]]], data: st.DataObject
) -> None:
    name, place = data.draw(st.sampled_from(fields))
    files = read_folder(world)
    content = changed(json.loads(files[name]), place, data.draw(_VALUES))
    if name == "world.json" and not isinstance(content, dict):
        return  # it has no hashes to hold
    folder = written(world, sealed(files | {name: (json.dumps(content) + "\n").encode()}))
    message = f"{folder}/"
    try:
        prove(folder, params)
    except MineError as error:
        message = str(error)
    assert message.isprintable()
    assert message.startswith(f"{folder}/")


def test_a_key_that_stands_twice_among_many_is_found_in_time_that_grows_with_their_number():
    text = b"{" + b"".join(b'"k%d":1,' % k for k in range(100_000)) + b'"k1":1}'
    before = time.process_time()
    with pytest.raises(BundleError, match="k1 stands twice"):
        read_json("world.json", text)
    assert time.process_time() - before < 3  # it takes 0.14; comparing each with all takes minutes
