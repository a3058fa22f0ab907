"""Sections 7.14.1 to 7.14.3: the cells of a frame, their parts and surfels, and the octree of a block."""

from functools import cache
from math import isqrt

import numpy as np

from conventions import add, clamp

CORNERS = [(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1)]


def trunc_div(a, b):
    return a // b if a >= 0 else -(-a // b)


@cache
def interleaved(x, y, z):
    """A place or the number of a part from coordinates below 2^5."""
    return sum((x >> i & 1) << 3 * i | (y >> i & 1) << 3 * i + 1 | (z >> i & 1) << 3 * i + 2 for i in range(5))


@cache
def position(place):
    """The coordinates of a place or part."""
    return tuple(sum((place >> 3 * i + axis & 1) << i for i in range(5)) for axis in range(3))


@cache
def part_values(n):
    """The factors of the eight corners at each point of the grid of parts, n of them along an edge: value(n, x, y, z)."""
    f = [np.array([n - a, a]) for a in range(n + 1)]
    return np.array([[f[x][i] * f[y][j] * f[z][k] for i, j, k in CORNERS]
                     for z in range(n + 1) for y in range(n + 1) for x in range(n + 1)])


def crossed_parts(samples, n):
    """`samples`: of the corners of cells, [cell][corner]. Boolean array [cell][part]."""
    negative = (samples @ part_values(n).T < 0).reshape(-1, n + 1, n + 1, n + 1)
    corner = [negative[:, k : n + k, j : n + j, i : n + i] for i, j, k in CORNERS]
    some, every = np.logical_or.reduce(corner), np.logical_and.reduce(corner)
    crossed = np.zeros((len(samples), n**3), bool)
    for part in range(n**3):
        x, y, z = position(part)
        crossed[:, part] = (some & ~every)[:, z, y, x]
    return crossed


class Cell:
    """A crossed cell: its voxel in the block, its surfel, and the numbers of its crossed parts of each depth."""

    def __init__(self, voxel, samples, halves, quarters):
        self.voxel = voxel
        self.parts = (0,), tuple(np.flatnonzero(halves).tolist()), tuple(np.flatnonzero(quarters).tolist())
        self.part_sets = tuple(frozenset(parts) for parts in self.parts)
        self.offset, self.normal = surfel([int(s) for s in samples])

    def faces(self, n):
        return self.normal[0] * n[0] + self.normal[1] * n[1] + self.normal[2] * n[2] >= 0


def surfel(samples):
    """offset and normal; `samples`: of the corners, x fastest"""
    total = sum(samples)
    g = [sum(s if corner[axis] else -s for corner, s in zip(CORNERS, samples)) for axis in range(3)]
    square = sum(a * a for a in g)
    if square == 0:
        return (0, 0, 0), (0, 0, 0)
    offset = tuple(clamp(trunc_div(-128 * total * a, square), -256, 256) for a in g)
    normal = tuple(clamp(trunc_div(127 * a, isqrt(square)), -127, 127) for a in g)
    return offset, normal


class ColourBlock:
    """A colour block: its cells by place, how it is coded, and its samples.

    samples[l]   of layer l: place of a part on level 3 + l of the octree -> colour
    coded[l]     whether layer l has a level that is not 0
    exact        whether its samples are those of a decoder without loss (7.14.12), if the frame is known
    """

    def __init__(self, cells):
        self.cells = cells
        self.depth, self.vector, self.exact = 0, None, True
        self.coded = [False] * 3
        self.samples = [{}, {}, {}]
        self.there = nodes(cells)

    def tree(self):
        """The octree of 7.14.3: of each level the weights of its nodes by place, in order."""
        depth = self.depth
        levels = [dict.fromkeys(places, 1) for places in self.there[: 4 + depth]]
        if depth == 0:
            levels[3] = {place: 4 * len(cell.parts[1]) for place, cell in self.cells.items()}
        elif depth == 1:
            levels[4] = dict.fromkeys(levels[4], 4)
        for level in range(3 if depth > 0 else 2, -1, -1) if depth < 2 else range(4, -1, -1):
            sums = dict.fromkeys(levels[level], 0)
            for place, weight in levels[level + 1].items():
                sums[place >> 3] += weight
            levels[level] = sums
        return levels


def nodes(cells):
    """The places of the nodes of each level, in order, down to all crossed quarter cells; dictionaries without values."""
    levels = [{place >> 3 * (3 - level): None for place in cells} for level in range(3)]
    for depth in range(3):
        levels.append({place << 3 * depth | part: None for place, cell in cells.items() for part in cell.parts[depth]})
    return levels


def colour_blocks(volume):
    """7.14.1: the colour blocks of a volume by coordinate, in Morton order."""
    found = {}
    for b in volume.samples:
        cells = cells_of_block(volume, b)
        if cells:
            found[b] = ColourBlock(cells)
    return found


def cells_of_block(volume, b):
    # The voxels from 0 to 8 along each axis.
    samples, known = np.zeros((9, 9, 9), np.int64), np.zeros((9, 9, 9), bool)
    for d in CORNERS:
        n = add(b, d)
        if n in volume.samples:
            to = tuple(slice(8, 9) if c else slice(0, 8) for c in reversed(d))
            part = tuple(slice(0, 1) if c else slice(0, 8) for c in reversed(d))
            samples[to] = volume.samples[n][part]
            known[to] = ~np.array(volume.masks[n], bool).reshape(8, 8, 8)[part] if n in volume.masks else True
    corner = [np.s_[k : k + 8, j : j + 8, i : i + 8] for i, j, k in CORNERS]
    all_known = np.logical_and.reduce([known[c] for c in corner])
    some = np.logical_or.reduce([samples[c] < 0 for c in corner])
    every = np.logical_and.reduce([samples[c] < 0 for c in corner])
    voxels = sorted(((x, y, z) for z, y, x in np.argwhere(all_known & some & ~every).tolist()),
                    key=lambda voxel: interleaved(*voxel))
    if not voxels:
        return {}
    at_corners = np.array([[samples[z + k, y + j, x + i] for i, j, k in CORNERS] for x, y, z in voxels])
    halves, quarters = crossed_parts(at_corners, 2), crossed_parts(at_corners, 4)
    return {interleaved(*voxel): Cell(voxel, *rest) for voxel, *rest in zip(voxels, at_corners, halves, quarters)}
