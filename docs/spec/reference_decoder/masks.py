"""Section 7.5: masks."""

from conventions import BEHIND, add
from refusal import malformed_if


def states(blocks, masks, b, voxels):
    """state(block, voxel) for all voxels of the block at b; `blocks`: coordinates, or None where there is no volume."""
    if blocks is None or b not in blocks:
        return bytes([2]) * voxels
    return masks.get(b) or bytes(voxels)


def read_mask(decoder, models, b, voxels, edge, blocks, masks, reference):
    """`blocks`, `masks`: of this frame, masks as read so far. `reference`: a volume or None. Returns None for no mask."""
    behind = [add(b, d) for d in BEHIND]
    block_context = sum(n in masks for n in behind) + 4 * (reference is not None and b in reference.masks)
    if decoder.decode(models["block", block_context]) == 0:
        return None
    there = (None, None) if reference is None else (reference.samples, reference.masks)
    state_r = states(*there, b, edge**3)
    state_n = [states(blocks, masks, n, edge**3) for n in behind]
    mask = bytearray(edge**3)
    for voxel in voxels:
        context = state_r[voxel]
        for axis, stride in (0, 1), (1, edge), (2, edge**2):
            if (voxel // stride) % edge != 0:
                s = mask[voxel - stride]
            else:
                s = state_n[axis][voxel + (edge - 1) * stride]
            context = context * 3 + s
        mask[voxel] = decoder.decode(models["voxel", context])
    malformed_if(not any(mask), "a mask without voxels")
    return mask
