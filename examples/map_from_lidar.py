"""Map a mine by a LiDAR on a robot, in dust: `python examples/map_from_lidar.py`.

It needs the wheel and its extra `examples`.
"""

import argparse

import gymnasium
import numpy as np
import open3d

# %% Make the environment. Sensors cost nothing until they are read.
parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--steps", type=int, default=100, help="control steps of 0.1 s")
parser.add_argument("--conditions", default="dusty", help="ideal, typical, dusty or wet")
parser.add_argument("--out", default="map.ply", help="the map")
arguments = parser.parse_args()
env = gymnasium.make("minexplore:MineXplore/ChileanMine-v0", conditions=arguments.conditions)
mine = env.unwrapped

# %% Drive ahead in a wide bend, and read the LiDAR once a second.
env.reset(seed=0)
points, dusty, rays = [], 0, 0
for step in range(arguments.steps):
    env.step(np.array([0.6, -0.1], dtype=np.float32))
    if step % 10:
        continue
    cloud = mine.capture("os1-64")
    rays += cloud.fired
    dusty += cloud.counts().get("dust", 0)
    # A filter of particles would have to find what the simulation knows by its label.
    scanner = mine.suite.mount("os1-64").on(mine.suite.pose())
    points.append(scanner.points(cloud.points_m)[cloud.without("dust")])
print(f"{len(points)} scans, {100 * dusty / rays:.1f} % of the rays returned from dust")

# %% Thin the points to a map and write it.
scans = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.concatenate(points).astype(float)))
thinned = scans.voxel_down_sample(0.1)
open3d.io.write_point_cloud(arguments.out, thinned)
print(f"{arguments.out}: {len(thinned.points):,} points of {len(scans.points):,}")
env.close()
