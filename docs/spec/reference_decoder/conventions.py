"""Section 3: conventions, and the order and the neighbours of blocks of section 4.

The functions take Python's integers or arrays of int64.
"""

import numpy as np

COORDINATE_BITS = 20


def round_shift(a, n):
    return (a + (1 << (n - 1))) >> n


def clamp(a, lo, hi):
    return max(lo, min(a, hi))


def clamp16(a):
    return np.clip(a, -32768, 32767)


def ilog2(a):
    return a.bit_length() - 1


def morton_code(coordinate):
    """Binary digits that are read as octal ones are two places further apart."""
    x, y, z = (int(f"{c + 2**COORDINATE_BITS:b}", 8) for c in coordinate)
    return x | y << 1 | z << 2


def cell_of_morton_code(code):
    """The cell (cx, cy, cz) on the grid of its level that has this number (section 7.4)."""
    digits = [int(digit) for digit in f"{code:o}"]
    return tuple(int("".join(str(digit >> axis & 1) for digit in digits), 2) for axis in range(3))


def in_range(coordinate):
    return all(-(2**COORDINATE_BITS) <= c < 2**COORDINATE_BITS for c in coordinate)


def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


CUBE = [(dx, dy, dz) for dz in (-1, 0, 1) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
NEIGHBOURS = [d for d in CUBE if d != (0, 0, 0)]
CORNERS = [(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1)]
BEHIND = [(-1, 0, 0), (0, -1, 0), (0, 0, -1)]
AHEAD = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]


class Volume:
    """What a frame decodes to, in Morton order, and what it leaves for the next frame (section 7.10).

    samples      coordinate -> int16 array [z][y][x]
    masks        coordinate -> bytearray of edge^3, 1 for the voxels in the mask; blocks without a mask are not there
    The rest is of profile `main`: which blocks are coded, the vectors of those that are temporal, how many of their
    levels are not 0, and the cells that were still. After a loss (section 7.13) also which blocks are not exact.
    """

    def __init__(self):
        self.samples, self.masks = {}, {}
        self.coded, self.vectors, self.levels_of, self.still = set(), {}, {}, set()
        self.inexact, self.kept_over_loss = set(), False
