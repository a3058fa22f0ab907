"""Section 7.7: warp."""

import numpy as np

from conventions import CUBE, add, round_shift

SIN = [0, 512, 1023, 1534, 2043, 2550, 3054, 3555, 4053, 4547, 5037, 5522, 6001, 6474, 6942, 7402, 7855, 8300, 8738, 9166,
       9586, 9997, 10397, 10788, 11168, 11537, 11895, 12241, 12575, 12897, 13207, 13503, 13787]
COS = [16384, 16376, 16352, 16312, 16256, 16184, 16097, 15994, 15875, 15740, 15590, 15425, 15245, 15050, 14841, 14617,
       14378, 14126, 13860, 13580, 13287, 12981, 12662, 12331, 11988, 11633, 11267, 10890, 10502, 10104, 9696, 9279, 8852]


def stitched_reference(samples, centre, edge, mu_codes):
    """`samples`: of the reference, by coordinate. Returns an int64 array [z][y][x] of 3 edge a side."""
    cube = np.empty((3 * edge,) * 3, np.int64)
    near = {-1: 0, 0: edge // 2, 1: edge - 1}
    for d in CUBE:
        x, y, z = (slice((c + 1) * edge, (c + 2) * edge) for c in d)
        block = samples.get(add(centre, d))
        if block is None:
            s = samples[centre][near[d[2]], near[d[1]], near[d[0]]] if centre in samples else 0
            block = -mu_codes if s < 0 else mu_codes
        cube[z, y, x] = block
    return cube


def rotation_matrix(r):
    def prod(a, b):
        return round_shift(a * b, 14)

    sx, sy, sz = (SIN[abs(c)] * (1 if c >= 0 else -1) for c in r)
    cx, cy, cz = (COS[abs(c)] for c in r)
    sysx, sycx = prod(sy, sx), prod(sy, cx)
    return [[prod(cz, cy), prod(cz, sysx) - prod(sz, cx), prod(cz, sycx) + prod(sz, sx)],
            [prod(sz, cy), prod(sz, sysx) + prod(cz, cx), prod(sz, sycx) - prod(cz, sx)],
            [-sy, prod(cy, sx), prod(cy, cx)]]


def warp(samples, centre, t, r, edge, mu_codes):
    """The prediction [z][y][x] of a block."""
    stitched = stitched_reference(samples, centre, edge, mu_codes)
    q = rotation_matrix(r)
    along = 2 * np.arange(edge) + 1 - edge
    o = along[None, None, :], along[None, :, None], along[:, None, None]
    cell, f = [], []
    for a in range(3):
        turned = round_shift((q[a][0] * o[0] + q[a][1] * o[1] + q[a][2] * o[2]) * 32, 14)
        p = np.clip(64 * edge + 32 * (edge - 1) + 16 * t[a] + turned, 0, 64 * (3 * edge - 1) - 1)
        cell.append(p >> 6)
        f.append(p & 63)
    total = 0
    for c in range(8):
        bit = c & 1, c >> 1 & 1, c >> 2 & 1
        weight = 1
        for a in range(3):
            weight = weight * (f[a] if bit[a] == 1 else 64 - f[a])
        total = total + weight * stitched[cell[2] + bit[2], cell[1] + bit[1], cell[0] + bit[0]]
    return round_shift(total, 18)
