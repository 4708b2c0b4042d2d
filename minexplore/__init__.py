"""Gymnasium environments in worlds compiled from real mine surveys; reads a world bundle and nothing else."""

import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from minexplore.ends import end_at_once_if_interrupted

end_at_once_if_interrupted("minexplore", "baselines", "pipeline", "stages", "benchmarks.corpus")  # Gymnasium takes long

from gymnasium.envs.registration import register  # noqa: E402

from minexplore.bundle import RECORD  # noqa: E402
from minexplore.task import TaskParams  # noqa: E402

if TYPE_CHECKING:
    from minexplore.world import World

__version__ = "0.2.0"
__all__ = ["FAMILY", "ROBOT_TASKS", "WORLDS", "MineVecEnv", "Pose", "environments", "is_built_in", "load", "place"]

FAMILY = "MineXplore/Family-v0"
_EXTRA = {"MineVecEnv": "sb3", "Pose": "placing.place", "place": "placing.place"}  # and the modules in `extra`
_CORPUS = "corpus:"  # begins the name of a world of a corpus
ENTRY_POINT, VECTOR_ENTRY_POINT = "minexplore.envs.env:MineEnv", "minexplore.backends:make_vector_env"

# Built-in ids, with what each changes in the task. Two cores train on the entrance's short horizon within an hour.
WORLDS: dict[str, dict[str, Any]] = {
    "MineXplore/World-v0": {},
    "MineXplore/ChileanMine-v0": {"world": "chilean_mine"},
    "MineXplore/ChileanMineFlatDry-v0": {"world": "chilean_mine", "task": {"terrain": False, "tilt": False}},
    "MineXplore/ChileanMineEntrance-v0": {"world": "chilean_mine", "task": {"region_m": 60.0, "max_steps": 1500}},
}

# The embedded mine with this package's other robots: tasks of their own, which policies are not compared in by default.
ROBOT_TASKS: dict[str, dict[str, Any]] = {
    "MineXplore/ChileanMineHusky-v0": {"world": "chilean_mine", "robot": "husky"},
    "MineXplore/ChileanMineQuadrotor-v0": {"world": "chilean_mine", "robot": "quadrotor"},
}

# A source checkout's own worlds, made by `python -m pipeline new NAME`, are MineXplore/NAME-v0.
OWN_WORLDS: dict[str, dict[str, Any]] = {
    f"MineXplore/{_record.parents[2].name}-v0": {"world": str(_record.parent)}
    for _record in sorted(Path(__file__).parents[1].glob(f"artifacts/worlds/*/realism/world/{RECORD}"))
    if re.fullmatch(r"[A-Za-z0-9_-]+", _record.parents[2].name)
}

# The mines of the generated family that a source checkout has built, made by `python -m benchmarks worlds`.
FAMILY_MINES: dict[str, dict[str, Any]] = {
    f"MineXplore/Family-{_record.parents[3].name}-{_record.parents[2].name}-v0": {"world": str(_record.parent)}
    for _record in sorted(Path(__file__).parents[1].glob(f"artifacts/families/light/*/*/realism/world/{RECORD}"))
    if re.fullmatch(r"(train|validation|test)-\d{4}", f"{_record.parents[3].name}-{_record.parents[2].name}")
}


def is_built_in(env_id: str) -> bool:
    """Return whether an id is one of this package's, also those of the family's mines that are not built."""
    taken = (f"{FAMILY.removesuffix('-v0')}-", "MineXplore/GoTo-")
    return env_id in {**WORLDS, **ROBOT_TASKS, FAMILY: {}} or env_id.startswith(taken)


def environments() -> dict[str, dict[str, Any]]:
    """Return the arguments of every environment by its id, the built-in ones first; a built-in id is never replaced."""
    built_in = {**WORLDS, **ROBOT_TASKS}
    return {**built_in, **{env_id: kwargs for env_id, kwargs in OWN_WORLDS.items() if not is_built_in(env_id)}}


def load(world: str | Path, source: str | Path | None = None, sha256: str | None = None) -> "World":
    """Check a world and read it; one of a corpus is fetched, and gets the id `MineXplore/corpus:NAME-v0`.

    Parameters
    ----------
    world : str or Path
        A bundle's folder, the name of a world that ships with the package, or `corpus:NAME`.
    source : str or Path, optional
        The folder or address of the corpus, see `minexplore.extra.corpus.open_corpus`.
    sha256 : str, optional
        Of the corpus's index.

    Raises
    ------
    FileNotFoundError
        If there is no such world.
    BundleError
        If it is no sealed bundle, see `minexplore.sealed`; `python -m pipeline certify` checks all that it holds.
    """
    if str(world).startswith(_CORPUS):
        from minexplore.extra.corpus import open_corpus

        return open_corpus(source, sha256).load(str(world).removeprefix(_CORPUS))
    from minexplore.world import find_world, load_world

    return load_world(find_world(world))


def __getattr__(name: str) -> Any:
    """Import a name of `_EXTRA` when it is first asked for: it needs MuJoCo, or packages of an extra."""
    if name not in _EXTRA:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"minexplore.extra.{_EXTRA[name]}"), name)


def register_env(env_id: str, kwargs: dict[str, Any], one: str = ENTRY_POINT, many: str = VECTOR_ENTRY_POINT) -> None:
    """Register an environment, whose episodes end after its task's `max_steps`, and the same with a goal."""
    goal = {"goal": {}, **kwargs, "task": {"max_steps": 3000, **kwargs.get("task", {})}}
    goal_id = re.sub(r"(?:World-)?([^/:]*)$", r"GoTo-\1", env_id, count=1)
    for name, given in ((env_id, kwargs), (goal_id, goal)):
        steps = given.get("task", {}).get("max_steps", TaskParams.max_steps)
        register(name, one, vector_entry_point=many, kwargs=given, max_episode_steps=steps)


for _id, _kwargs in {**environments(), **FAMILY_MINES}.items():
    register_env(_id, _kwargs)
register_env(FAMILY, {}, "minexplore.envs.family:FamilyEnv", "minexplore.envs.family:FamilyVectorEnv")
