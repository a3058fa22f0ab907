"""Section 7.10.4: coefficients."""

from modes import reference_levels
from range_decoder import RangeDecoder
from scan import frequencies, scan_order

PLACES = [frequencies(position, 8) for position in scan_order(8)[:162]]


def read_coefficients(frame, s, models, neighbours, modes, before):
    """The levels of the blocks of slice s, in scan order."""
    decoder = RangeDecoder(frame.coefficients[s])
    levels, count = {}, {}
    for b in neighbours.blocks:
        levels[b] = read_block(decoder, models.bits, b, neighbours, modes, count, before)
        count[b] = sum(level != 0 for level in levels[b])
    return levels


def read_block(decoder, models, b, neighbours, modes, count, before):
    """`count`: the number of levels that are not 0 of the blocks before."""
    t = 1 if modes[b].vector is None else 0
    around, p = count_context(b, neighbours, count, before)
    n = 0
    while n < 162:
        c = min(n, 20)
        if decoder.decode(models["count", t, c], models["count_by_around", t, c, around], models["count_by_before", t, c, p]) == 1:
            break
        n += 1
    levels = [0] * 162
    there = set()                                     # frequencies that have a level that is not 0
    remaining = n
    k = 0
    while remaining > 0:
        u, v, w = PLACES[k]
        total = u + v + w
        lower = ((u - 1, v, w) in there) + ((u, v - 1, w) in there) + ((u, v, w - 1) in there)
        if remaining == 162 - k:
            found = 1
        else:
            found = decoder.decode(
                models["place", t, k],
                models["place_by_remaining", t, k, min(remaining, 6) - 1],
                models["place_by_lower", t, total, lower, min(remaining, 4) - 1],
            )
        if found == 1:
            levels[k] = read_level(decoder, models, t, k, n, total)
            there.add((u, v, w))
            remaining -= 1
        k += 1
    return levels


def read_level(decoder, models, t, k, n, total):
    m = 1
    while m <= 14:
        if decoder.decode(
            models["magnitude_by_place", t, m - 1, min(k, 40)],
            models["magnitude_by_count", t, m - 1, min(n, 10)],
            models["magnitude_by_sum", t, m - 1, total],
        ) == 1:
            break
        m += 1
    if m == 15:
        m = min(15 + decoder.decode_exp_golomb(), 2**20)
    return -m if decoder.decode_raw(1) == 1 else m


def count_context(b, neighbours, count, before):
    first = neighbours.before[b][:4]
    total = sum(count[neighbour] for neighbour in first)
    around = 0 if not first else 1 + min(2 * total // len(first), 15)
    return around, reference_levels(before, b)
