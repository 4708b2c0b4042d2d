"""The project's folder, and the names of files in it that one stage writes and another reads."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import ParamsError

CONF = Path("conf")
WRITTEN_BY_NEW = "Written by `python -m pipeline new"  # in the survey sections of your mines

COMPOSED = Path("artifacts/params.json")
CODE_HASHES = Path("artifacts/code.json")  # of each stage, as its manifest has it
ROOT_PARAMS = Path("params.yaml")  # one line of overrides, DVC's only parameter

COLLISION, EXTENT, SPAWN = "collision.npz", "extent.json", "spawn.json"  # of stage 3, beside what bundles copy
SMOOTH, TEXTURE = "smooth.npz", "texture.png"  # of stage 4, beside the chunks of the rough surface


def require_project(conf: Path = CONF) -> None:
    """Refuse a folder that is not the project's, by its configuration.

    Parameters
    ----------
    conf : Path
        The configuration's folder; by default that of the working directory.

    Raises
    ------
    ParamsError
        The message names the folder.
    """
    if not (conf / "config.yaml").is_file():
        raise ParamsError(
            f"{conf.resolve().parent}: not the project's folder, as it has no {conf.name}/config.yaml; "
            "run the command in the project's folder"
        )
