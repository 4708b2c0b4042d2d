"""Philox4x32-10, a counter-based generator: a draw is a function of a robot's key and of what the draw is for.

References
----------
Salmon et al. 2011, Parallel random numbers: as easy as 1, 2, 3, doi:10.1145/2063384.2063405
"""

import warp as wp

# What a draw is for: the last word of the counter.
START, SPEED, BEAM = 0, 1, 2

_M0, _M1 = wp.constant(wp.uint32(0xD2511F53)), wp.constant(wp.uint32(0xCD9E8D57))
_W0, _W1 = wp.constant(wp.uint32(0x9E3779B9)), wp.constant(wp.uint32(0xBB67AE85))
_STEP = wp.constant(wp.float64(1.0 / 4294967296.0))
_TURN = wp.constant(wp.float64(6.283185307179586))


@wp.func
def high_word(a: wp.uint32, b: wp.uint32) -> wp.uint32:
    """Return the upper 32 bits of a product."""
    return wp.uint32((wp.uint64(a) * wp.uint64(b)) >> wp.uint64(32))


@wp.func
def philox(c0: wp.uint32, c1: wp.uint32, c2: wp.uint32, c3: wp.uint32, key0: wp.uint32, key1: wp.uint32) -> wp.vec4ui:
    """Return four random words of a counter and a key."""
    for _ in range(10):
        h0 = high_word(_M0, c0)
        h1 = high_word(_M1, c2)
        l0 = _M0 * c0
        l1 = _M1 * c2
        c0 = h1 ^ c1 ^ key0
        c1 = l1
        c2 = h0 ^ c3 ^ key1
        c3 = l0
        key0 = key0 + _W0
        key1 = key1 + _W1
    return wp.vec4ui(c0, c1, c2, c3)


@wp.func
def uniform(word: wp.uint32) -> wp.float64:
    """Return a number in [0, 1) from a random word."""
    return wp.float64(word) * _STEP


@wp.func
def normal(words: wp.vec4ui) -> wp.float64:
    """Return a standard normal number from the first two of four random words (Box and Muller)."""
    radius = wp.sqrt(wp.float64(-2.0) * wp.log(uniform(words[0]) + _STEP))
    return radius * wp.cos(_TURN * uniform(words[1]))


@wp.func
def draw(keys: wp.array2d[wp.uint32], draws: wp.array[wp.uint32], robot: int, item: int, use: int) -> wp.vec4ui:
    """Return the random words of one robot's present draw: of an item (a beam), for one use."""
    return philox(wp.uint32(item), draws[robot], wp.uint32(0), wp.uint32(use), keys[robot, 0], keys[robot, 1])
