"""Limits: that of blocks holds before blocks are made."""

import random
import unittest

import common  # noqa: F401 (finds the modules of the decoder)

import extension
from conventions import CUBE, add, in_range
from refusal import Refused


class Limits(unittest.TestCase):
    def test_the_extended_volume_is_counted_as_it_is_made(self):
        numbers = random.Random(1)
        ends = [-(2**20), 2**20 - 1, 0, -1, 5]
        for _ in range(50):
            coded = {tuple(numbers.choice(ends) + numbers.randint(-2, 2) for _ in range(3)) for _ in range(numbers.randint(1, 30))}
            coded = [b for b in coded if in_range(b)]
            count = len({n for b in coded for d in CUBE if in_range(n := add(b, d))})
            extension.check_limit(coded, count)
            if coded:
                with self.assertRaisesRegex(Refused, "limit"):
                    extension.check_limit(coded, count - 1)


if __name__ == "__main__":
    unittest.main()
