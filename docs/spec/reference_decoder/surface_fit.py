"""Section 7.10.5: spatial prediction.

In arrays of int64, which are wide enough, as the section says.
"""

from functools import cache

import numpy as np

from conventions import ilog2, round_shift

E = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (2, 0, 0), (0, 2, 0), (0, 0, 2), (1, 1, 0), (1, 0, 1), (0, 1, 1)]
R = [2097, 655, 655, 655, 15360, 15360, 15360, 15360, 15360, 15360]
POWERS = [(a, b, c) for a in range(5) for b in range(5) for c in range(5) if a + b + c <= 4]
NEAR = {-1: range(4, 8), 0: range(0, 8), 1: range(0, 4)}


def saturate(a):
    return np.minimum(np.maximum(a, -(2**31)), 2**31 - 1)


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
    return w_moments, p_moments, count


def scaled(m, bits, degree):
    """Of arrays of moments and of their degrees."""
    left, right = np.maximum(bits - 4 * degree, 0), np.maximum(4 * degree - bits, 1)
    return np.where(bits >= 4 * degree, m << left, round_shift(m, right))


# Where the moment of E[i] + E[j] stands in POWERS, and the degrees of these and of E.
SUMS = np.array([[POWERS.index(tuple(np.add(E[i], E[j]))) for j in range(10)] for i in range(10)])
SUM_DEGREES = np.array([sum(powers) for powers in POWERS])[SUMS]
DEGREES = np.array([sum(powers) for powers in E])


def equations(w_moments, p_moments):
    a = np.empty((10, 11), np.int64)
    a[:, :10] = scaled(w_moments[SUMS], 10, SUM_DEGREES) + np.diag(R)
    a[:, 10] = scaled(p_moments, 3, DEGREES)
    return a


def solve(a):
    """K. Rows are arrays; what is worked out below the diagonal is never read."""
    inverse, shift = [0] * 10, [0] * 10
    f, u = np.zeros((10, 10), np.int64), np.zeros(10, np.int64)
    for k in range(10):
        pivot = max(int(a[k, k]), R[k])
        n = 30 - ilog2(pivot)
        inverse[k] = 2**61 // (pivot << n)
        shift[k] = 61 - n
        f[k, k + 1 :] = saturate(round_shift(a[k, k + 1 : 10] * inverse[k], shift[k] - 20))
        a[k + 1 :, k + 1 :] = saturate(a[k + 1 :, k + 1 :] - round_shift(f[k, k + 1 :, None] * a[k, k + 1 :], 20))
    for k in range(9, -1, -1):
        total = round_shift(a[k, 10] * inverse[k], shift[k] - 17) - round_shift(f[k, k + 1 :] * u[k + 1 :], 20).sum()
        u[k] = saturate(total)
    return np.clip(round_shift(u, 6), -(2**21 - 1), 2**21 - 1)


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
    total = solve(equations(w_moments, p_moments)) @ voxel_monomials()
    return np.clip(round_shift(total, 12), -limit, limit).reshape(8, 8, 8)
