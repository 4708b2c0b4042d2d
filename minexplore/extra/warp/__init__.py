"""The task on a GPU, by MuJoCo Warp: the extra `gpu`. The CPU's vector environment stays its reference."""

from importlib.util import find_spec
from typing import Any

_NEEDED = {"warp": "warp-lang", "mujoco_warp": "mujoco-warp", "torch": "torch"}
_INSTALL = 'make setup-gpu, or pip install "mujoco==3.17.*" "mujoco-warp==3.17.*" torch'


def require_packages() -> None:
    """Refuse to go on without Warp, MuJoCo Warp and torch.

    Raises
    ------
    ImportError
        Naming what is missing and what to install.
    """
    absent = [package for module, package in _NEEDED.items() if find_spec(module) is None]
    if absent:
        raise ImportError(f"backend = 'warp' needs {', '.join(absent)}: {_INSTALL}")


def require_device(device: Any) -> Any:
    """Return Warp's device of a name such as `cpu` or `cuda:0`.

    Raises
    ------
    ValueError
        If there is no such device; the message names those that there are.
    """
    import warp as wp

    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)

    wp.init()
    known = [str(found) for found in wp.get_devices()]
    name = str(device)
    name = "cuda:0" if name == "cuda" else name
    if name not in known:
        raise ValueError(
            f"device = {device!r}: there is {', '.join(known)}; CUDA needs NVIDIA's driver and a torch wheel for it"
        )
    if name.startswith("cuda"):
        import torch

        if not torch.cuda.is_available():
            raise ValueError(f"device = {device!r}: torch {torch.__version__} sees no CUDA; install a wheel for CUDA")
    return wp.get_device(name)
