"""Put a robot of any MJCF file into a mine and step it; by default Gymnasium's Ant in the embedded mine.

It needs the wheel alone.
"""

import argparse
from pathlib import Path

import gymnasium
import mujoco
import numpy as np

import minexplore

ANT = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "ant.xml"
parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("robot", nargs="?", default=str(ANT), help="an MJCF file, or menagerie:NAME")
parser.add_argument("--world", default="chilean_mine", help="a bundle's folder, or the name of a world")
parser.add_argument("--seconds", type=float, default=5.0)
arguments = parser.parse_args()

# The robot stands on the floor at the start of the mine, and looks east. What differs from its own file is warned of.
world = minexplore.load(arguments.world)
x, y, *z = world.record["spawn"]["anchor_m"]  # z in a mine with heights
pose = minexplore.Pose(x, y, 0.0, z[0] + 0.5, stands=True) if z else (x, y, 0.0)
spec = minexplore.place(world, arguments.robot, pose, reach_m=20.0)

# The spec can still be changed, for example by a camera.
spec.worldbody.add_camera(name="above", pos=[0, 0, 3])

# The keyframe `spawn` is the robot at its pose.
model = spec.compile()
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, model.key("spawn").id)

# Move its joints at random, ten times a second.
rng = np.random.default_rng(0)
low, high = np.where(model.actuator_ctrllimited[:, None], model.actuator_ctrlrange, [[-1.0, 1.0]]).T
touches = 0
rock = model.body("rock").id
for _ in range(round(10 * arguments.seconds)):
    data.ctrl[:] = rng.uniform(low, high)
    mujoco.mj_step(model, data, nstep=round(0.1 / model.opt.timestep))
    touches += any(rock in model.geom_bodyid[pair] for pair in data.contact.geom)

# T_world_mine brings a place of MuJoCo's world frame into the mine frame.
root = next(b for b in range(model.nbody) if model.body_jntnum[b])
T_world_mine = world.T_world_mine
place = (data.xpos[root] - T_world_mine[:3, 3]) @ T_world_mine[:3, :3]
print(f"{model.body(root).name} after {data.time:.1f} s: ({place[0]:.2f}, {place[1]:.2f}, {place[2]:.2f}) m")
print(f"{model.ngeom} geoms; it touched rock in {touches} of {round(10 * arguments.seconds)} looks")
