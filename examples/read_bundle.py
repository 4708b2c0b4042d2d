"""Read a world bundle with json, numpy and mujoco only: `python examples/read_bundle.py FOLDER`.

It needs no package of this project. The wheel has the default world in `minexplore/worlds/chilean_mine`.
"""

import argparse
import json
from pathlib import Path

import mujoco
import numpy as np

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("bundle", type=Path, nargs="?", default=Path("artifacts/realism/world"))
bundle = parser.parse_args().bundle

# world.json has the frames, the areas, the floor zones, and the hash of every other file.
record = json.loads((bundle / "world.json").read_text())
print(f"{record['name']}: {record['areas']['tunnel_m2']:,.0f} m2, {record['drifts']} drifts, {record['loops']} loops")

# topology.json has the network of drifts, in the mine frame. occupancy.npz has the distance to rock on a grid, and of a
# mine that is one volume volume.npz has the mesh of the free space.
topology = json.loads((bundle / "topology.json").read_text())
print(f"topology: {', '.join(topology)}")
arrays = "occupancy.npz" if (bundle / "occupancy.npz").is_file() else "volume.npz"
with np.load(bundle / arrays, allow_pickle=False) as space:
    for name in space.files:
        print(f"{arrays}: {name} {space[name].dtype} {space[name].shape}")

# mine.xml is the model. T_world_mine places a point of the mine frame in MuJoCo's world frame.
model = mujoco.MjModel.from_xml_path(str(bundle / "mine.xml"))
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
T_world_mine = np.array(record["T_world_mine"])
x, y, *z = record["spawn"]["anchor_m"]  # z in a mine with heights
start = T_world_mine @ [x, y, sum(z) + 0.5, 1.0]

# Cast a ray level north from 0.5 m above the floor at the start; group 3 is the collision rock.
groups = np.zeros(6, dtype=np.uint8)
groups[record["geom_groups"]["collision"]] = 1
geom = np.zeros(1, dtype=np.int32)
distance_m = mujoco.mj_ray(model, data, start[:3], T_world_mine[:3, 1], groups, 1, -1, geom, None)
print(f"model: {model.ngeom} geoms; rock is {distance_m:.2f} m north of the start")
