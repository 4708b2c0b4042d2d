"""What a policy is, and how one is found by name."""

from __future__ import annotations

import ast
import hashlib
import inspect
import pkgutil
import re
import sys
from pathlib import Path
from typing import Any, Protocol, TypeGuard, cast

import numpy as np

import minexplore
from baselines.base.errors import BaselineError
from baselines.base.result_file import CHECKPOINTS, MOST_POLICY, POLICY
from baselines.explorers import EXPLORERS
from baselines.graph import checkpoint as graph_checkpoint
from baselines.graph.policy import GraphPolicy
from baselines.policies.learned import LearnedPolicy
from baselines.policies.learned import trained_in as ppo_trained_in
from baselines.policies.policy_source import find_source, read_source, require_checkpoint, source_sha256
from minexplore.physics.quadrotor import QuadrotorParams
from minexplore.physics.robot import RobotParams
from minexplore.physics.robot_kind import Robot
from minexplore.task import TaskParams

RESERVED = ("oracle-tour",)  # names of rows that are no policy of this module
_PACKAGE = "baselines"
TRAINED = Path("artifacts/train")  # NAME/policy.safetensors, written by training

_NO_POLICY = {"baselines.base.errors"}  # its messages are no part of what a policy does


class Policy(Protocol):
    """Drives n robots, each alone in its own copy of a mine, by their local observations and true poses."""

    def reset(self, robots: np.ndarray, seeds: np.ndarray) -> None:
        """Begin new episodes of robots (k,); all random numbers are drawn from their seeds (k,)."""

    def act(self, observation: np.ndarray, info: dict[str, Any]) -> np.ndarray:
        """Return commands (n, 2) in [-1, 1].

        Parameters
        ----------
        observation : (n, features) float32
            What `minexplore.sensing.observation.observation_space` describes.
        info : dict
            The environment's. A policy may use the poses `pose_m_rad` (n, 3) and, in a mine with heights, `height_m`,
            `pitch_rad` and `roll_rad` (n,), and nothing else.
        """


def make_policy(name: str, count: int, task: TaskParams, robot: Robot | None = None, heights: bool = False) -> Policy:
    """Return a policy for `count` robots.

    Parameters
    ----------
    name : str
        A classical explorer; `package.module:Class`, made as `Class(count, task, robot)`; the name of a learned policy
        below `baselines/results/checkpoints` or `artifacts/train`; or a file NAME.safetensors.
    count : int
    task : TaskParams
    robot : Robot, optional
        The default robot without it. A robot that flies has explorers of its own.
    heights : bool
        Whether the mine has heights, see `minexplore.world.World.has_heights`: explorers then map it in layers.

    Raises
    ------
    BaselineError
        If there is no policy of that name, or it does not know such robots; the message lists the choices.
    """
    robot = robot or RobotParams()
    if name in EXPLORERS and fits(name, robot):
        return EXPLORERS[name].kind(heights, robot.FLIES)(count, task, robot)
    if ":" in name:
        return _import_class(name)(count, task, robot)
    if robot.FLIES:
        flying = ", ".join(known for known in EXPLORERS if fits(known, robot))
        raise BaselineError(
            f"policy = {name!r}: it drives on floors; of robots that fly valid choices are {flying}, module:Class"
        )
    path = find_checkpoint(name)
    graph = graph_checkpoint.format_of(path) == graph_checkpoint.FORMAT
    if graph:
        return GraphPolicy(path, count, task, cast(RobotParams, robot), heights)  # it uses what all on wheels have
    return LearnedPolicy(path, count, task)


def fits(name: str, robot: Robot) -> bool:
    """Return whether a policy of this name drives a robot of this kind; kept checkpoints fly none."""
    return not robot.FLIES or (name in EXPLORERS and EXPLORERS[name].flying is not None)


def trained_in(path: Path) -> str:
    """Return the id of the environment that a checkpoint was trained in.

    Raises
    ------
    BaselineError
        If it is no policy's file.
    """
    if graph_checkpoint.format_of(path) == graph_checkpoint.FORMAT:
        return minexplore.FAMILY
    return ppo_trained_in(path)


def find_checkpoint(name: str) -> Path:
    """Return the file of a learned policy by its path or its name.

    Raises
    ------
    BaselineError
        If there is none, and the message lists what can be evaluated, or the file cannot be a checkpoint.
    """
    if name.endswith(".safetensors"):
        require_checkpoint(Path(name))
        return Path(name)
    for path in (CHECKPOINTS / f"{name}.safetensors", TRAINED / name / "policy.safetensors"):
        if path.is_file():
            return path
    kept = ", ".join(sorted(path.stem for path in CHECKPOINTS.glob("*.safetensors"))) or "none"
    raise BaselineError(
        f"policy = {name!r}: valid choices are {', '.join(EXPLORERS)}, module:Class, a file NAME.safetensors, "
        f"or a learned policy by name (kept: {kept})"
    )


def policy_label(name: str) -> str:
    """Return what results call a policy: its name, `module.Class`, or its checkpoint without folder and ending.

    Raises
    ------
    BaselineError
        If that is no name that a results file may hold.
    """
    label = name.replace(":", ".")
    if name.endswith(".safetensors"):
        path = Path(name)
        label = path.resolve().parent.name if path.stem == "policy" else path.stem
        if label in (*EXPLORERS, *RESERVED):
            raise BaselineError(f"policy = {label!r}: a checkpoint must not be called as an explorer is")
    if len(label) > MOST_POLICY or not re.fullmatch(POLICY, label):
        raise BaselineError(
            f"policy = {label!r}: results are called by 1 to {MOST_POLICY} of A-Z, a-z, 0-9, '_' and '-', "
            "with single dots between them"
        )
    return label


def policy_sha256(policy: Policy) -> str:
    """Return the hash of what a policy does: its class, its code with all that it imports here, its weights.

    A class from outside `baselines` is known by all files of its module or package.
    """
    kind = type(policy)
    top = kind.__module__.partition(".")[0]
    if top != _PACKAGE:
        return source_sha256(read_source(find_source(top)))
    checkpoint = getattr(policy, "path", None)
    return _own_sha256(kind, checkpoint if isinstance(checkpoint, Path) else None)


def checkpoint_sha256(path: Path) -> str:
    """Return the hash of the policy that a checkpoint makes; only its header is read."""
    graph = graph_checkpoint.format_of(path) == graph_checkpoint.FORMAT
    return _own_sha256(GraphPolicy if graph else LearnedPolicy, path)


def known_sha256(label: str, heights: bool, flies: bool = False) -> str | None:
    """Return the hash of the explorer or kept checkpoint of a name, in any capitals; None if there is none.

    Explorers are those for mines with or without heights, or for robots that fly.
    """
    wanted = label.casefold()
    for name in EXPLORERS:
        if name.casefold() == wanted and (not flies or EXPLORERS[name].flying is not None):
            robot = QuadrotorParams() if flies else RobotParams()
            return policy_sha256(make_policy(name, 1, TaskParams(), robot, heights))
    kept = next((path for path in CHECKPOINTS.glob("*.safetensors") if path.stem.casefold() == wanted), None)
    return checkpoint_sha256(kept) if kept is not None else None


def _own_sha256(kind: type, checkpoint: Path | None) -> str:
    code = sorted(_code_of(path) for path in source_files(kind))
    parts = [kind.__qualname__.encode(), *(line.encode() for line in code)]
    if checkpoint is not None:
        parts.append(checkpoint.read_bytes())
    return hashlib.sha256(b"".join(parts)).hexdigest()


def _code_of(path: Path) -> str:
    """Return a module's lines without imports, docstrings and blank lines, which say nothing of what a policy does."""
    text = path.read_text()
    left_out: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom) or _is_docstring(node):
            left_out.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    kept = (line for number, line in enumerate(text.splitlines(), 1) if number not in left_out and line.strip())
    return "".join(f"{line}\n" for line in kept)


def _is_docstring(node: ast.AST) -> TypeGuard[ast.Expr]:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def source_files(kind: type) -> list[Path]:
    """Return the files of a class's module and of the modules of `baselines` that it uses."""
    found: set[str] = set()
    waiting = {base.__module__ for base in kind.__mro__ if base.__module__.partition(".")[0] == _PACKAGE}
    while waiting:
        module = waiting.pop()
        found.add(module)
        for value in vars(sys.modules[module]).values():
            used = value.__name__ if inspect.ismodule(value) else getattr(value, "__module__", None)
            if isinstance(used, str) and used.partition(".")[0] == _PACKAGE and used not in found:
                waiting.add(used)
    found -= _NO_POLICY
    return [Path(inspect.getfile(sys.modules[module])) for module in sorted(found)]


def _import_class(name: str) -> Any:
    try:
        return pkgutil.resolve_name(name)
    except (ImportError, AttributeError, ValueError) as error:
        raise BaselineError(f"policy = {name!r}: cannot be imported ({error})") from error
