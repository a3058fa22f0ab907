"""Section 7.9: profile `paper`."""

from conventions import BEHIND, Volume, add
from masks import read_mask
from octree import read_octree
from range_decoder import RangeDecoder
from refusal import malformed_if
from residual import reconstruct
from warp import warp

ZERO = ((0, 0, 0), (0, 0, 0))


def decode_paper(header, frame, models, reference):
    """`reference`: a volume or None."""
    blocks = read_block_set(frame, models.bits, reference)
    volume = Volume()
    volume.masks = read_masks(header, frame, models.bits, blocks, reference)
    predicted = set()
    if reference is not None and frame.prediction != 0:
        predicted = {b for b in blocks if b in reference.samples}
    steps = [header.dc_step] + [header.ac_step] * (header.coefficients - 1)
    for s in range(frame.slices):
        of_slice = frame.slice(s, blocks)
        motion = read_motion(header, frame, s, models.slices[s], of_slice, predicted)
        levels = read_coefficients(header, frame, s, models.slices[s], of_slice, predicted)
        for b in of_slice:
            prediction = predict(header, b, motion, predicted, reference)
            volume.samples[b] = reconstruct(prediction, levels[b], steps, header.edge, header.mu_codes)
    return volume


def read_block_set(frame, models, reference):
    """7.9.1"""
    if frame.blocks == 0:
        return []
    decoder = RangeDecoder(frame.block_set)
    return read_octree(decoder, models, frame.blocks, None if reference is None else reference.samples)


def read_masks(header, frame, models, blocks, reference):
    """7.9.2"""
    decoder = RangeDecoder(frame.masks)
    masks = {}
    if decoder.decode_any(models["any"]) == 0:
        return masks
    blocks = dict.fromkeys(blocks)
    for b in blocks:
        mask = read_mask(decoder, models, b, range(header.edge**3), header.edge, blocks, masks, reference)
        if mask is not None:
            masks[b] = mask
    return masks


def read_motion(header, frame, s, models, blocks, predicted):
    """7.9.3: the vectors (t, r) of the predicted blocks of slice s."""
    if frame.prediction in (0, 1):
        return {b: ZERO for b in blocks if b in predicted}
    decoder = RangeDecoder(frame.motion[s])
    last = ZERO
    vectors = {}
    for b in blocks:
        if b not in predicted:
            continue
        (pt, pr), spread = predict_vector(b, vectors, last)
        t = tuple(pt[c] + decoder.decode_integer(models.integers["component", spread, c]) for c in range(3))
        r = (0, 0, 0)
        if frame.prediction == 3:
            r = tuple(pr[c] + decoder.decode_integer(models.integers["component", spread, 3 + c]) for c in range(3))
        malformed_if(any(abs(c) > 4 * (header.edge - 1) for c in t) or any(abs(c) > 32 for c in r), "motion vector")
        vectors[b] = last = (t, r)
    return vectors


def predict_vector(b, vectors, last):
    known = [vectors[add(b, d)] for d in BEHIND if add(b, d) in vectors]
    if not known:
        return last, 2
    if len(known) == 1:
        return known[0], 2

    def of_component(values):
        return (values[0] + values[1]) >> 1 if len(values) == 2 else sorted(values)[1]

    p = tuple(tuple(of_component([v[part][c] for v in known]) for c in range(3)) for part in (0, 1))
    d = max(max(v[0][c] for v in known) - min(v[0][c] for v in known) for c in range(3))
    return p, 0 if d <= 1 else 1 if d <= 4 else 2


def read_coefficients(header, frame, s, models, blocks, predicted):
    """7.9.4"""
    decoder = RangeDecoder(frame.coefficients[s])
    level = {b: [] for b in blocks}
    for k in range(header.coefficients):
        for b in blocks:
            i = 1 if b in predicted else 0
            level[b].append(decoder.decode_integer(models.integers["coefficient", i, k]))
    return level


def predict(header, b, motion, predicted, reference):
    """7.9.5"""
    if b not in predicted:
        return 0
    t, r = motion[b]
    if (t, r) == ZERO:
        return reference.samples[b]
    return warp(reference.samples, b, t, r, header.edge, header.mu_codes)
