"""Parts with corners that are one but for rounding: MuJoCo must touch them."""

import mujoco
import numpy as np
import pytest

from minexplore.floors.volume_arrays import FacetLabel
from pipeline.volume.world.parts import collect_labelled

# A part of Wheal Pell, m. Its fourth and fifth corners are one but for rounding, and so are three about the sixth.
TWINNED = np.array(
    [
        [-0.2586374752181655, -0.25120417409982565, 0.16094747791792763],
        [-0.11807017842652101, -0.28886906775733223, 0.16094747791797737],
        [-0.23227495041891189, 0.07559165181930894, -0.41905252207443233],
        [0.048859643132942665, 0.00026186448204157386, -0.4190525220819712],
        [0.04885964319636571, 0.00026186498439528805, -0.4190525219520129],
        [-0.026757131837925385, -0.130758038102897, 0.46098568728436895],
        [-0.026771188567153104, -0.13078237933311243, 0.460960422019026],
        [-0.026757023288354276, -0.1307578501096316, 0.46098556960548187],
        [-0.0267568225724375, -0.13075750247952556, 0.4609851316019],
        [-0.026624264136088982, -0.13052790453505736, 0.4605245442847854],
        [0.08677294895707632, 0.30057415514403374, -0.34128752459856493],
        [0.1487754707335256, 0.2839981323222105, -0.34127813111177296],
        [0.20358552704259125, 0.268207149471948, -0.3393333317131155],
        [0.2039330289383514, 0.26921975299498513, -0.34121361281060025],
    ]
)
REACHES_IN = np.array([-0.14283885, -0.26837086, 0.12485113])  # by 24 mm, a sphere with a radius of 30 mm


def test_mujoco_touches_a_part_whose_twin_corners_are_one():
    """A ball of 3 cm went through this part of Wheal Pell: it had no contact with it."""
    part = collect_labelled([TWINNED, TWINNED + 5.0], [FacetLabel.WALL] * 2)
    assert len(part[0]) == len(part[1]) == len(TWINNED) - 3
    spec = mujoco.MjSpec()
    mesh = spec.add_mesh(
        name="part", uservert=part[0].ravel().tolist(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    )
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name)
    ball = spec.worldbody.add_body(pos=REACHES_IN)
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.03, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 1
    assert data.contact.dist[0] == pytest.approx(-0.0242, abs=1e-3)
