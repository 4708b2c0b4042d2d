import json
import os
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import save_file

from baselines.base.errors import BaselineError
from baselines.policies.learned import LearnedPolicy
from minexplore.task import TaskParams

ENCODER = "encoder.actor_encoder."


def write_policy(path: Path, kind: str, inputs: int = 19, hidden: int = 8, cell: int = 6):
    """Write a policy of random weights as training exports it; return its arrays."""
    rng = np.random.default_rng(1)
    room = f"{ENCODER}net." if kind == "mlp" else f"{ENCODER}tokenizer.net."
    arrays = {f"{room}mlp.0.weight": (hidden, inputs), f"{room}mlp.0.bias": (hidden,)}
    if kind == "lstm":
        arrays |= {
            f"{ENCODER}lstm.weight_ih_l0": (4 * cell, hidden),
            f"{ENCODER}lstm.weight_hh_l0": (4 * cell, cell),
            f"{ENCODER}lstm.bias_ih_l0": (4 * cell,),
            f"{ENCODER}lstm.bias_hh_l0": (4 * cell,),
        }
    arrays |= {
        "pi.net.mlp.0.weight": (2, cell if kind == "lstm" else hidden),
        "pi.net.mlp.0.bias": (2,),
        "pi.log_std": (2,),
    }
    made = {name: rng.normal(0, 0.5, shape).astype(np.float32) for name, shape in arrays.items()}
    model = {"kind": kind, "hidden": [hidden], "cell": cell if kind == "lstm" else 0, "sequence": 0}
    about = {
        "format": "minexplore-policy/1",
        "env": "x",
        "observation": "beams",
        "model": json.dumps(model),
        "seed": "1",
        "reached": "{}",
    }
    save_file(made, str(path), metadata=about)
    return made


def test_a_network_gives_what_its_layers_say(tmp_path):
    arrays = write_policy(tmp_path / "p.safetensors", "mlp")
    policy = LearnedPolicy(tmp_path / "p.safetensors", 3, TaskParams(), sample=False)
    observation = np.random.default_rng(0).random((3, 19)).astype(np.float32)
    hidden = np.tanh(observation @ arrays[f"{ENCODER}net.mlp.0.weight"].T + arrays[f"{ENCODER}net.mlp.0.bias"])
    expected = np.clip(hidden @ arrays["pi.net.mlp.0.weight"].T + arrays["pi.net.mlp.0.bias"], -1, 1)
    np.testing.assert_allclose(policy.act(observation, {}), expected, rtol=1e-5)


def test_a_memory_gives_what_torch_gives_and_forgets_on_reset(tmp_path):
    torch = pytest.importorskip("torch", reason="torch comes with `make setup-baselines`")
    arrays = write_policy(tmp_path / "p.safetensors", "lstm")
    policy = LearnedPolicy(tmp_path / "p.safetensors", 2, TaskParams(), sample=False)
    lstm = torch.nn.LSTM(8, 6)
    lstm.load_state_dict({k: torch.tensor(arrays[f"{ENCODER}lstm.{k}"]) for k in lstm.state_dict()})
    observations = np.random.default_rng(0).random((5, 2, 19)).astype(np.float32)
    room = f"{ENCODER}tokenizer.net.mlp.0."
    tokens = np.tanh(observations @ arrays[f"{room}weight"].T + arrays[f"{room}bias"])
    with torch.no_grad():
        states = lstm(torch.tensor(tokens))[0].numpy()
    expected = np.clip(states @ arrays["pi.net.mlp.0.weight"].T + arrays["pi.net.mlp.0.bias"], -1, 1)
    found = np.stack([policy.act(observation, {}) for observation in observations])
    np.testing.assert_allclose(found, expected, atol=1e-5)
    policy.reset(np.array([0]), np.array([0]))
    again = policy.act(observations[0], {})
    np.testing.assert_allclose(again[0], expected[0, 0], atol=1e-5)
    assert not np.allclose(again[1], expected[0, 1])


def test_what_is_drawn_depends_on_the_seed_of_the_episode(tmp_path):
    write_policy(tmp_path / "p.safetensors", "mlp")
    policy = LearnedPolicy(tmp_path / "p.safetensors", 2, TaskParams(), sample=True)
    drawn = []
    for _ in range(2):
        policy.reset(np.arange(2), np.array([7, 8]))
        drawn.append(policy.act(np.zeros((2, 19), np.float32), {}))
    np.testing.assert_array_equal(*drawn)
    assert not np.allclose(drawn[0][0], drawn[0][1])


def test_files_that_are_no_policy_are_refused_by_name(tmp_path):
    write_policy(tmp_path / "wide.safetensors", "mlp", inputs=33)
    (tmp_path / "text.safetensors").write_text("not a policy")
    save_file({"a": np.zeros(2)}, str(tmp_path / "other.safetensors"))
    for name, message in (
        ("wide", "takes 33 numbers, an observation of this environment has 19"),
        ("text", "not a policy's file"),
        ("other", "format None"),
        ("none", "no such file"),
    ):
        with pytest.raises(BaselineError, match=message):
            LearnedPolicy(tmp_path / f"{name}.safetensors", 1, TaskParams())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda arrays, about: arrays.pop("pi.net.mlp.0.weight"), "pi.net.mlp.0.weight is absent"),
        (lambda arrays, about: arrays["pi.net.mlp.0.bias"].fill(np.nan), "pi.net.mlp.0.bias: want finite numbers"),
        (lambda arrays, about: arrays.update({"pi.log_std": np.zeros(2, int)}), "pi.log_std: want finite numbers"),
        (
            lambda arrays, about: arrays.update({"pi.net.mlp.0.weight": np.zeros((2, 9), np.float32)}),
            r"has shape \(2, 9\), its model wants \(2, 8\)",
        ),
        (lambda arrays, about: about.update(observation="all"), "observation 'all': want beams or map"),
        (lambda arrays, about: about.update(observation="x" * 10**5), "observation 'x{79}: want beams or map"),
        (lambda arrays, about: about.update(format="x" * 10**5), "format 'x{79}, this version reads"),
        (lambda arrays, about: about.pop("observation"), "not a policy's file"),
        (lambda arrays, about: about.update(reached="[" * 100_000), "not a policy's file"),
        (
            lambda arrays, about: about.update(model=about["model"].replace("[8]", "[1000000000]")),
            "not a policy's file",
        ),
        (lambda arrays, about: about.update(model=about["model"].replace("[8]", "[8, 8]")), "mlp.2.weight is absent"),
    ],
)
def test_a_checkpoint_whose_arrays_make_no_network_is_refused(tmp_path, change, message):
    arrays, path = write_policy(tmp_path / "p.safetensors", "mlp"), tmp_path / "p.safetensors"
    with safe_open(str(path), framework="numpy") as file:
        about = dict(file.metadata())
    change(arrays, about)
    save_file(arrays, str(path), metadata=about)
    with pytest.raises(BaselineError, match=message):
        LearnedPolicy(path, 1, TaskParams())


def test_a_checkpoint_that_is_no_plain_file_is_refused(tmp_path):
    os.mkfifo(tmp_path / "p.safetensors")
    with pytest.raises(BaselineError, match="not a plain file"):
        LearnedPolicy(tmp_path / "p.safetensors", 1, TaskParams())
