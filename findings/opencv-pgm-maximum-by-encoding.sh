#!/bin/sh
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check opencv-python-headless==4.14.0.94 numpy==2.4.6
printf 'P2\n3 1\n100\n0 50 100\n' > text.pgm
printf 'P5\n3 1\n100\n\000\062\144' > binary.pgm
venv/bin/python - <<'PY'
import sys

import cv2

text, binary = (cv2.imread(name, cv2.IMREAD_UNCHANGED).tolist() for name in ("text.pgm", "binary.pgm"))
print(f"version: OpenCV {cv2.__version__}")
print(
    "behaviour: the maximum value in the header of a PGM map is applied to a text file (P2) and not to a binary one "
    "(P5), so the same map has two brightnesses; a good guess says that both are read alike"
)
print(f"seen: cells 0, 50 and 100 of a maximum of 100 are {text} from text and {binary} from binary")
sys.exit(not (text == [[0, 127, 255]] and binary == [[0, 50, 100]]))
PY
