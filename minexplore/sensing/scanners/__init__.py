"""LiDARs: scan patterns from data sheets, and the clouds they make of a world."""

from minexplore.sensing.mount import Mount, Pose3D
from minexplore.sensing.scanners.cloud import PointCloud
from minexplore.sensing.scanners.labels import LABELS
from minexplore.sensing.scanners.pattern import ScanPattern
from minexplore.sensing.scanners.pattern_files import load_pattern, pattern_names
from minexplore.sensing.scanners.scanner import Scanner, scanner_of

__all__ = [
    "LABELS",
    "Mount",
    "PointCloud",
    "Pose3D",
    "ScanPattern",
    "Scanner",
    "load_pattern",
    "pattern_names",
    "scanner_of",
]
