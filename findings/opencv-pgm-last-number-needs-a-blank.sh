#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check opencv-python-headless==4.14.0.94 numpy==2.4.6
venv/bin/python - <<'PY'
import sys

import cv2
import numpy as np

TEXT = b"P2\n2 2\n255\n1 2\n3 250"


def read(data):
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    return None if picture is None else picture.tolist()


found = {"no blank": read(TEXT), "a line end": read(TEXT + b"\n"), "a space": read(TEXT + b" ")}
print(f"version: OpenCV {cv2.__version__}")
print(
    "behaviour: a PGM map as text that ends with its last digit is not read, only with a blank behind it; a good guess says "
    "that the end of the file ends the last number, as the format asks for blanks between numbers alone"
)
print(f"seen: pixels by what follows the last number: {found}")
sys.exit(found != {"no blank": None, "a line end": [[1, 2], [3, 250]], "a space": [[1, 2], [3, 250]]})
PY
