"""Section 7.10.1: expected activity."""

from dataclasses import dataclass

import numpy as np

from conventions import NEIGHBOURS, add


@dataclass
class Activity:
    crossings: int
    nearest: int

    @property
    def activity_class(self):
        if self.crossings == 0:
            return sum(self.nearest <= most for most in (512, 256, 128))
        return 4 + sum(self.crossings >= least for least in (5, 12, 30, 70))

    @property
    def fine_class(self):
        if self.crossings == 0:
            return min(self.nearest // 64, 15)
        return 16 + min(self.crossings // 4, 20)


def drift(reference, b):
    if b in reference.vectors:
        vectors = [reference.vectors[b]]
    else:
        vectors = [reference.vectors[add(b, d)] for d in NEIGHBOURS if add(b, d) in reference.vectors]
    n = len(vectors)
    if n == 0:
        return (0, 0, 0)
    return tuple((2 * sum(v[a] for v in vectors) + 4 * n) // (8 * n) for a in range(3))


def window(reference, b, d):
    """w and which of it is known: arrays [k][j][i] of 9 a side."""
    start = tuple(8 * b[a] + d[a] for a in range(3))
    first = tuple(c >> 3 for c in start)
    samples, known = np.zeros((16, 16, 16), np.int64), np.zeros((16, 16, 16), bool)
    for dz in (0, 1):
        for dy in (0, 1):
            for dx in (0, 1):
                block = reference.samples.get(add(first, (dx, dy, dz)))
                if block is not None:
                    part = np.s_[8 * dz : 8 * dz + 8, 8 * dy : 8 * dy + 8, 8 * dx : 8 * dx + 8]
                    samples[part] = block
                    known[part] = True
    x, y, z = (c & 7 for c in start)
    part = np.s_[z : z + 9, y : y + 9, x : x + 9]
    return samples[part], known[part]


def activity(reference, b):
    w, known = window(reference, b, drift(reference, b))
    inner = np.s_[:8, :8, :8]
    if not known[inner].any():
        return Activity(0, 65535)
    nearest = int(np.abs(w[inner])[known[inner]].min())
    negative = w < 0
    crossings = 0
    for ahead in np.s_[:8, :8, 1:], np.s_[:8, 1:, :8], np.s_[1:, :8, :8]:
        crossings += np.count_nonzero(known[inner] & known[ahead] & (negative[inner] != negative[ahead]))
    return Activity(int(crossings), nearest)


