"""Section 7.6: scan order."""

from functools import cache


def frequencies(position, edge):
    """(u, v, w)"""
    return position % edge, position // edge % edge, position // edge**2


@cache
def scan_order(edge):
    def key(position):
        f = frequencies(position, edge)
        return sum(f), sum(c * c for c in f), position

    return sorted(range(edge**3), key=key)
