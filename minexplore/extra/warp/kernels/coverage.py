"""Which reachable cells a robot's beams have seen: a bit a cell, marked by many beams at once."""

import warp as wp


@wp.func
def line_behind(start: wp.float64, step: wp.float64) -> wp.float64:
    """Return the grid line behind a start, in cells."""
    if step > wp.float64(0.0):
        return wp.floor(start)
    return wp.ceil(start)


@wp.func
def share_at(start: wp.float64, step: wp.float64, behind: wp.float64, line: int) -> wp.float64:
    """Return at which share of a step a segment crosses the `line`th grid line ahead; 1 if it ends before."""
    if step == wp.float64(0.0):
        return wp.float64(1.0)
    share = (behind + wp.sign(step) * wp.float64(line) - start) / step
    if share > wp.float64(0.0) and share < wp.float64(1.0):
        return share
    return wp.float64(1.0)


@wp.kernel(enable_backward=False)
def mark_cells(
    origin_m: wp.vec2d,
    cell_m: wp.float64,
    lines: int,
    number: wp.array2d[int],
    asked: wp.array[bool],
    origins: wp.array[wp.vec2d],
    ends: wp.array2d[wp.vec2d],
    seen: wp.array2d[wp.uint32],
    gained: wp.array[int],
):
    """Mark the cells that beams pass through, a thread a beam, and count those that are `gained` by each robot.

    Exact, as `CoverageGrid.cells_crossed`: a beam is cut at every grid line that it crosses, at most `lines` on each
    axis, and each piece names the cell of its middle. `number` gives a reachable cell's bit, -1 elsewhere.
    """
    robot, beam = wp.tid()
    if not asked[robot]:
        return
    start = (origins[robot] - origin_m) / cell_m
    step = (ends[robot, beam] - origin_m) / cell_m - start
    behind_x = line_behind(start[0], step[0])
    behind_y = line_behind(start[1], step[1])
    column = int(1)
    row = int(1)
    at = wp.float64(0.0)
    one = wp.float64(1.0)
    for _ in range(2 * lines + 1):
        if at < one:
            to_x = share_at(start[0], step[0], behind_x, column)
            to_y = share_at(start[1], step[1], behind_y, row)
            to = wp.min(to_x, to_y)
            if to > at:
                middle = start + (at + to) / wp.float64(2.0) * step
                i = int(wp.floor(middle[1]))
                j = int(wp.floor(middle[0]))
                if i >= 0 and i < number.shape[0] and j >= 0 and j < number.shape[1]:
                    cell = number[i, j]
                    if cell >= 0:
                        bit = wp.uint32(1) << wp.uint32(cell & 31)
                        before = wp.atomic_or(seen, robot, cell >> 5, bit)
                        if (before & bit) == wp.uint32(0):
                            wp.atomic_add(gained, robot, 1)
            if to_x <= to:
                column += 1
            if to_y <= to:
                row += 1
            at = to
