"""Beams against the visible rock, whose meshes all robots share, and against the level floor and roof."""

import numpy as np
import warp as wp

from minexplore.bundle import has_visible_rock
from minexplore.extra.warp.kernels.frames import MineFrame, body_place, body_rotation
from minexplore.sensing.lidar import collision_meshes, surface_meshes
from minexplore.tiles import tiles_at
from minexplore.world import World

SCENE_M = 40.0  # side of a scene's tile: as on the CPU, so that both round vertices and origins to 32 bits alike


class RockScenes:
    """The rock that beams hit: a mesh for each tile of the plan that robots can be on, of the rock within range of it.

    A mesh lies about its tile's middle: the nearer to zero, the finer are 32 bits.
    """

    def __init__(self, world: World, range_m: float) -> None:
        """Make the meshes on Warp's current device: of the visible rock, or of the collision walls and a level roof."""
        visible = has_visible_rock(world.record)
        meshes = list((surface_meshes if visible else collision_meshes)(world).values())
        self.roof_m = np.inf if visible else float(world.record["height_m"])
        low = np.array([vertices[:, :2].min(axis=0) for vertices, _ in meshes])
        high = np.array([vertices[:, :2].max(axis=0) for vertices, _ in meshes])
        tiles = np.unique(tiles_at(world.places_m(np.nextafter(0, 1)), SCENE_M), axis=0)
        first = tiles.min(axis=0)
        number = np.full(np.ptp(tiles, axis=0)[::-1] + 1, -1, dtype=np.int32)
        number[tuple((tiles - first).T[::-1])] = np.arange(len(tiles))
        middles = np.column_stack([(tiles + 0.5) * SCENE_M, np.zeros(len(tiles))])
        reach = SCENE_M / 2 + range_m
        near = [((low <= m[:2] + reach) & (high >= m[:2] - reach)).all(axis=1) for m in middles]
        self._kept = [
            _mesh([meshes[k] for k in np.flatnonzero(one)], middle) for one, middle in zip(near, middles, strict=True)
        ]
        self.first, self.number = wp.vec2i(*first.tolist()), wp.array(number, dtype=int)
        self.ids = wp.array([mesh.id for mesh in self._kept], dtype=wp.uint64)
        self.middles = wp.array(middles, dtype=wp.vec3d)


def _mesh(parts: list[tuple[np.ndarray, np.ndarray]], middle: np.ndarray) -> wp.Mesh:
    """Return one mesh of some, about a place; where there is no rock, one triangle out of reach."""
    parts = parts or [(np.full((3, 3), 1e6), np.array([[0, 1, 2]]))]
    first = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    vertices = np.concatenate([vertices for vertices, _ in parts]) - middle
    faces = np.concatenate([faces + start for (_, faces), start in zip(parts, first, strict=False)])
    points = wp.array(vertices.astype(np.float32), dtype=wp.vec3)
    indices = wp.array(faces.astype(np.int32).ravel(), dtype=int)
    return wp.Mesh(points, indices, bvh_constructor="sah", bvh_leaf_size=1)  # slow to build, fastest to cast in


@wp.kernel(enable_backward=False)
def cast_beams(
    first: wp.vec2i,
    number: wp.array2d[int],
    rock: wp.array[wp.uint64],
    middles: wp.array[wp.vec3d],
    roof_m: wp.float64,
    frame: MineFrame,
    lift_m: wp.float64,
    longest_m: wp.float64,
    beams: wp.array[wp.vec2d],
    asked: wp.array[bool],
    qpos: wp.array2d[float],
    origins: wp.array[wp.vec2d],
    ends: wp.array2d[wp.vec2d],
    ranges: wp.array2d[float],
):
    """Cast the beams of robots, a thread a beam: `origins` and `ends` (m, mine frame, plan), and `ranges` (m).

    `beams` holds each beam's direction ahead and to the left, `lift_m` the sensor's height above the body. Of robots
    that are not `asked` nothing changes.
    """
    robot, beam = wp.tid()
    if not asked[robot]:
        return
    axes = wp.transpose(frame.rotation) * body_rotation(qpos, robot)
    origin = body_place(frame, qpos, robot) + axes * wp.vec3d(wp.float64(0.0), wp.float64(0.0), lift_m)
    across = wp.vec3d(beams[beam][0], beams[beam][1], wp.float64(0.0))
    direction = axes * across
    far = longest_m
    if direction[2] < wp.float64(0.0):
        far = wp.min(far, -origin[2] / direction[2])
    if direction[2] > wp.float64(0.0):
        far = wp.min(far, (roof_m - origin[2]) / direction[2])
    i = int(wp.floor(origin[1] / wp.float64(SCENE_M))) - first[1]
    j = int(wp.floor(origin[0] / wp.float64(SCENE_M))) - first[0]
    if i >= 0 and i < number.shape[0] and j >= 0 and j < number.shape[1]:
        scene = number[i, j]
        if scene >= 0:
            start = wp.vec3(origin - middles[scene])
            hit = wp.mesh_query_ray(rock[scene], start, wp.vec3(direction), wp.float32(longest_m))
            if hit.result:
                far = wp.min(far, wp.float64(hit.t))
    ranges[robot, beam] = wp.float32(far)
    ends[robot, beam] = wp.vec2d(origin[0] + far * direction[0], origin[1] + far * direction[1])
    if beam == 0:
        origins[robot] = wp.vec2d(origin[0], origin[1])
