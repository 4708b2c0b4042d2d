"""What goes wrong on the device is kept there as bits, a word a robot: reading them waits for the device."""

import warp as wp

BAD_ACTION = wp.constant(1)
NOT_FINITE = wp.constant(2)
OUTSIDE = wp.constant(4)

MEANINGS = {
    int(BAD_ACTION): "an action was not two finite numbers",
    int(NOT_FINITE): "its physics gave a number that is not finite",
    int(OUTSIDE): "it stood where the mine has no free place",
}
