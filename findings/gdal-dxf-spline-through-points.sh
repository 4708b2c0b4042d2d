#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check pyogrio==0.13.0 numpy==2.4.6 ezdxf==1.4.5
venv/bin/python - <<'PY'
import sys

import ezdxf
import pyogrio
from ezdxf import path

drawing = ezdxf.new("R2010")
drawing.modelspace().add_line((0, 0), (50, 0))
drawing.modelspace().add_spline(fit_points=[(0, 0, 0), (10, 5, 0), (20, 0, 0), (30, 8, 0)])
drawing.saveas("a.dxf")
corners = [len(list(path.make_path(item).flattening(0.1))) for item in drawing.modelspace().query("SPLINE")]
try:
    error = f"{len(pyogrio.raw.read('a.dxf')[2])} shapes"
except pyogrio.errors.FeatureError as raised:
    error = f"FeatureError, {str(raised)[str(raised).find('error at'):]}"
print(f"version: pyogrio {pyogrio.__version__}, GDAL {'.'.join(map(str, pyogrio.__gdal_version__))}, ezdxf {ezdxf.__version__}")
print(
    "behaviour: a DXF drawing with one spline that states the points it goes through, and no control points, cannot be read, "
    "its other lines neither; a good guess says a curve through the points, as ezdxf draws"
)
print(f"seen: ezdxf draws {corners[0]} corners; GDAL: {error}")
sys.exit("FeatureError" not in error)
PY
