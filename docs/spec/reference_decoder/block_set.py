"""Section 7.10.2: block set."""

from activity import activity
from conventions import AHEAD, BEHIND, add, morton_code
from octree import cell_of, read_octree
from range_decoder import RangeDecoder
from refusal import malformed_if

EDGES_BEHIND = [(-1, -1, 0), (-1, 0, -1), (0, -1, -1), (1, -1, 0), (-1, 1, 0), (1, 0, -1), (0, 1, -1), (-1, 0, 1), (0, -1, 1)]


def cell_of_block(b):
    """The cell of level 2 on whose being still it depends whether the block stays."""
    return cell_of(b, 2)


def read_block_set(frame, models, reference):
    """`reference`: a volume or None. Returns the still cells and the blocks coded in the frame, in Morton order."""
    if reference is None:
        if frame.blocks == 0:
            return set(), []
        return set(), read_octree(RangeDecoder(frame.block_set), models, frame.blocks, None)
    decoder = RangeDecoder(frame.block_set)
    still = read_still_cells(decoder, models, reference) if frame.prediction == 6 else set()
    found = read_flags(decoder, models, frame.blocks, reference, still)
    rest = frame.blocks - len(found)
    if rest > 0:
        found += read_octree(decoder, models, rest, None)
    malformed_if(len(set(found)) < len(found), "a block is there twice")
    malformed_if(any(cell_of_block(b) in still for b in found), "a coded block in a still cell")
    return still, sorted(found, key=morton_code)


def read_still_cells(decoder, models, reference):
    still = set()
    for c in dict.fromkeys(cell_of_block(b) for b in reference.samples):
        was = c in reference.still
        behind = sum(add(c, d) in still for d in BEHIND)
        ahead = sum(add(c, d) in reference.still for d in AHEAD)
        if decoder.decode(models["still", (was * 4 + behind) * 4 + ahead]) == 1:
            still.add(c)
    return still


def read_flags(decoder, models, count, reference, still):
    """The blocks of the reference's volume outside still cells that are coded."""
    activities, expects, coded = {}, set(), set()
    for b in reference.samples:
        if cell_of_block(b) in still:
            if b in reference.coded:
                expects.add(b)
                coded.add(b)
        else:
            activities[b] = activity(reference, b)
            if activities[b].crossings > 0:
                expects.add(b)
    found = []
    for b, of_block in activities.items():
        behind = sum(add(b, d) in coded for d in BEHIND)
        expected = sum(add(b, d) in expects for d in BEHIND)
        ahead = sum(add(b, d) in expects for d in AHEAD)
        edges = sum(add(b, d) in coded for d in EDGES_BEHIND)
        was = b in reference.coded
        by_class = ((of_block.activity_class * 4 + behind) * 4 + ahead) * 2 + was
        by_distance = of_block.fine_class * 4 + behind
        by_surprise = ((of_block.activity_class * 7 + 3 + behind - expected) * 10 + edges) * 2 + was
        if decoder.decode(
            models["by_class", by_class], models["by_distance", by_distance], models["by_surprise", by_surprise]
        ) == 1:
            found.append(b)
            coded.add(b)
            malformed_if(len(found) > count, "more blocks than the frame header says")
    return found
