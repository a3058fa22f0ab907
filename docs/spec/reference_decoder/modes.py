"""Section 7.10.3: modes and vectors."""

from dataclasses import dataclass

from conventions import NEIGHBOURS, add
from range_decoder import RangeDecoder
from refusal import malformed_if

OFFSETS_BEFORE = [(-1, 0, 0), (0, -1, 0), (0, 0, -1), (-1, -1, 0), (-1, 0, -1), (0, -1, -1),
                  (1, -1, 0), (-1, 1, 0), (1, 0, -1), (-1, 0, 1), (0, 1, -1), (0, -1, 1)]


class Neighbours:
    """The blocks of a slice, in Morton order, and of each those neighbours that come before it in the slice: at the 12
    offsets of this section, and at all 26 for the surface fit (7.10.5)."""

    def __init__(self, blocks):
        self.blocks = blocks
        self.before, self.fitted = {}, {}
        for b in blocks:
            self.fitted[b] = [add(b, d) for d in NEIGHBOURS if add(b, d) in self.before]
            self.before[b] = [add(b, d) for d in OFFSETS_BEFORE if add(b, d) in self.before]


@dataclass
class Mode:
    vector: tuple = None                              # None in a spatial block
    new: bool = False


def reference_vector(before, b):
    return None if before is None else before.vectors.get(b)


def reference_levels(before, b):
    return 1 + min(before.levels_of[b], 7) if before is not None and b in before.coded else 0


def read_modes(frame, s, models, neighbours, before):
    if frame.prediction == 0:
        return {b: Mode() for b in neighbours.blocks}
    decoder = RangeDecoder(frame.motion[s])
    modes = {}
    for b in neighbours.blocks:
        modes[b] = read_mode(decoder, models, frame, b, neighbours, modes, before)
    return modes


def read_mode(decoder, models, frame, b, neighbours, modes, before):
    candidates, spatial, new, known = mode_context(b, neighbours, modes, before)
    n = len(candidates)
    p = reference_levels(before, b)
    bits = models.bits
    if decoder.decode(bits["spatial_by_neighbours", spatial, known], bits["spatial_by_before", spatial, p]) == 1:
        return Mode()
    if decoder.decode(bits["new_by_neighbours", new, known], bits["new_by_candidates", spatial, new, n]) == 1:
        unit = 2 if frame.half_voxel_vectors else 1
        v = tuple(
            candidates[0][c] + unit * decoder.decode_integer(models.integers["component", c, 1 if new > 0 else 0])
            for c in range(3)
        )
        malformed_if(any(abs(c) > 128 for c in v), "motion vector")
        return Mode(v, new=True)
    k = 0
    while k < n - 1 and decoder.decode(bits["merge", k], bits["merge_by_candidates", k, n, new]) == 0:
        k += 1
    return Mode(candidates[k])


def mode_context(b, neighbours, modes, before):
    candidates = []
    for neighbour in neighbours.before[b]:
        vector = modes[neighbour].vector
        if vector is not None and len(candidates) < 4 and vector not in candidates:
            candidates.append(vector)
    for vector in reference_vector(before, b), (0, 0, 0):
        if vector is not None and vector not in candidates:
            candidates.append(vector)
    first = [modes[neighbour] for neighbour in neighbours.before[b][:3]]
    spatial = sum(mode.vector is None for mode in first)
    new = sum(mode.new for mode in first)
    return candidates, spatial, new, len(first)
