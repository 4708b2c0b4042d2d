"""Build a mine from a small GeoJSON and drive in it, in a checkout: `python examples/own_mine.py`."""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--name", default="cross-cut")
parser.add_argument("--steps", type=int, default=100, help="control steps of 0.1 s")
arguments = parser.parse_args()
project = Path(__file__).resolve().parents[1]

# The outline of a drift of 60 m and a cross-cut of 30 m, both 5 m wide; metres of a projected system, x east, y north.
east, north = 350_000.0, 7_400_000.0
corners = [(0, 0), (60, 0), (60, 5), (35, 5), (35, 35), (30, 35), (30, 5), (0, 5), (0, 0)]
ring = [[east + x, north + y] for x, y in corners]
survey = {
    "type": "FeatureCollection",
    "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32719"}},
    "features": [{"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring]}}],
}
source = Path(tempfile.mkdtemp()) / f"{arguments.name}.geojson"
source.write_text(json.dumps(survey))

# The six stages build the world and register the environment MineXplore/NAME-v0.
command = [sys.executable, "-m", "pipeline", "new", arguments.name, "--from", str(source)]
if subprocess.run(command, cwd=project).returncode:
    sys.exit(2)

import gymnasium  # the import of minexplore registers the worlds that are built by then

env = gymnasium.make(f"minexplore:MineXplore/{arguments.name}-v0")
observation, info = env.reset(seed=0)
for _ in range(arguments.steps):
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
print(f"coverage {100 * info['coverage']:.2f} % after {arguments.steps} steps")
env.close()
