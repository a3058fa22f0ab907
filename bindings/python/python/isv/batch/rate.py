"""Bit rates over shards: statistics of each shard first, then a budget for each.

All frames of a take get one quality, as in ``isv encode --passes 2``. The bytes of a shard are a power of its step, so
their logarithm is a line over the quality. Statistics give each shard its line. The quality is where the bytes of all
add up to the rate, and a shard's budget is its bytes there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["MOST_ABOVE", "MOST_BELOW", "PROBES", "Line", "corrected", "quality_for"]

PROBES = (45.0, 70.0)
"""Qualities that statistics are taken at: all of a shard at the first, some of its groups at the second."""

MOST_ABOVE, MOST_BELOW = 0.01, 0.04
"""Shares of the rate above and below it, up to which it is met. Other takes are encoded again, with a correction."""


@dataclass(frozen=True)
class Line:
    """Bytes of a shard by its quality.

    Attributes:
        at: Bytes at the first of the probes.
        slope: Growth of their logarithm with each step of the quality.
    """

    at: float
    slope: float

    def bytes(self, quality: float) -> float:
        """Bytes at a quality."""
        return self.at * math.exp(self.slope * (quality - PROBES[0]))


def quality_for(lines: list[Line], target: float) -> float:
    """The quality, 0 to 100, at which shards add up to a number of bytes; the nearest end if none does."""
    low, high = 0.0, 100.0
    for _ in range(60):
        middle = (low + high) / 2
        if sum(line.bytes(middle) for line in lines) > target:
            high = middle
        else:
            low = middle
    return round(low, 2)


def corrected(quality: float, actual: float, target: float, lines: list[Line]) -> float | None:
    """The next quality to try for a take that has so many bytes, or None if these meet the target or nothing does."""
    excess = actual / target - 1
    if -MOST_BELOW <= excess <= MOST_ABOVE:
        return None
    weight = sum(line.bytes(quality) for line in lines)
    slope = sum(line.slope * line.bytes(quality) for line in lines) / weight
    wanted = quality + math.log((1 - MOST_ABOVE / 2) / (1 + excess)) / max(slope, 1e-3)
    wanted = round(min(100.0, max(0.0, wanted)), 2)
    return None if wanted == quality else wanted
