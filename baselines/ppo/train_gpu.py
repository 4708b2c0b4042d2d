"""Train PPO on a GPU: `python -m baselines.ppo.train_gpu device=cuda:0 seed=42 env=entrance`; run it again to go on."""

from __future__ import annotations

import json
import os
import sys
from functools import partial
from typing import Any

from baselines.base.environments import require_trainable
from baselines.base.errors import BaselineError, need, run_command
from baselines.policies.policy_lookup import TRAINED
from baselines.ppo.history import History
from baselines.ppo.run_folder import RunFolder
from baselines.ppo.settings import TrainSettings, compose_settings
from baselines.ppo.train import train
from minexplore.extra.warp import require_device, require_packages

# A control step launches about 2,300 kernels, whatever the number of robots: many robots are needed to fill a device.
# Fewer epochs, as each batch is as large. Any of them can be given again.
DEFAULTS = ["robots=16384", "ppo.fragment=16", "ppo.minibatch=32768", "ppo.epochs=4", "steps=200_000_000"]


def start_on_device(device: str, settings: TrainSettings, run: RunFolder, history: History) -> Any:
    """Return the algorithm on a device, restored from the run's checkpoint if there is one.

    Raises
    ------
    BaselineError
        If rsl-rl, Warp or torch is missing, or there is no such device; the message says what to install.
    """
    try:
        require_packages()
        require_device(device)
        from baselines.ppo.device_algorithm import DeviceAlgorithm
    except (ImportError, ValueError) as error:
        missing = getattr(error, "name", None)
        raise (need(missing, "gpu") if missing else BaselineError(str(error))) from error
    algorithm = DeviceAlgorithm(settings, history.steps, device)
    if run.checkpoint.is_dir():
        algorithm.restore_from_path(str(run.checkpoint.resolve()))
    return algorithm


def main() -> None:
    """Compose the settings from the command line and train."""
    os.environ.pop("OMP_NUM_THREADS", None)
    given = [text for text in sys.argv[1:] if not text.startswith("device=")]
    device = next((text.partition("=")[2] for text in sys.argv[1:] if text.startswith("device=")), "cuda:0")
    asked = {text.partition("=")[0] for text in given}
    settings = compose_settings([text for text in DEFAULTS if text.partition("=")[0] not in asked] + given)
    require_trainable(settings.env)
    kind, _, seed = settings.name.rpartition("-")
    facts = train(settings, TRAINED / f"{kind}-warp-{seed}", partial(start_on_device, device))
    print(json.dumps(facts))


if __name__ == "__main__":
    sys.exit(run_command("train-gpu", main))
