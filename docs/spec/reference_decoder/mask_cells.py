"""Section 7.10.9, By cell: which crossed cells are drawn."""

from conventions import BEHIND, CORNERS, CUBE, NEIGHBOURS, add
from refusal import malformed_if

EDGE = 8


def read_cells(decoder, models, cells, known):
    """The undrawn cells, by the voxels of space where they begin. `cells`: by block, in Morton order, the voxels of the block.
    `known`: the reference, or None."""
    state = {}                                        # 1 drawn, 2 undrawn
    blocks = set()                                    # with an undrawn cell
    in_reference = None if known is None else masked_voxels(known.masks)
    for b, voxels in cells.items():
        masked = 2 if known is None else int(b in known.masks)
        behind = sum(add(b, d) in blocks for d in BEHIND)
        around = min(sum(add(b, d) in blocks for d in NEIGHBOURS), 5)
        has_undrawn = decoder.decode(models["block_by_cells", masked, behind, around])
        for p in (place(b, voxel) for voxel in voxels):
            undrawn = has_undrawn and decode_cell(decoder, models, p, state, in_reference)
            state[p] = 2 if undrawn else 1
            if undrawn:
                blocks.add(b)
        malformed_if(has_undrawn and b not in blocks, "a block without undrawn cells")
    return {p for p, s in state.items() if s == 2}


def decode_cell(decoder, models, p, state, in_reference):
    states = 0
    for d in BEHIND:
        states = 3 * states + state.get(add(p, d), 0)
    around = [state.get(add(p, d), 0) for d in NEIGHBOURS]
    drawn, undrawn = min(around.count(1), 6), min(around.count(2), 6)
    before = 4
    if in_reference is not None:
        corners = sum(add(p, d) in in_reference for d in CORNERS)
        near = sum(add(p, d) in in_reference for d in CUBE)
        before = 3 if corners > 4 else 2 if corners > 0 else 1 if near > 0 else 0
    return decoder.decode(models["cell_by_behind", before, states], models["cell_by_count", before, drawn, undrawn])


def corners_of_undrawn(cells, undrawn, settled):
    """Masks by block: the voxels of unsettled blocks that are a corner of an undrawn cell, and of no drawn one."""
    drawn = {p for b, voxels in cells.items() for v in voxels if (p := place(b, v)) not in undrawn}
    corners = {add(p, d) for p in undrawn for d in CORNERS} - {add(p, d) for p in drawn for d in CORNERS}
    masks = {}
    for i, j, k in corners:
        b = (i // EDGE, j // EDGE, k // EDGE)
        if b not in settled:
            masks.setdefault(b, bytearray(EDGE**3))[(k % EDGE * EDGE + j % EDGE) * EDGE + i % EDGE] = 1
    return masks


def place(b, voxel):
    """The voxel of space that is a voxel of block b."""
    return (b[0] * EDGE + voxel % EDGE, b[1] * EDGE + voxel // EDGE % EDGE, b[2] * EDGE + voxel // EDGE**2)


def masked_voxels(masks):
    return {place(b, voxel) for b, mask in masks.items() for voxel in range(EDGE**3) if mask[voxel]}
