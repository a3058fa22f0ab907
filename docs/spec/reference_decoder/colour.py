"""Section 7.14: the colour of a stream's frames."""

import struct

from colour_cells import colour_blocks
from colour_spatial import decode_spatial
from colour_symbols import SliceColour
from colour_temporal import decode_temporal
from container import colour_sample_limit, parse_colour
from range_decoder import Models
from refusal import Refused, malformed_if
from volume_hash import xxh64


class ColourDecoder:
    """The state of 7.14. `reference`: the colour blocks of the last frame by coordinate, or None."""

    def __init__(self, layers):
        self.layers = layers
        self.reference, self.models, self.current = None, Models(), False
        self.known = False                            # of the reference (7.14.12)

    @property
    def exact(self):
        """Whether the colour of the last frame is exact (7.14.12)."""
        return self.known and all(block.exact for block in (self.reference or {}).values())

    def lose(self):
        self.current = self.known = False

    def decode(self, packet, volume, colour, volume_exact):
        """`colour`: the colour part, or None. Returns the colour hash of the frame, None if it has no colour."""
        if packet.keyframe:
            self.reference, self.current, self.known = None, False, True
        if not volume_exact:
            self.lose()
            return self.carry_over(volume)
        if colour is None:
            return self.carry_over(volume)
        part = parse_colour(colour, self.layers)
        malformed_if(packet.keyframe and part.kind != 0, "kind of colour of a keyframe")
        if part.kind == 1 and not self.current:
            if not self.exact:
                self.lose()
                return self.carry_over(volume)
            raise Refused("missing", "the colour of the frame before is not there")
        if part.kind != 1:
            self.models = Models()
        if part.kind == 0:
            self.reference = None
        self.reference = self.decode_part(part, volume)
        self.current = self.known = True
        found = colour_hash(self.reference)
        if self.exact and part.colour_hash not in (None, found):
            raise Refused("damaged", f"colour hash {part.colour_hash:016x}, but the samples have {found:016x}")
        return found

    def carry_over(self, volume):
        if self.reference is None:
            return None
        self.reference = carried_over(volume, self.reference, self.known)
        return colour_hash(self.reference)

    def decode_part(self, part, volume):
        blocks = colour_blocks(volume)
        known = self.reference if part.kind == 1 else None
        slices = [SliceColour(part, s, blocks, self.models.slices[s], known, self.layers) for s in range(part.slices)]
        for of_slice in slices:
            of_slice.read_modes()
        check_samples(blocks)
        levels = {}
        for of_slice in slices:
            for layer in range(self.layers):
                of_slice.read_coefficients(layer)
            levels |= of_slice.levels
        temporal = [b for b, block in blocks.items() if block.vector is not None]
        for b in temporal:
            decode_temporal(b, blocks, self.reference, self.known, levels[b], part.steps)
        decode_spatial(blocks, levels, part.steps, part.kind == 2)
        if part.kind == 1:
            for block in blocks.values():
                block.exact = block.exact if block.vector is not None else all(blocks[b].exact for b in temporal)
        return blocks


def carried_over(volume, reference, known):
    """7.14.11"""
    blocks = colour_blocks(volume)
    for b, block in blocks.items():
        block.vector = (0, 0, 0)
        block.depth = reference[b].depth if b in reference else 0
    check_samples(blocks)
    for b in blocks:
        decode_temporal(b, blocks, reference, known, [{}, {}, {}], (1, 1, 1))
    return blocks


def check_samples(blocks):
    """Section 8"""
    samples = sum(8**block.depth * len(block.cells) for block in blocks.values())
    if samples > colour_sample_limit():
        raise Refused("limit", f"{samples} samples of colour")


def colour_hash(blocks):
    """7.14.10"""
    data = bytearray()
    for block in blocks.values():
        samples = block.samples[block.depth]
        for place in block.there[3 + block.depth]:
            data += struct.pack("<3h", *samples[place])
    return xxh64(bytes(data))
