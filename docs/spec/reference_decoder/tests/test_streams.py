"""Whole streams, cut ones and mutated ones: always the frames before and a class, never anything else."""

import copy
import io
import random
import subprocess
import sys
import time
import unittest

from common import CONFORMANCE, FOLDER, load_command, packets_of, with_checksum_of_header, with_checksum_of_packet

from refusal import Refused

CLASSES = {"foreign", "unsupported", "damaged", "cut", "malformed", "missing", "limit"}
# Streams with frames and an index.
WITHOUT = ("no_frames", "no_index", "no_hashes")
STREAMS = {path.name: path.read_bytes() for path in sorted(CONFORMANCE.glob("*.isv")) if not any(part in path.name for part in WITHOUT)}
# No mutant takes longer; one frame of the largest stream takes below a second on a machine that does nothing else.
SECONDS = 60

command = load_command()


def remembered(function):
    """A decoding process that decodes frames that it has decoded before from memory."""
    memory = {}

    def decode(header, frame, models, reference):
        key = (repr(header), repr(frame), id(reference))
        if key not in memory:
            if "remembered" in models.__dict__:       # the models as they were after the frame before
                models.__dict__ = copy.deepcopy(models.remembered).__dict__
            volume = function(header, frame, models, reference)
            memory[key] = reference, volume, copy.deepcopy(models)
        else:
            models.remembered = memory[key][2]
        return memory[key][1]

    return decode


def remembered_hash(function):
    memory = {}

    def volume_hash(volume):
        if id(volume) not in memory:
            memory[id(volume)] = volume, function(volume)
        return memory[id(volume)][1]

    return volume_hash


def outcome(stream):
    """The hashes of the frames, and the class of the refusal or None."""
    hashes = []
    try:
        for _, found in command.decode_stream(io.BytesIO(stream)):
            hashes.append(found)
    except Refused as refused:
        return hashes, refused.kind
    return hashes, None


class Streams(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.before = command.decode_paper, command.decode_main, command.volume_hash
        command.decode_paper, command.decode_main = remembered(command.decode_paper), remembered(command.decode_main)
        command.volume_hash = remembered_hash(command.volume_hash)

    @classmethod
    def tearDownClass(cls):
        command.decode_paper, command.decode_main, command.volume_hash = cls.before

    def test_there_are_streams(self):
        self.assertGreaterEqual(len(STREAMS), 20)

    def test_a_cut_gives_the_frames_before_it(self):
        for name, stream in STREAMS.items():
            hashes, kind = outcome(stream)
            self.assertIsNone(kind, name)
            packets = packets_of(stream)
            frames_end = packets[-1][0]
            good_ends = {48} | {end for _, end in packets if end <= frames_end}
            for length in sorted({*range(0, len(stream), 37), *good_ends, packets[-1][1], len(stream) - 1}):
                # Packets of other types may stand between frames.
                whole = sum(end <= min(length, frames_end) and stream[at + 4] == 1 for at, end in packets)
                expected = (hashes[:whole], None if length in good_ends else "cut")
                self.assertEqual(outcome(stream[:length]), expected, f"{name} cut to {length} bytes")
            self.assertEqual(outcome(stream + b"\0"), (hashes, "malformed"), name)

    def test_mutated_streams_give_a_class(self):
        random_numbers = random.Random(1)
        for name, stream in STREAMS.items():
            packets = packets_of(stream)
            pieces = [stream[:48]] + [stream[at:end] for at, end in packets] + [stream[packets[-1][1] :]]
            for mutant in range(max(3, 160 // len(STREAMS))):
                mutated = [bytearray(piece) for piece in pieces]
                which = 0 if mutant == 0 else random_numbers.randrange(1, len(pieces) - 1)
                piece = mutated[which]
                # Every fourth mutant is one of a packet's header, its magic and length left alone.
                places = [*range(4, 8), *range(12, 20)] if which and mutant % 4 == 1 else range(24 if which else 8, len(piece))
                for _ in range(random_numbers.randint(1, 4)):
                    piece[random_numbers.choice(places)] = random_numbers.randrange(256)
                mend = with_checksum_of_header if which == 0 else with_checksum_of_packet
                mutated[which] = mend(bytes(piece))
                start = time.monotonic()
                _, kind = outcome(b"".join(mutated))
                self.assertIn(kind, CLASSES | {None}, f"{name}, mutant {mutant}")
                self.assertLess(time.monotonic() - start, SECONDS, f"{name}, mutant {mutant}")

    def test_damage_without_a_fitting_checksum_is_damaged(self):
        for name, stream in STREAMS.items():
            for at, end in packets_of(stream):
                mutated = bytearray(stream)
                mutated[end - 1] ^= 1
                hashes, kind = outcome(bytes(mutated))
                self.assertEqual(kind, "damaged", f"{name}, packet at {at}")

    def test_classes_of_single_faults(self):
        stream = STREAMS["main_inter.isv"]
        packets = packets_of(stream)
        first, second, index = (stream[at:end] for at, end in (packets[0], packets[1], packets[-1]))

        def header(at, *values):
            return with_checksum_of_header(stream[:at] + bytes(values) + stream[at + len(values) : 48])

        def packet(of, at, *values):
            return with_checksum_of_packet(of[:at] + bytes(values) + of[at + len(values) :])

        good = stream[:48]
        for kind, data in [
            ("cut", b""),
            ("foreign", b"\x88" + stream[1:]),
            ("foreign", b"#!"),
            ("unsupported", header(8, 3)),
            ("unsupported", header(12, 2)),
            ("damaged", stream[:47] + b"\0" + stream[48:]),
            ("malformed", header(10, 49)),
            ("malformed", header(13, 4)),
            ("malformed", header(14, 17)),
            ("malformed", header(15, 1)),
            ("malformed", header(16, *[0] * 8)),
            ("malformed", header(28, *[0] * 4)),
            ("malformed", header(32, 1)),
            ("malformed", good + b"ISVQ" + first[4:]),
            ("malformed", good + packet(first, 4, 3)),
            ("malformed", good + packet(first, 5, 7)),
            ("malformed", good + packet(first, 6, 1)),
            ("malformed", good + packet(first, 24, 2)),
            ("malformed", good + packet(first[:24], 8, 0, 0, 0, 0)),
            ("limit", good + packet(first, 8, 1, 0, 0, 64)),
            ("cut", good + packet(first, 8, 0, 0, 0, 64)),
            ("malformed", good + packet(first[:24] + b"\0\xff\xff\xff\x7f", 8, 5, 0, 0, 0)),
            ("limit", good + packet(first[:24] + b"\0\0\x81\2\0\0\0", 8, 7, 0, 0, 0)),
            ("malformed", good + packet(first[:24] + b"\0\0\0", 8, 3, 0, 0, 0)),
            ("missing", good + second),
            ("missing", good + first + packet(second, 6, 2)),
            ("malformed", good + packet(index, 6, 1)),
            ("malformed", good + packet(index, 24, 95)),
            ("cut", good + index[:8] + b"\0\0\0\0" + index[12:20]),
            ("cut", good + packet(index[:24], 8, 0, 0, 0, 0)),
        ]:
            hashes, found = outcome(data)
            self.assertEqual(found, kind, data[:80].hex(" "))

    def test_a_wrong_volume_hash_is_damage(self):
        command_hash = command.volume_hash
        try:
            command.volume_hash = lambda volume: 0
            self.assertEqual(outcome(STREAMS["main_inter.isv"]), ([], "damaged"))
        finally:
            command.volume_hash = command_hash

    def test_the_command_prints_the_protocol(self):
        stream = STREAMS["main_scene_jumps.isv"]
        hashes, _ = outcome(stream)
        end = packets_of(stream)[2][1]
        done = subprocess.run(
            [sys.executable, str(FOLDER), "/dev/stdin"], input=stream[: end + 30], capture_output=True, check=True
        )
        lines = [f"{number} {found:016x}" for number, found in enumerate(hashes[:3])] + ["refused cut"]
        self.assertEqual(done.stdout.decode().splitlines(), lines)


if __name__ == "__main__":
    unittest.main()
