"""Section 7.10: profile `main`, and 7.10.9, its masks."""

import numpy as np

import loss
from block_set import cell_of_block, read_block_set
from conventions import CORNERS, CUBE, Volume, add, morton_code
from coefficients import read_coefficients
from container import block_limit
from extension import check_limit, conflicts, extrapolate
from loop_filter import filter_faces
from mask_cells import corners_of_undrawn, read_cells
from masks import read_mask
from modes import Neighbours, read_modes
from range_decoder import RangeDecoder
from residual import reconstruct
from surface_fit import surface_fit
from temporal import predict_temporal

EDGE = 8


def decode_main(header, frame, models, reference):
    """`reference`: a volume or None. It is exact as a whole but for resilient frames after a loss (7.13)."""
    known = None if frame.prediction == 10 else reference
    still, blocks = read_block_set(frame, models.bits, known)
    of_still_cells = [] if known is None else [b for b in known.coded if cell_of_block(b) in still]
    check_limit(blocks + of_still_cells, block_limit(header))
    before = known if frame.prediction in (2, 6) else None
    volume = Volume()
    volume.still = still
    steps = [frame.step] * header.coefficients
    after_loss = frame.prediction == 10 and not loss.is_exact(reference)
    for s in range(frame.slices):
        of_slice = frame.slice(s, blocks)
        neighbours = Neighbours(of_slice)
        modes = read_modes(frame, s, models.slices[s], neighbours, before)
        levels = read_coefficients(frame, s, models.slices[s], neighbours, modes, before)
        for b in of_slice:
            if modes[b].vector is not None:
                prediction = predict_temporal(reference, b, modes[b].vector, header.mu_codes)
                volume.vectors[b] = modes[b].vector
            elif frame.no_spatial_prediction:
                prediction = 0
            else:
                prediction = surface_fit(b, neighbours.fitted[b], volume.samples, header.mu_codes)
            volume.samples[b] = reconstruct(prediction, levels[b], steps, EDGE, header.mu_codes)
            volume.levels_of[b] = sum(level != 0 for level in levels[b])
        if after_loss:
            loss.find_inexact_before_filter(frame, neighbours, modes, reference, volume.inexact)
    if after_loss:
        loss.spread_by_filter(frame, volume, volume.inexact)
    filter_faces(frame, volume, header.mu_codes)
    for b in of_still_cells:
        volume.samples[b] = known.samples[b]
        volume.vectors[b], volume.levels_of[b] = (0, 0, 0), 0
    volume.coded = set(volume.samples)
    extend(volume, header.mu_codes)
    volume.inexact |= loss.inexact_extrapolated(volume, volume.inexact)
    if loss.is_exact(volume):
        read_volume_masks(header, frame, models.bits, volume, known, set(blocks))
    else:
        keep_masks(volume, reference)
    return volume


def extend(volume, mu_codes):
    """7.10.8: adds the extrapolated blocks, and leaves all blocks in Morton order."""
    both = volume.samples | extrapolate(volume.samples, mu_codes)
    volume.samples = {b: both[b] for b in sorted(both, key=morton_code)}


def settled_blocks(volume, known, coded_now):
    """7.10.8, What has settled."""
    if known is None or not volume.still:
        return set()
    changed = coded_now | {b for b in known.coded if cell_of_block(b) not in volume.still}
    near = {add(c, d) for c in changed for d in CUBE}
    near = {add(c, d) for c in near for d in CUBE}    # at most 2 blocks away
    return set(volume.samples) - near


def read_volume_masks(header, frame, models, volume, known, coded_now):
    """7.10.9. `known`: the reference, or None; `coded_now`: the blocks that are coded in this frame."""
    settled = settled_blocks(volume, known, coded_now)
    of_settled = {b: known.masks[b] for b in settled if b in known.masks}
    conflicting = conflicts(volume, [b for b in volume.samples if b not in settled])
    unobserved = {b: np.array(mask, bool).reshape(EDGE, EDGE, EDGE) for b, mask in (conflicting | of_settled).items()}
    decoder = RangeDecoder(frame.masks)
    read = {}
    if decoder.decode_any(models["any"]) == 1:
        by = masks_by_cell if header.masks_by_cell else masks_by_voxel
        read = by(decoder, models, volume.samples, unobserved, settled, known)
    volume.masks = unions(read, conflicting) | of_settled


def masks_by_voxel(decoder, models, samples, unobserved, settled, known):
    read = {}
    for b in samples:
        if b in settled:
            continue
        corners = np.flatnonzero(corners_of_crossed_cells(samples, unobserved, b)).tolist()
        if corners:
            mask = read_mask(decoder, models, b, corners, EDGE, samples, read, known)
            if mask is not None:
                read[b] = mask
    return read


def masks_by_cell(decoder, models, samples, unobserved, settled, known):
    cells = {}                                        # by block: the voxels where they begin
    for b in samples:
        begins = np.zeros((EDGE, EDGE, EDGE), bool)
        for d in CORNERS:
            if (n := add(b, d)) in samples and n not in settled:
                begins[tuple(slice(7, 8) if c else slice(0, 8) for c in reversed(d))] = True
        if begins.any() and (found := np.flatnonzero(crossed_cells(samples, unobserved, b)[1:, 1:, 1:] & begins)).size:
            cells[b] = found.tolist()
    undrawn = read_cells(decoder, models, cells, known)
    return corners_of_undrawn(cells, undrawn, settled)


def unions(some, others):
    """The masks of both, joined where a block has both."""
    joined = {b: bytearray(m | n for m, n in zip(some[b], others[b])) for b in some.keys() & others.keys()}
    return some | others | joined


def keep_masks(volume, reference):
    """7.13: the masks of a frame with blocks that are not exact."""
    kept = {b: mask for b, mask in reference.masks.items() if b in volume.samples}
    volume.masks = unions(kept, conflicts(volume, volume.samples))


def corners_of_crossed_cells(samples, unobserved, b):
    """Boolean array [z][y][x]: the voxels of b that are corners of a crossed cell."""
    crossed = crossed_cells(samples, unobserved, b)
    return np.logical_or.reduce([crossed[k : k + 8, j : j + 8, i : i + 8] for i, j, k in CORNERS])


def crossed_cells(samples, unobserved, b):
    """Boolean array [z][y][x]: which cells are crossed of those that begin at voxels of b from (-1, -1, -1) to (7, 7, 7)."""
    # The voxels from -1 to 8 along each axis, from the block itself and its neighbours.
    known, negative = np.zeros((2, EDGE + 2, EDGE + 2, EDGE + 2), bool)
    here = {-1: slice(0, 1), 0: slice(1, 9), 1: slice(9, 10)}
    there = {-1: slice(7, 8), 0: slice(0, 8), 1: slice(0, 1)}
    for d in CUBE:
        n = add(b, d)
        if n in samples:
            to, part = (tuple(where[c] for c in reversed(d)) for where in (here, there))
            known[to] = ~unobserved[n][part] if n in unobserved else True
            negative[to] = samples[n][part] < 0
    corner = [np.s_[k : k + 9, j : j + 9, i : i + 9] for i, j, k in CORNERS]
    all_known = np.logical_and.reduce([known[c] for c in corner])
    some = np.logical_or.reduce([negative[c] for c in corner])
    every = np.logical_and.reduce([negative[c] for c in corner])
    return all_known & some & ~every
