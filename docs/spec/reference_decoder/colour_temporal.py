"""Sections 7.14.8 and 7.14.9: reading, and temporal blocks; of 7.14.12 whether these are exact."""

from colour_cells import CORNERS, interleaved, position, trunc_div
from colour_transform import GREY, add_differences, limited, mean, mean_change, plus
from conventions import CUBE, add


class Reader:
    """The reference, read at positions that count from block `b`. `all_exact`: whether all samples that were taken are."""

    def __init__(self, reference, b):
        self.reference, self.b = reference or {}, b
        self.found = {}
        self.all_exact = True

    def block(self, voxel):
        return self.reference.get(add(self.b, tuple(c >> 3 for c in voxel)))

    def cell(self, voxel):
        """The crossed cell at a voxel and its block, or None."""
        if voxel not in self.found:
            block = self.block(voxel)
            place = interleaved(*(c & 7 for c in voxel))
            there = block is not None and place in block.cells
            self.found[voxel] = (block.cells[place], block, place) if there else None
        return self.found[voxel]

    def lesser_depth(self, at, depth):
        """`depth`, but that of the block at a position if it is less"""
        block = self.block(tuple(c >> 8 for c in at))
        return depth if block is None else min(depth, block.depth)

    def read_at(self, at, n, depth):
        size = 256 >> depth
        p = [c - size // 2 for c in at]
        first = [c >> 8 - depth for c in p]
        upper = [(c & size - 1) >> 3 - depth for c in p]
        colours, weights = [], []
        for corner in CORNERS:
            weight = corner_weight(corner, upper)
            part = add(first, corner)
            found = self.cell(tuple(c >> depth for c in part))
            if weight == 0 or found is None or not found[0].faces(n):
                continue
            cell, block, place = found
            m = min(depth, block.depth)
            number = interleaved(*(c >> depth - m & (1 << m) - 1 for c in part))
            if number in cell.part_sets[m]:
                colours.append(block.samples[m][place << 3 * m | number])
                weights.append(weight)
                self.all_exact = self.all_exact and block.exact
        return mean(colours, weights) if colours else None

    def read_part(self, at, n, m):
        colour = self.read_at(at, n, m)
        if colour is None and m > 0:
            colour = self.read_at(at, n, 0)
        return colour

    def onto_plane(self, n, at, voxel):
        found = self.cell(voxel)
        if found is None or not found[0].faces(n):
            return None
        cell = found[0]
        height = sum((at[a] - (256 * voxel[a] + 128 + cell.offset[a])) * cell.normal[a] for a in range(3))
        return tuple(trunc_div(-height * c, 127 * 127) for c in cell.normal)

    def onto_surface(self, n, at):
        to = self.onto_plane(n, at, tuple(c >> 8 for c in at))
        if to is not None:
            return to
        first = [c - 128 >> 8 for c in at]
        upper = [(c - 128 & 255) >> 3 for c in at]
        found, weights = [], []
        for corner in CORNERS:
            weight = corner_weight(corner, upper)
            to = self.onto_plane(n, at, add(first, corner)) if weight > 0 else None
            if to is not None:
                found.append(to)
                weights.append(weight)
        return mean(found, weights) if found else (0, 0, 0)


def corner_weight(corner, upper):
    x, y, z = (u if c else 32 - u for c, u in zip(corner, upper))
    return x * y * z


def motion(vectors, voxel):
    """`vectors`: of the temporal blocks around, by offset"""
    m = [2 * c - 7 for c in voxel]
    found, weights = [], []
    for corner in CORNERS:
        d = tuple((1 if c > 0 else -1) if k else 0 for k, c in zip(corner, m))
        if d in vectors:
            x, y, z = (abs(c) if k else 16 - abs(c) for k, c in zip(corner, m))
            found.append(tuple(32 * c for c in vectors[d]))
            weights.append(x * y * z)
    return mean(found, weights)


def displacement(reader, cell, by_motion):
    back = tuple(-c for c in by_motion)
    start = add(tuple(256 * c + 128 for c in cell.voxel), back)
    at = add(start, cell.offset)
    to = reader.onto_plane(cell.normal, at, tuple(c >> 8 for c in start))
    if to is None:
        to = reader.onto_surface(cell.normal, at)
    return add(to, back)


def predict(b, blocks, reference):
    """The predicted samples of the deepest layer of a block, and whether they are made of exact ones."""
    block, reader = blocks[b], Reader(reference, b)
    around = {d: blocks[add(b, d)].vector for d in CUBE if add(b, d) in blocks}
    vectors = {d: vector for d, vector in around.items() if vector is not None}
    d = block.depth
    predicted = {}
    for place, cell in block.cells.items():
        by = displacement(reader, cell, motion(vectors, cell.voxel))
        corner = add(tuple(256 * c for c in cell.voxel), by)
        m = reader.lesser_depth(add(corner, (128, 128, 128)), d)
        for part in cell.parts[d]:
            at = add(corner, tuple((2 * c + 1) << 7 - d for c in position(part)))
            predicted[place << 3 * d | part] = reader.read_part(at, cell.normal, m)
    there = [colour for colour in predicted.values() if colour is not None]
    fill = limited(mean(there, [1] * len(there))) if there else GREY
    return {place: fill if colour is None else colour for place, colour in predicted.items()}, reader.all_exact


def residual(block, levels, steps):
    """r of the parts of the deepest layer; `levels`: of the block's layers"""
    tree = block.tree()
    change = levels[0].get((-1, 0), {}).get(0, (0, 0, 0))
    r = {0: mean_change(change, steps, tree[0][0])}
    for level in range(3 + block.depth):
        below = {}
        of_level = levels[max(level - 2, 0)]
        for place in tree[level]:
            children = [c for c in range(8) if place << 3 | c in tree[level + 1]]
            values = {c: r[place] for c in children}
            weights = {c: tree[level + 1][place << 3 | c] for c in children}
            add_differences(values, weights, of_level.get((level, place), {}), steps)
            below |= {place << 3 | c: value for c, value in values.items()}
        r = below
    return r


def decode_temporal(b, blocks, reference, known, levels, steps):
    """Writes the samples of a temporal block, and whether it is exact. `known`: whether the reference is."""
    block = blocks[b]
    samples, made_of_exact = predict(b, blocks, reference)
    block.exact = known and made_of_exact
    if any(block.coded):
        r = residual(block, levels, steps)
        samples = {place: limited(plus(colour, r[place])) for place, colour in samples.items()}
    block.samples[block.depth] = samples
    put_layers_above(block)


def put_layers_above(block):
    for layer in range(block.depth - 1, -1, -1):
        below = {}
        for place, colour in block.samples[layer + 1].items():
            # What a sample counts for: a half cell for its crossed quarter cells, if the block has these.
            weight = sum(place << 3 | c in block.there[5] for c in range(8)) if layer == 0 and block.depth == 2 else 1
            below.setdefault(place >> 3, []).append((colour, weight))
        block.samples[layer] = {place: limited(mean(*zip(*of_place))) for place, of_place in below.items()}
