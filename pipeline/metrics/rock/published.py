"""Residuals of the published real scan over voxel sizes.

From the text files of the paper's repository (Badri1401/MineXplore, commit 3f7fe7c): scan 12M, first 2,000,000 returns.
"""

from __future__ import annotations

from pipeline.metrics.rock.planefit import Residuals

REAL_SWEEP = [
    Residuals(0.10, 0.00338, 0.00566, 0.0353, 0.0103, 0),
    Residuals(0.15, 0.00544, 0.00989, 0.0671, 0.0197, 0),
    Residuals(0.20, 0.00773, 0.01423, 0.0971, 0.0303, 0),
    Residuals(0.30, 0.01382, 0.02504, 0.1710, 0.0569, 0),
    Residuals(0.50, 0.03007, 0.05149, 0.3356, 0.1202, 0),
    Residuals(1.00, 0.08363, 0.12825, 0.7286, 0.2949, 0),
    Residuals(2.00, 0.17567, 0.25373, 1.4727, 0.5523, 0),
]
