"""Section 7.10.8: extension."""

from functools import cache

import numpy as np

from conventions import AHEAD, COORDINATE_BITS, NEIGHBOURS, add, in_range
from refusal import Refused


def check_limit(coded, limit):
    """Counts the blocks of the extended volume before any of them is made. `coded`: coordinates of the coded blocks."""
    # A coordinate in one number, 21 bits each for z, y and x; along one axis after the other blocks grow by their neighbours.
    numbers = np.array([c + 2**COORDINATE_BITS for b in coded for c in b], np.int64).reshape(-1, 3) @ [1, 2**21, 2**42]
    for axis in range(3):
        along = numbers >> 21 * axis & 2**21 - 1
        behind, ahead = numbers[along > 0] - 2 ** (21 * axis), numbers[along < 2**21 - 1] + 2 ** (21 * axis)
        numbers = np.unique(np.concatenate([behind, numbers, ahead]))
        if len(numbers) > limit:
            raise Refused("limit", "blocks of the extended volume")


def extrapolate(coded, mu_codes):
    """`coded`: samples of the coded blocks. Returns those of the extrapolated blocks."""
    around = {n for b in coded for d in NEIGHBOURS if (n := add(b, d)) not in coded and in_range(n)}
    return {u: extrapolate_block(neighbours_of(u, coded), mu_codes) for u in around}


def neighbours_of(u, coded):
    """N(d) by d, in int64."""
    return {d: coded[n].astype(np.int64) for d in NEIGHBOURS if (n := add(u, d)) in coded}


def is_inside(neighbours):
    nearest = {-1: slice(7, 8), 0: slice(0, 8), 1: slice(0, 1)}
    votes = {1: [], 2: [], 3: []}                     # of faces, edges, corners
    for d, s in neighbours.items():
        part = s[tuple(nearest[c] for c in reversed(d))]
        votes[sum(map(abs, d))].append(int(np.clip(part, -256, 256).sum()))
    if votes[1]:
        return sum(votes[1]) < 0
    return sum(votes[2]) + 8 * sum(votes[3]) < 0


@cache
def nearest_voxels(d):
    """For each voxel of U: indices of `near`, those of `h` and e for the axes with d[a] != 0, and the distance."""
    z, y, x = np.indices((8, 8, 8))
    near, behind, e = {}, {}, {}
    for a, c in enumerate((x, y, z)):
        near[a], behind[a], e[a] = {
            0: (c, c, 0 * c), 1: (0 * c, 0 * c + 1, 8 - c), -1: (0 * c + 7, 0 * c + 6, c + 1)
        }[d[a]]

    def index(axes):
        return axes[2], axes[1], axes[0]

    steps = [(index({**near, a: behind[a]}), e[a]) for a in range(3) if d[a] != 0]
    return index(near), steps, e[0] + e[1] + e[2]


def extrapolate_block(neighbours, mu_codes):
    sign = -1 if is_inside(neighbours) else 1
    best = None
    for d, s in neighbours.items():
        near, steps, distance = nearest_voxels(d)
        value = s[near]
        for h, e in steps:
            value = value + np.clip(s[near] - s[h], -256, 256) * e
        magnitude = np.clip(sign * value, 5, mu_codes)
        pair = distance * 2**16 + magnitude           # compared by distance, then by magnitude
        best = pair if best is None else np.minimum(best, pair)
    return (sign * (best % 2**16)).astype(np.int16)


def conflicts(volume, blocks):
    """The voxels of `blocks` that are unobserved by conflicts, as masks by coordinate."""
    unobserved = {}
    for u in blocks:
        if u in volume.coded:
            continue
        for axis, ahead in enumerate(AHEAD):
            for side in (-1, 1):
                n = add(u, tuple(side * c for c in ahead))
                if n in volume.samples and n not in volume.coded and is_negative(volume, n) != is_negative(volume, u):
                    mask = unobserved.setdefault(u, np.zeros((8, 8, 8), bool))
                    np.moveaxis(mask, 2 - axis, 0)[0 if side < 0 else 7] = True
    return {u: bytearray(mask.tobytes()) for u, mask in unobserved.items()}


def is_negative(volume, u):
    """The sign of an extrapolated block: all its samples have it."""
    return volume.samples[u][0, 0, 0] < 0
