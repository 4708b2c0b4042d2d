"""The folder of a training run: its settings, the log of its iterations, its newest checkpoint, what it reached."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from baselines.base.errors import BaselineError
from baselines.base.run_folders import take_run_folder
from baselines.ppo.history import History
from baselines.ppo.settings import TrainSettings


class RunFolder:
    """`settings.json`, `progress.jsonl`, `checkpoint`, and at the end `policy.safetensors` and `reached.json`."""

    def __init__(self, folder: Path, settings: TrainSettings) -> None:
        """Make the folder, or take the one of a run of the same settings; it may have fewer steps.

        Raises
        ------
        BaselineError
            If the folder holds a run of other settings, or files of no run.
        """
        self.path, self._settings = folder, settings
        self.log, self.checkpoint, self.policy = (
            folder / "progress.jsonl",
            folder / "checkpoint",
            folder / "policy.safetensors",
        )
        self._reached, self._fresh = folder / "reached.json", folder / "checkpoint.new"
        file = take_run_folder(folder)
        if file.is_file():
            then = TrainSettings.model_validate_json(file.read_bytes())
            if then.model_copy(update={"steps": settings.steps}) != settings:
                changed = [k for k, v in then.model_dump().items() if v != settings.model_dump()[k] and k != "steps"]
                raise BaselineError(
                    f"{folder}: holds a run of other settings ({', '.join(changed)}); remove it or rename it"
                )
            if settings.steps > then.steps:
                self._reached.unlink(missing_ok=True)
        file.write_text(settings.model_dump_json(indent=2) + "\n")

    def reached(self) -> dict[str, Any] | None:
        """Return what the run reached, or None if it has not ended."""
        return json.loads(self._reached.read_text()) if self._reached.is_file() else None

    def write_reached(self, facts: dict[str, Any]) -> None:
        """Write what the run reached; this ends it."""
        self._reached.write_text(json.dumps(facts, indent=2) + "\n")

    def read_history(self) -> History:
        """Return what the run did up to its checkpoint; later lines of the log are dropped, as they are done again."""
        if (self._fresh / "iteration.txt").is_file() and not self.checkpoint.is_dir():
            self._fresh.rename(self.checkpoint)  # the run was killed while it replaced its checkpoint
        mark, history = self.checkpoint / "iteration.txt", History(self._settings.stop)
        last = int(mark.read_text()) if mark.is_file() else 0
        text = self.log.read_text() if self.log.is_file() else ""
        lines = [json.loads(line) for line in text.splitlines() if line.endswith("}")]
        kept = [line for line in lines if line["iteration"] <= last]
        self.log.write_text("".join(json.dumps(line) + "\n" for line in kept))
        for line in kept:
            history.take_line(line)
        return history

    def save(self, algorithm: Any) -> None:
        """Write a checkpoint beside the last one, then replace that."""
        shutil.rmtree(self._fresh, ignore_errors=True)
        algorithm.save_to_path(str(self._fresh.resolve()))
        (self._fresh / "iteration.txt").write_text(str(algorithm.training_iteration))
        shutil.rmtree(self.checkpoint, ignore_errors=True)
        self._fresh.rename(self.checkpoint)
