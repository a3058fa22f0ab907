"""Sections 7.2 and 7.3: range decoder and models."""

from collections import defaultdict

from conventions import clamp, ilog2
from refusal import malformed_if


class RangeDecoder:
    """7.2. Refuses a segment as soon as it is overrun, but for the first decision of a mask segment (`decode_any`)."""

    def __init__(self, segment):
        """start(segment)"""
        self.segment = segment
        self.last_position = len(segment) + 4
        self.range = 2**32 - 1
        self.code = self.position = 0
        for _ in range(4):
            self.code = self.code << 8 | self.next_byte()

    def next_byte(self):
        byte = self.segment[self.position] if self.position < len(self.segment) else 0
        self.position += 1
        malformed_if(self.position > self.last_position, "a segment ends before its symbols")
        return byte

    def renormalize(self):
        while self.range < 2**24:
            self.range <<= 8
            self.code = (self.code << 8 | self.next_byte()) % 2**32

    def decode(self, *models):
        """decode of one model, decode_mixed of two or three"""
        bound = (self.range >> 16) * (sum(map(probability, models)) // len(models))
        if self.code < bound:
            bit = 1
            self.range = bound
        else:
            bit = 0
            self.code -= bound
            self.range -= bound
        for model in models:
            update(model, bit)
        if self.range < 2**24:
            self.renormalize()
        return bit

    def decode_any(self, model):
        """The first decision of a mask segment: overrun counts only if it is 1."""
        last_position, self.last_position = self.last_position, float("inf")
        bit = self.decode(model)
        self.last_position = last_position
        malformed_if(bit == 1 and self.position > last_position, "a segment ends before its symbols")
        return bit

    def decode_raw(self, count):
        value = 0
        for _ in range(count):
            self.range >>= 1
            if self.code >= self.range:
                bit = 1
                self.code -= self.range
            else:
                bit = 0
            value = value << 1 | bit
            if self.range < 2**24:
                self.renormalize()
        return value

    def decode_integer(self, model):
        """7.3; `model` is an integer model."""
        if self.decode(model["zero"]) == 1:
            return 0
        n = self.decode(model["negative"])
        e = 0
        while e < 20 and self.decode(model["exponent", e]) == 1:
            e += 1
        node = 1
        m = min(e, 2)
        for _ in range(m):
            node = node << 1 | self.decode(model["mantissa", e, node])
        magnitude = node << (e - m) | self.decode_raw(e - m)
        magnitude = min(magnitude, 2**20)
        return -magnitude if n == 1 else magnitude

    def decode_exp_golomb(self):
        """7.3"""
        e = 0
        while e < 20 and self.decode_raw(1) == 1:
            e += 1
        return 2**e - 1 + self.decode_raw(e)


def fresh():
    """7.3: a bit model is [fast, slow, seen]."""
    return [2**25, 2**25, 0]


def probability(model):
    return clamp((model[0] + model[1]) >> 11, 4, 65532)


def update(model, bit):
    fast, slow, seen = model
    w = ilog2(seen + 1) + 1
    model[0] = approach(fast, bit, min(w, 6))
    model[1] = approach(slow, bit, min(w, 9))
    model[2] = min(seen + 1, 512)


def approach(e, bit, shift):
    return e + ((2**26 - e) >> shift) if bit == 1 else e - (e >> shift)


def bit_models():
    """A set of bit models by name and context. Each comes into being, fresh, where it is first used."""
    return defaultdict(fresh)


def integer_models():
    """A set of integer models by context; each is a set of bit models."""
    return defaultdict(bit_models)


class SliceModels:
    """The models of the motion and coefficient segments of one slice number."""

    def __init__(self):
        self.bits, self.integers = bit_models(), integer_models()


class Models:
    """All models of a profile, fresh."""

    def __init__(self):
        self.bits = bit_models()                      # of block set and masks
        self.slices = defaultdict(SliceModels)
