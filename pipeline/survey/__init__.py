"""Stage 1: readers of plans, drawings, station surveys, scale bars and poses; the download of the real data."""
