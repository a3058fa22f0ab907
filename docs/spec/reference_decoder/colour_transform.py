"""Arithmetic on colours of 7.14, the differences of 7.14.3, and 7.14.6: dequantization."""

from math import isqrt

from conventions import clamp, round_shift

GREY = (8192, 0, 0)
# Children on the lower and on the upper side, by difference.
SIDES = [((0, 1, 2, 3), (4, 5, 6, 7)), ((0, 1), (2, 3)), ((4, 5), (6, 7)), ((0,), (1,)), ((2,), (3,)), ((4,), (5,)), ((6,), (7,))]
STAGES = [0, 1, 1, 2, 2, 2, 2]


def limited(colour):
    y, cb, cr = colour
    return clamp(y, 0, 16320), clamp(cb, -8192, 8192), clamp(cr, -8192, 8192)


def mean(colours, weights):
    total = sum(weights)
    return tuple((sum(c[channel] * w for c, w in zip(colours, weights)) + total // 2) // total for channel in range(3))


def plus(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def differences(children):
    """The differences that a node with these children has."""
    return [d for d, (lower, upper) in enumerate(SIDES) if any(c in children for c in lower) and any(c in children for c in upper)]


def dequantized(level, step, ratio):
    return clamp(round_shift(level * step * isqrt(ratio), 18), -32768, 32768)


def mean_change(levels, steps, weight):
    return tuple(dequantized(level, step, 2**42 // weight) for level, step in zip(levels, steps))


def difference(level, step, a, b):
    return dequantized(level, step, (a + b) * 2**42 // (a * b))


def add_differences(values, weights, levels, steps):
    """Adds the differences of a node to the values of its children; `levels`: of those that have a level that is not 0."""
    for d, own in levels.items():
        lower, upper = ([c for c in side if c in values] for side in SIDES[d])
        a, b = (sum(weights[c] for c in side) for side in (lower, upper))
        by = tuple(difference(level, step, a, b) for level, step in zip(own, steps))
        up = tuple((a * change + (a + b) // 2) // (a + b) for change in by)
        for c in lower:
            values[c] = minus(plus(values[c], up), by)
        for c in upper:
            values[c] = plus(values[c], up)
