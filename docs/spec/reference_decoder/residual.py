"""Section 7.8: residual."""

from functools import cache

import numpy as np

from conventions import clamp, clamp16, round_shift
from scan import scan_order

M = {edge: np.array(table.split(), np.int64).reshape(edge, edge) for edge, table in {
    4: """
 4096  4096  4096  4096
 5352  2217 -2217 -5352
 4096 -4096 -4096  4096
 2217 -5352  5352 -2217""",
    8: """
 2896  2896  2896  2896  2896  2896  2896  2896
 4017  3406  2276   799  -799 -2276 -3406 -4017
 3784  1567 -1567 -3784 -3784 -1567  1567  3784
 3406  -799 -4017 -2276  2276  4017   799 -3406
 2896 -2896 -2896  2896  2896 -2896 -2896  2896
 2276 -4017   799  3406 -3406  -799  4017 -2276
 1567 -3784  3784 -1567 -1567  3784 -3784  1567
  799 -2276  3406 -4017  4017 -3406  2276  -799""",
    16: """
 2048  2048  2048  2048  2048  2048  2048  2048  2048  2048  2048  2048  2048  2048  2048  2048
 2882  2772  2554  2239  1837  1365   841   284  -284  -841 -1365 -1837 -2239 -2554 -2772 -2882
 2841  2408  1609   565  -565 -1609 -2408 -2841 -2841 -2408 -1609  -565   565  1609  2408  2841
 2772  1837   284 -1365 -2554 -2882 -2239  -841   841  2239  2882  2554  1365  -284 -1837 -2772
 2676  1108 -1108 -2676 -2676 -1108  1108  2676  2676  1108 -1108 -2676 -2676 -1108  1108  2676
 2554   284 -2239 -2772  -841  1837  2882  1365 -1365 -2882 -1837   841  2772  2239  -284 -2554
 2408  -565 -2841 -1609  1609  2841   565 -2408 -2408   565  2841  1609 -1609 -2841  -565  2408
 2239 -1365 -2772   284  2882   841 -2554 -1837  1837  2554  -841 -2882  -284  2772  1365 -2239
 2048 -2048 -2048  2048  2048 -2048 -2048  2048  2048 -2048 -2048  2048  2048 -2048 -2048  2048
 1837 -2554  -841  2882  -284 -2772  1365  2239 -2239 -1365  2772   284 -2882   841  2554 -1837
 1609 -2841   565  2408 -2408  -565  2841 -1609 -1609  2841  -565 -2408  2408   565 -2841  1609
 1365 -2882  1837   841 -2772  2239   284 -2554  2554  -284 -2239  2772  -841 -1837  2882 -1365
 1108 -2676  2676 -1108 -1108  2676 -2676  1108  1108 -2676  2676 -1108 -1108  2676 -2676  1108
  841 -2239  2882 -2554  1365   284 -1837  2772 -2772  1837  -284 -1365  2554 -2882  2239  -841
  565 -1609  2408 -2841  2841 -2408  1609  -565  -565  1609 -2408  2841 -2841  2408 -1609   565
  284  -841  1365 -1837  2239 -2554  2772 -2882  2882 -2772  2554 -2239  1837 -1365   841  -284""",
}.items()}


@cache
def shifts(edge, mu_codes):
    """Scales and shifts: (Sz, Sy, Sx, D)."""
    e = [0]
    for p in (1, 2, 3):
        # 4^E is a fraction for negative E: both sides are multiplied by 4^6.
        e.append(max(c for c in range(-6, 7) if 4 ** (c + 6) * (2 * mu_codes) ** 2 * edge**p <= 4**6 * 32767**2))
    return 13 - e[2] + e[3], 13 - e[1] + e[2], 13 - e[0] + e[1], 4 - e[3]


def dequantize(level, step, d):
    limit = (2**30 - 1) // step
    product = clamp(level, -limit, limit) * step
    return clamp(round_shift(product, d), -32768, 32767)


def inverse_pass(a, matrix, s, axis):
    """All lines along an axis of the array [z][y][x]."""
    lines = np.moveaxis(a, axis, -1)
    return np.moveaxis(clamp16(round_shift(lines @ matrix, s)), -1, axis)


def reconstruct(prediction, levels, steps, edge, mu_codes):
    """Samples of a block. `levels`: those of the first coefficients in scan order; `steps`: of each of them."""
    sz, sy, sx, d = shifts(edge, mu_codes)
    residual = np.zeros((edge, edge, edge), np.int64)
    if any(levels):                                   # of levels that are all 0 the residual is 0
        for k, level in enumerate(levels):
            if level != 0:
                residual.flat[scan_order(edge)[k]] = dequantize(level, steps[k], d)
        for axis, s in (0, sz), (1, sy), (2, sx):
            residual = inverse_pass(residual, M[edge], s, axis)
    return np.clip(prediction + residual, -mu_codes, mu_codes).astype(np.int16)
