"""Section 7.4: octree."""

from conventions import AHEAD, BEHIND, COORDINATE_BITS, add, cell_of_morton_code
from refusal import malformed_if


def cell_of(coordinate, level):
    return tuple((c + 2**COORDINATE_BITS) >> level for c in coordinate)


def read_octree(decoder, models, count, before):
    """`before`: coordinates of blocks, or None. Returns coordinates in Morton order."""
    depth = decoder.decode_raw(5)
    malformed_if(depth > 21, "depth of the octree")
    root = decoder.decode_raw(3 * (21 - depth))
    cells = {cell_of_morton_code(root): None}         # a dict for the order
    for level in range(depth - 1, -1, -1):
        inside = None if before is None else {cell_of(b, level) for b in before}
        found = {}
        for parent in cells:
            none = True
            for octant in range(8):
                cell = tuple(2 * parent[axis] + (octant >> axis & 1) for axis in range(3))
                if octant == 7 and none:
                    present = 1
                else:
                    present = decoder.decode(models["cell", context(cell, level, inside, found, cells)])
                if present == 1:
                    found[cell] = None
                    none = False
            malformed_if(len(found) > count, "more blocks than the frame header says")
        cells = found
    malformed_if(len(cells) != count, "fewer blocks than the frame header says")
    return [tuple(c - 2**COORDINATE_BITS for c in cell) for cell in cells]


def context(cell, level, inside, found, cells):
    """`inside`: the cells of this level with blocks of `before`, or None."""
    behind = sum(add(cell, d) in found for d in BEHIND)
    if inside is not None:
        was = cell in inside
        ahead = sum(add(cell, d) in inside for d in AHEAD)
    else:
        was = 0
        ahead = sum(tuple(c >> 1 for c in add(cell, d)) in cells for d in AHEAD)
    return ((min(level, 2) * 2 + was) * 4 + behind) * 4 + ahead
