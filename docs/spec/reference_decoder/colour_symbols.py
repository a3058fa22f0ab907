"""Sections 7.14.4 and 7.14.5: modes, depths and coefficients."""

from types import SimpleNamespace

from colour_cells import interleaved, position
from colour_transform import STAGES, differences
from conventions import clamp
from modes import Mode, Neighbours, read_mode
from range_decoder import RangeDecoder


class SliceColour:
    """The blocks of a slice of colour, and what was read of them.

    levels[b]    layer -> (level of the octree, place) -> difference -> three levels; those of the mean are at (-1, 0) and 0
    """

    def __init__(self, part, s, frame_blocks, models, known, layers):
        order = list(frame_blocks)
        q, r = divmod(len(order), part.slices)
        own = order[s * q + min(s, r) : (s + 1) * q + min(s + 1, r)]
        self.part, self.s, self.models, self.known, self.layers = part, s, models, known, layers
        self.blocks = {b: frame_blocks[b] for b in own}
        self.neighbours = Neighbours(own)
        self.levels = {b: [{}, {}, {}] for b in own}
        self.energies = {b: {} for b in own}
        self.coded_now = [{}, {}, {}]

    def known_block(self, b):
        return None if self.known is None else self.known.get(b)

    def read_modes(self):
        decoder = RangeDecoder(self.part.modes[self.s])
        modes, before = {}, of_known(self.known)
        unit_1 = SimpleNamespace(half_voxel_vectors=False)
        for b, block in self.blocks.items():
            modes[b] = Mode()
            if self.part.kind != 0:
                modes[b] = read_mode(decoder, self.models, unit_1, b, self.neighbours, modes, before)
            block.vector = modes[b].vector
            block.depth = self.read_depth(decoder, b)

    def read_depth(self, decoder, b):
        first = self.neighbours.before[b][:3]
        n, total = len(first), sum(self.blocks[neighbour].depth for neighbour in first)
        around = 9 if n == 0 else (4 * total + n) // (2 * n)
        known = self.known_block(b)
        before = 3 if known is None else known.depth
        bits = self.models.bits
        depth = 0
        while depth < self.layers - 1 and decoder.decode(
            bits["depth_by_neighbours", depth, around], bits["depth_by_before", depth, before]
        ) == 1:
            depth += 1
        return depth

    def read_coefficients(self, layer):
        decoder = RangeDecoder(self.part.coefficients[layer][self.s])
        bits = self.models.bits
        for b, block in self.blocks.items():
            if block.depth < layer:
                continue
            t = 0 if block.vector is None else 1
            first = self.neighbours.before[b][:3]
            c = sum(self.coded_now[layer].get(neighbour, 0) for neighbour in first)
            known = self.known_block(b)
            before = 0 if known is None else 2 if known.coded[layer] else 1
            self.coded_now[layer][b] = decoder.decode(
                bits["coded", layer, t, len(first), c], bits["coded_by_before", layer, t, before]
            )
            if self.coded_now[layer][b] == 1:
                reader = BlockReader(decoder, bits, t, self.energies[b], self.levels[b][layer])
                reader.read_block(block, layer)
            block.coded[layer] = bool(self.levels[b][layer])


def of_known(known):
    """The reference as 7.10.3 sees it: which blocks it has, their vectors and how many of their levels are not 0."""
    if known is None:
        return None
    return SimpleNamespace(
        coded=known,
        vectors={b: block.vector for b, block in known.items() if block.vector is not None},
        levels_of={b: 2 * sum(block.coded) for b, block in known.items()},
    )


def energy_class(e):
    return (0, 1, 2, 3, 3, 4)[min(e, 5)]


def energy(levels):
    return min(2 * abs(levels[0]) + abs(levels[1]) + abs(levels[2]), 3)


class BlockReader:
    """read_block, read_levels and read_level. `energies`: (level of the octree, place) -> energy; the mean is at level -1."""

    def __init__(self, decoder, bits, t, energies, levels):
        self.decoder, self.bits, self.t, self.energies, self.levels = decoder, bits, t, energies, levels

    def read_block(self, block, layer):
        bits, t = self.bits, self.t
        if layer == 0 and self.decoder.decode(bits["node_by_parent", 5, t, 0, 0], bits["node_by_neighbours", 5, t, 0, 0]) == 1:
            self.context = 5, 0, 0
            levels = self.read_levels(0, 0, True)
            self.levels[-1, 0] = {0: levels}
            self.energies[-1, 0] = energy(levels)
        for level in ((0, 1, 2), (3,), (4,))[layer]:
            for place in block.there[level]:
                children = [c for c in range(8) if place << 3 | c in block.there[level + 1]]
                if len(children) > 1:
                    self.read_node(level, place, differences(children))

    def read_node(self, level, place, of_node):
        bits, t = self.bits, self.t
        p = energy_class(self.energies.get((level - 1, place >> 3), 0))
        x, y, z = position(place)
        beside = [at for at in ((x - 1, y, z), (x, y - 1, z), (x, y, z - 1)) if min(at) >= 0]
        q = energy_class(sum(self.energies.get((level, interleaved(*at)), 0) for at in beside))
        m = (len(of_node) + 1) // 2 - 1
        if self.decoder.decode(bits["node_by_parent", level, t, p, m], bits["node_by_neighbours", level, t, q, p]) == 0:
            return
        self.context = level, p, q
        so_far, found = 0, {}
        for d in of_node:
            levels = self.read_levels(d, so_far, d == of_node[-1] and so_far == 0)
            so_far += energy(levels)
            if any(levels):
                found[d] = levels
        self.levels[level, place] = found
        self.energies[level, place] = min(so_far, 6)

    def read_levels(self, d, so_far, some):
        bits, t, (level, p, q) = self.bits, self.t, self.context
        decode, by_energy = self.decoder.decode, energy_class(so_far)
        e = min(so_far, 3)
        y = cb = cr = 0
        if decode(bits["luma_by_stage", level, t, STAGES[d], e], bits["luma_by_parent", level, t, max(p, q), e]) == 1:
            y = self.read_level(0, so_far)
        luma = min(abs(y), 2)
        if decode(bits["chroma", 0, level, t, luma, 0], bits["chroma_by_energy", 0, level, t, by_energy, luma]) == 1:
            cb = self.read_level(1, so_far)
        there = some and y == 0 and cb == 0
        if not there:
            there = decode(
                bits["chroma", 1, level, t, luma, min(abs(cb), 2)], bits["chroma_by_energy", 1, level, t, by_energy, luma]
            )
        if there:
            cr = self.read_level(1, so_far)
        return y, cb, cr

    def read_level(self, h, so_far):
        bits, t, (level, p, _) = self.bits, self.t, self.context
        by_energy = energy_class(so_far + p)
        m = 1
        while m <= 14 and self.decoder.decode(
            bits["magnitude", h, level, t, m - 1], bits["magnitude_by_energy", h, t, by_energy, m - 1]
        ) == 1:
            m += 1
        if m == 15:
            e = 0
            while e < 16 and self.decoder.decode_raw(1) == 1:
                e += 1
            m = clamp(15 + 2**e - 1 + self.decoder.decode_raw(e), 0, 32767)
        return -m if self.decoder.decode_raw(1) == 1 else m
