"""Section 7.14: examples of the document, the arithmetic by its definition, streams with colour, and what is refused."""

import io
import random
import re
import unittest

import numpy as np
from common import CONFORMANCE, DOCUMENT, frame_packet, load_command, packets_of, with_checksum_of_packet

import colour
import colour_cells
import colour_symbols
import colour_temporal
import colour_transform
import container
from container import parse_colour
from conventions import CUBE
from refusal import Refused

command = load_command()
STREAMS = {path.name: path.read_bytes() for path in sorted(CONFORMANCE.glob("colour_*.isv"))}


def outcome(stream, after_loss=False):
    """Words on the colour of the frames, and the class of the refusal or None."""
    words = []
    try:
        for _, _, colour in command.decode_frames(io.BytesIO(stream), after_loss, True):
            words.append(colour)
    except Refused as refused:
        return words, refused.kind
    return words, None


def cell_of(samples):
    halves, quarters = (colour_cells.crossed_parts(np.array([samples]), n)[0] for n in (2, 4))
    return colour_cells.Cell((0, 0, 0), np.array(samples), halves, quarters)


class Examples(unittest.TestCase):
    def test_the_cell_of_the_document(self):
        text = DOCUMENT[DOCUMENT.index("*Example.* A cell with the samples") :].split("\n\n")[0]
        numbers = [int(n) for n in re.findall(r"-?\d+", text)]
        cell = cell_of(numbers[:8])
        self.assertEqual([*cell.offset, *cell.normal], numbers[8:14])
        self.assertEqual(list(cell.parts[1]), numbers[14:20])
        self.assertEqual([len(cell.parts[2]), *cell.parts[2]], numbers[20:])

    def test_the_changes_of_the_document(self):
        for text, found in {
            "`mean_change(1, 16, 4)` is 64": colour_transform.mean_change((1, 0, 0), (16, 1, 1), 4)[0] == 64,
            "`difference(1, 16, 4, 4)` is 91": colour_transform.difference(1, 16, 4, 4) == 91,
            "`difference(-3, 16, 4, 4)` is -272": colour_transform.difference(-3, 16, 4, 4) == -272,
        }.items():
            self.assertTrue(found, text)
            self.assertIn(text, " ".join(DOCUMENT.split()))

    def test_differences_are_those_of_the_table(self):
        rows = re.findall(r"^\| (\d) \| (\d)[^|]*\| ([^|]*) \| ([^|]*) \|$", DOCUMENT[DOCUMENT.index("| difference | stage") :], re.M)
        self.assertEqual(len(rows), 7)
        for d, stage, *sides in rows:
            found = tuple(tuple(int(c) for c in re.findall(r"\d", side)) for side in sides)
            self.assertEqual((colour_transform.STAGES[int(d)], colour_transform.SIDES[int(d)]), (int(stage), found))


class Arithmetic(unittest.TestCase):
    def test_parts_cross_where_the_interpolated_field_does(self):
        numbers = random.Random(2)
        for _ in range(30):
            samples = [numbers.randrange(-512, 512) for _ in range(8)]
            cell = cell_of(samples)

            def value(x, y, z):
                return sum(s * (x if i else 1 - x) * (y if j else 1 - y) * (z if k else 1 - z)
                           for s, (i, j, k) in zip(samples, colour_cells.CORNERS))

            for depth in (1, 2):
                n = 2**depth
                for part in range(n**3):
                    at = colour_cells.position(part)
                    below = [value(*((c + d) / n for c, d in zip(at, corner))) < 0 for corner in colour_cells.CORNERS]
                    self.assertEqual(part in cell.parts[depth], any(below) and not all(below))

    def test_surfels_are_one_step_of_newton(self):
        numbers = random.Random(3)
        for _ in range(100):
            samples = [numbers.randrange(-512, 512) for _ in range(8)]
            cell = cell_of(samples)
            f = sum(samples) / 8
            g = [sum(s if c[a] else -s for s, c in zip(samples, colour_cells.CORNERS)) / 4 for a in range(3)]
            square = sum(c * c for c in g)
            for axis in range(3):
                self.assertLess(abs(cell.offset[axis] - max(-256, min(256, -256 * f * g[axis] / square))), 1)
                self.assertLess(abs(cell.normal[axis] - 127 * g[axis] / square**0.5), 2)

    def test_a_cell_without_a_gradient_faces_everything(self):
        cell = cell_of([100 if sum(corner) % 2 else -100 for corner in colour_cells.CORNERS])
        self.assertEqual((cell.offset, cell.normal), ((0, 0, 0), (0, 0, 0)))
        self.assertTrue(all(cell.faces(n) for n in [(127, 0, 0), (-127, 0, 0), (0, 0, 0)]))
        # Between the corners the field is 0, which is not inside.
        self.assertEqual(cell.parts[1], (0, 3, 5, 6))

    def test_the_changes_of_orthonormal_coefficients(self):
        for level, step, a, b in [(1, 16, 1, 1), (9, 40, 5, 300), (-700, 3, 2000, 64), (2, 65535, 1, 7)]:
            expected = level * step / 16 * 64 * (4 * (a + b) / (a * b)) ** 0.5
            found = colour_transform.difference(level, step, a, b)
            self.assertLess(abs(found - max(-32768, min(32768, expected))), 0.6)

    def test_differences_keep_the_mean(self):
        numbers = random.Random(4)
        for _ in range(200):
            children = sorted(numbers.sample(range(8), numbers.randint(2, 8)))
            weights = {c: numbers.randint(1, 64) for c in children}
            levels = {d: tuple(numbers.randint(-9, 9) for _ in range(3)) for d in colour_transform.differences(children)}
            self.assertEqual(len(levels), len(children) - 1)
            values = dict.fromkeys(children, (0, 0, 0))
            colour_transform.add_differences(values, weights, levels, (160, 200, 200))
            mean = colour_transform.mean(list(values.values()), list(weights.values()))
            self.assertTrue(all(abs(channel) <= 3 for channel in mean), mean)

    def test_motion_of_equal_vectors_is_theirs(self):
        for vector in [(1, -128, 128), (0, 0, 0), (-3, 5, 7)]:
            for vectors in ({(0, 0, 0): vector}, dict.fromkeys(CUBE, vector)):
                self.assertEqual(colour_temporal.motion(vectors, (0, 3, 7)), tuple(32 * c for c in vector))

    def test_energies_have_five_classes(self):
        self.assertEqual([colour_symbols.energy_class(e) for e in range(8)], [0, 1, 2, 3, 3, 4, 4, 4])
        self.assertEqual([colour_symbols.energy(levels) for levels in [(0, 0, 0), (0, -1, 0), (1, 0, 0), (-9, 9, 9)]], [0, 1, 2, 3])


class Parts(unittest.TestCase):
    def test_fields_and_segments(self):
        part = parse_colour(bytes([0x81, 0xAC, 2, 1, 2]) + bytes(range(8)) + bytes([1, 0, 2, 0]) + b"abc", 1)
        self.assertEqual((part.kind, part.steps, part.slices), (1, (300, 1, 1), 2))
        self.assertEqual(part.colour_hash, 0x0706050403020100)
        self.assertEqual((part.modes, part.coefficients), ([b"a", b""], [[b"bc", b""]]))

    def test_every_prefix_and_one_byte_more_are_malformed(self):
        whole = bytes([0x82, 7, 9, 1]) + bytes(8) + bytes([3, 1, 2]) + b"abcdef"
        parse_colour(whole, 2)
        for wrong in [whole[:length] for length in range(len(whole))] + [whole + b"\0"]:
            with self.assertRaisesRegex(Refused, "malformed"):
                parse_colour(wrong, 2)


class Streams(unittest.TestCase):
    def test_colour_is_as_committed_and_without_it_volumes_are(self):
        rows = [line.split() for line in (CONFORMANCE / "colour.txt").read_text().splitlines()]
        # Each of them takes seconds: `conformance/run --colour` decodes them all.
        for name in ("colour_one_layer.isv", "colour_absent.isv"):
            expected = [colour for stream, _, colour in rows if stream == name]
            self.assertEqual(outcome(STREAMS[name]), (expected, None))

    def test_a_wrong_hash_is_damage(self):
        xxh64 = colour.xxh64
        try:
            colour.xxh64 = lambda data: 0
            self.assertEqual(outcome(STREAMS["colour_one_layer.isv"]), ([], "damaged"))
        finally:
            colour.xxh64 = xxh64

    def test_mutated_parts_give_a_class(self):
        numbers = random.Random(5)
        stream = STREAMS["colour_two_layers.isv"]
        packets = packets_of(stream)
        for mutant in range(24):
            (at, end) = packets[0]
            packet = bytearray(stream[at:end])
            colour_bytes = int.from_bytes(packet[-4:], "little")
            for _ in range(numbers.randint(1, 3)):
                packet[-5 - numbers.randrange(colour_bytes)] = numbers.randrange(256)
            words, kind = outcome(stream[:48] + with_checksum_of_packet(bytes(packet)))
            self.assertIn(kind, {"malformed", "damaged", "limit", None}, f"mutant {mutant}")
            self.assertEqual(len(words), 0 if kind else 1)

    def test_frames_after_a_loss_say_whether_they_are_exact(self):
        rows = [line.split() for line in (CONFORMANCE / "colour_loss.txt").read_text().splitlines()]
        stream, lost = rows[0][:2]
        expected = [words[-1] for words in rows if words[:2] == [stream, lost]]
        packets = packets_of(STREAMS[stream])
        kept = [STREAMS[stream][at:end] for number, (at, end) in enumerate(packets[:-1]) if str(number) not in lost.split(",")]
        words, _ = outcome(STREAMS[stream][:48] + b"".join(kept), after_loss=True)
        self.assertEqual([word or "-" for word in words], expected)

    def test_blocks_that_are_said_to_be_exact_are(self):
        stream = STREAMS["colour_refreshed_noise.isv"]
        reader = container.Reader(io.BytesIO(stream))
        header = container.read_stream_header(reader)
        packets = list(container.read_frame_packets(reader, header))
        volumes = [volume for volume, _ in command.decode_stream(io.BytesIO(stream))]
        exact = wrong = 0
        for lost in (0, 1, 3):
            whole, damaged = (colour.ColourDecoder(header.colour_layers) for _ in range(2))
            for number, (packet, volume) in enumerate(zip(packets, volumes)):
                part = container.parse_frame(header, packet).colour
                whole.decode(packet, volume, part, True)
                if number == lost:
                    damaged.lose()
                    continue
                damaged.decode(packet, volume, part, True)
                for b, block in (damaged.reference or {}).items():
                    equal = block.samples == whole.reference[b].samples
                    self.assertTrue(equal or not (damaged.known and block.exact), f"without {lost}, frame {number}, block {b}")
                    exact += damaged.known and block.exact and block.vector is not None
                    wrong += not equal
        self.assertTrue(exact > 20 and wrong > 4, f"{exact} {wrong}")

    def test_a_keyframe_without_colour_ends_that_of_its_predecessors(self):
        stream = STREAMS["colour_keyframes.isv"]
        words, _ = outcome(stream)
        self.assertEqual(words[2:4], ["-", "-"])
        empty = frame_packet(bytes([0, 0, 1, 1, 0, 0, 0, 0, 0]), True, 0)
        self.assertEqual(outcome(stream[: packets_of(stream)[0][1]] + empty), ([words[0], "-"], None))


if __name__ == "__main__":
    unittest.main()
