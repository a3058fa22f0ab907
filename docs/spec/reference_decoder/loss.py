"""Section 7.13: loss. Which blocks of a frame that is decoded after a loss are exact.

A volume knows its blocks that are not exact, and whether it was kept over a loss: then nothing in it is exact.
"""

import copy

from conventions import AHEAD, NEIGHBOURS, Volume, add
from loop_filter import is_filtered
from temporal import split_vector


def is_exact(volume):
    """As a whole."""
    return not volume.kept_over_loss and not volume.inexact


def is_exact_at(volume, coordinate):
    return not volume.kept_over_loss and coordinate not in volume.inexact


def exact_part(volume):
    """What of a decoded volume is as a decoder without loss has it: all, or the exact blocks without their masks."""
    if is_exact(volume):
        return volume
    part = Volume()
    part.samples = {b: samples for b, samples in volume.samples.items() if is_exact_at(volume, b)}
    return part


def keep_over_loss(volume):
    """`volume`: the last one that there is, or None."""
    kept = copy.copy(volume) if volume is not None else Volume()
    kept.kept_over_loss = True
    return kept


def find_inexact_before_filter(frame, neighbours, modes, reference, inexact):
    """Adds the blocks of a slice that are not exact before the filter to `inexact`."""
    for b in neighbours.blocks:
        if modes[b].vector is not None:
            exact = all(is_exact_at(reference, c) for c in looked_at(b, modes[b].vector))
        else:
            exact = frame.no_spatial_prediction or not any(n in inexact for n in neighbours.fitted[b])
        if not exact:
            inexact.add(b)


def looked_at(b, vector):
    """The coordinates that the temporal prediction of a block looks at."""
    whole, t = split_vector(vector)
    along = [{0} | ({-1} if c < 0 else {1} if c > 0 else set()) for c in t]
    return [add(add(b, whole), (dx, dy, dz)) for dx in along[0] for dy in along[1] for dz in along[2]]


def spread_by_filter(frame, volume, inexact):
    """Adds the blocks that the filter makes inexact."""
    if frame.filter == 0:
        return
    for ahead in AHEAD:
        before_axis = set(inexact)
        for lower in volume.samples:
            upper = add(lower, ahead)
            if upper in volume.samples and is_filtered(volume, lower, upper) and before_axis & {lower, upper}:
                inexact |= {lower, upper}


def inexact_extrapolated(volume, inexact):
    """The extrapolated blocks that are not exact; `inexact`: the coded blocks that are not, after the filter."""
    around = {add(b, d) for b in inexact for d in NEIGHBOURS}
    return {u for u in volume.samples if u not in volume.coded and u in around}
