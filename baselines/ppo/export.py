"""Export of the policy network as plain arrays: the part of a run that is kept, and all that its use needs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from safetensors.numpy import save_file

from baselines.policies.learned import FORMAT
from baselines.ppo.settings import TrainSettings


def export_policy(module: Any, settings: TrainSettings, facts: dict[str, Any], path: Path) -> None:
    """Write the policy's weights as safetensors; the metadata hold its environment, observation and layers."""
    arrays = {
        name: value.detach().cpu().numpy().copy()
        for name, value in module.state_dict().items()
        if name.startswith(("encoder.actor_encoder.", "pi."))
    }
    about = {
        "format": FORMAT,
        "env": settings.env,
        "observation": settings.observation,
        "model": settings.model.model_dump_json(),
        "seed": str(settings.seed),
        "reached": json.dumps(facts),
    }
    save_file(arrays, str(path), metadata=about)
