"""Point clouds of workings: points thinned to voxels, the free space that they enclose, and its closed surface."""
