"""Version 2 of the container: packets that are skipped, and colour parts that are split off."""

import io
import unittest

import common
from refusal import Refused

STREAM = (common.CONFORMANCE / "main_inter.isv").read_bytes()
COLOUR = 4


def second(layers):
    """The stream header in version 2."""
    header = bytearray(STREAM[:48])
    header[8], header[15] = 2, layers
    return common.with_checksum_of_header(bytes(header))


def frames():
    """The frame packets of the stream."""
    return [STREAM[at:end] for at, end in common.packets_of(STREAM)[:-1]]


def coloured(packet, colour, length):
    """The packet with a colour part."""
    payload = packet[24:] + colour + length.to_bytes(4, "little")
    header = bytearray(packet[:24])
    header[5] |= COLOUR
    header[8:12] = len(payload).to_bytes(4, "little")
    return common.with_checksum_of_packet(bytes(header) + payload)


def unknown(kind, payload=b"whatever"):
    header = b"ISVP" + bytes([kind, 255, 1, 2]) + len(payload).to_bytes(4, "little") + bytes(12)
    return common.with_checksum_of_packet(header + payload)


def hashes(stream):
    """Hashes of the frames, and the class of what is refused after them."""
    found = []
    try:
        for _volume, volume_hash in common.load_command().decode_stream(io.BytesIO(stream)):
            found.append(volume_hash)
    except Refused as refused:
        return found, refused.kind
    return found, None


class Version2(unittest.TestCase):
    def setUp(self):
        self.expected = hashes(STREAM)

    def test_colour_parts_leave_volumes_as_they_are(self):
        colours = [b"", b"colour", bytes(300)]
        packets = [coloured(packet, colour, len(colour)) for packet, colour in zip(frames(), colours)]
        stream = second(3) + b"".join(packets + frames()[len(packets) :])
        self.assertEqual(hashes(stream), self.expected)

    def test_skippable_packets_are_passed_over(self):
        stream = second(0) + unknown(128) + b"".join(packet + unknown(255) for packet in frames())
        self.assertEqual(hashes(stream), self.expected)

    def test_other_unknown_packets_stop_the_decoder(self):
        for kind in (0, 3, 127):
            self.assertEqual(hashes(second(0) + frames()[0] + unknown(kind)), (self.expected[0][:1], "unsupported"))

    def test_a_colour_part_has_to_fit(self):
        first = frames()[0]
        for length in (len(first) - 24 + 1, 2**32 - 1):
            self.assertEqual(hashes(second(1) + coloured(first, b"", length)), ([], "malformed"))
        self.assertEqual(hashes(second(0) + coloured(first, b"", 0)), ([], "malformed"))


if __name__ == "__main__":
    unittest.main()
