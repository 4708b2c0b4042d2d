"""What a robot senses has the same digits on every processor."""

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest

from minexplore.sensing.planes import face_planes, plane_distances

# What another processor would do: NumPy without its widest vectors, OpenBLAS with the kernels of an older one.
OTHER = {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL", "OPENBLAS_CORETYPE": "Haswell"}
DRIVE = """
import hashlib, sys
import numpy as np
from baselines.explorers import EXPLORERS
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from minexplore.envs.vector import MineVectorEnv
env = MineVectorEnv(4, world=sys.argv[1])
policy = EXPLORERS["nearest-frontier"](4, TaskParams(), RobotParams())
policy.reset(np.arange(4), np.arange(4))
observation, info = env.reset(seed=[0, 1, 2, 3])
digest = hashlib.sha256()
for _ in range(int(sys.argv[2])):
    observation, *_, info = env.step(policy.act(observation, info))
    digest.update(observation.tobytes() + info["pose_m_rad"].tobytes())
print(digest.hexdigest())
"""


def test_a_distance_has_the_same_digits_whatever_a_caster_of_32_bits_rounds():
    rng = np.random.default_rng(0)
    vertices, faces = rng.normal(0, 5, (300, 3)), np.arange(300).reshape(100, 3)
    weights = rng.dirichlet([1, 1, 1], 100)
    hits = (vertices[faces] * weights[:, :, None]).sum(axis=1)
    origins = rng.normal(0, 1, (100, 3))
    true = np.linalg.norm(hits - origins, axis=1)
    directions = (hits - origins) / true[:, None]
    planes = face_planes(vertices, faces)
    one, two = (
        plane_distances(planes, np.arange(100), origins, directions, true + rng.uniform(-1e-4, 1e-4, 100))
        for _ in range(2)
    )
    np.testing.assert_array_equal(one, two)
    np.testing.assert_allclose(one, true, atol=1e-10)


def test_a_ray_that_hits_nothing_or_grazes_a_face_keeps_what_was_found():
    planes = face_planes(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    origins = np.array([[0, 0, 1.0], [0.1, 0.1, 1e-6]])
    directions = np.array([[0, 0, 1.0], [1, 0, 0]])
    found = plane_distances(planes, np.array([-1, 0]), origins, directions, np.array([np.inf, 0.3]))
    np.testing.assert_array_equal(found, [np.inf, 0.3])


@pytest.mark.slow
def test_an_episode_has_the_same_digits_with_other_vector_instructions(tee):
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", DRIVE, str(tee.bundle), "600"]
    digests = [
        subprocess.run(command, env=environment | other, capture_output=True, text=True, check=True).stdout
        for other in ({}, OTHER)
    ]
    assert len(digests[0].strip()) == hashlib.sha256().digest_size * 2
    assert digests[0] == digests[1]
