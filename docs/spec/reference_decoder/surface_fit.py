"""Section 7.10.5: spatial prediction.

Sums over voxels are int64 arrays; the equations are solved in Python's integers.
"""

from functools import cache

import numpy as np

from conventions import clamp, ilog2, round_shift

E = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (2, 0, 0), (0, 2, 0), (0, 0, 2), (1, 1, 0), (1, 0, 1), (0, 1, 1)]
R = [2097, 655, 655, 655, 15360, 15360, 15360, 15360, 15360, 15360]
POWERS = [(a, b, c) for a in range(5) for b in range(5) for c in range(5) if a + b + c <= 4]
NEAR = {-1: range(4, 8), 0: range(0, 8), 1: range(0, 4)}


def saturate(a):
    return clamp(a, -(2**31), 2**31 - 1)


def weight(distance):
    """Of an array of distances."""
    octaves = (distance * 369 + 128) >> 8
    f = octaves & 255
    mantissa = 4096 - 8 * f - ((f * (256 - f) * 11) >> 10)
    return np.where(distance > 1001, 0, ((mantissa >> (octaves >> 8)) + 1) >> 1)


def monomials(x, y, z, powers):
    """One row for each triple of powers."""
    return np.array([x**a * y**b * z**c for a, b, c in powers])


@cache
def near_voxels(d):
    """For the neighbour at d: which voxels are looked at, their monomials, and max(|x|, |y|, |z|)."""
    part = tuple(slice(NEAR[c].start, NEAR[c].stop) for c in reversed(d))
    z, y, x = (a.ravel() for a in np.meshgrid(*(2 * np.array(NEAR[c]) + 16 * c - 7 for c in reversed(d)), indexing="ij"))
    return part, monomials(x, y, z, POWERS), monomials(x, y, z, E), np.abs([x, y, z]).max(axis=0)


def moments(b, neighbours, samples):
    """`samples`: of the blocks decoded so far. Returns W, P and count."""
    w_moments, p_moments, count = 0, 0, 0
    for n in neighbours:
        d = tuple(n[a] - b[a] for a in range(3))
        part, of_w, of_p, largest = near_voxels(d)
        s = samples[n][part].ravel().astype(np.int64)
        w = weight(np.abs(s) + 64 * (largest - 7))
        count += np.count_nonzero(w)
        w_moments = w_moments + of_w @ w
        p_moments = p_moments + of_p @ (w * s)
    if count < 8:
        return None, None, count
    return dict(zip(POWERS, w_moments.tolist())), dict(zip(E, p_moments.tolist())), count


def scaled(m, bits, degree):
    if bits >= 4 * degree:
        return m << (bits - 4 * degree)
    return round_shift(m, 4 * degree - bits)


def equations(w_moments, p_moments):
    a = [[0] * 11 for _ in range(10)]
    for i in range(10):
        for j in range(10):
            powers = tuple(p + q for p, q in zip(E[i], E[j]))
            a[i][j] = scaled(w_moments[powers], 10, sum(powers))
        a[i][i] += R[i]
        a[i][10] = scaled(p_moments[E[i]], 3, sum(E[i]))
    return a


def solve(a):
    """K"""
    inverse, shift, u = [0] * 10, [0] * 10, [0] * 10
    f = [[0] * 10 for _ in range(10)]
    for k in range(10):
        pivot = max(a[k][k], R[k])
        n = 30 - ilog2(pivot)
        inverse[k] = 2**61 // (pivot << n)
        shift[k] = 61 - n
        for i in range(k + 1, 10):
            f[k][i] = saturate(round_shift(a[k][i] * inverse[k], shift[k] - 20))
            for j in range(k + 1, 11):
                a[i][j] = saturate(a[i][j] - round_shift(f[k][i] * a[k][j], 20))
    for k in range(9, -1, -1):
        total = round_shift(a[k][10] * inverse[k], shift[k] - 17)
        for i in range(k + 1, 10):
            total -= round_shift(f[k][i] * u[i], 20)
        u[k] = saturate(total)
    return [clamp(round_shift(c, 6), -(2**21 - 1), 2**21 - 1) for c in u]


@cache
def voxel_monomials():
    """Monomials of the voxels of the predicted block, with their factors."""
    along = 2 * np.arange(8) - 7
    z, y, x = (a.ravel() for a in np.meshgrid(along, along, along, indexing="ij"))
    return monomials(x, y, z, E) * np.array([256] + 3 * [16] + 6 * [1])[:, None]


def surface_fit(b, neighbours, samples, limit):
    """The prediction [z][y][x] of block b; 0 if there is none."""
    w_moments, p_moments, count = moments(b, neighbours, samples)
    if count < 8:
        return 0
    total = np.array(solve(equations(w_moments, p_moments))) @ voxel_monomials()
    return np.clip(round_shift(total, 12), -limit, limit).reshape(8, 8, 8)
