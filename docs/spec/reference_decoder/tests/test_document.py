"""The tables and examples of the document, and known answers of the checksums."""

import io
import math
import re
import unittest
import zlib

import numpy as np
from common import DOCUMENT, block_of_document, load_command

import conventions
import paper
import range_decoder
import residual
import scan
import surface_fit
import volume_hash
import warp


class AppendixB(unittest.TestCase):
    def setUp(self):
        lines = block_of_document("00  89 49 53 56").splitlines()
        self.stream = bytes.fromhex("".join(line.partition("  ")[2] for line in lines))

    def test_the_stream_has_146_bytes_and_decodes_to_its_hash(self):
        self.assertEqual(len(self.stream), 146)
        frames = list(load_command().decode_stream(io.BytesIO(self.stream)))
        self.assertEqual([found for _, found in frames], [0x67B8DA4F39065A0B])
        samples = frames[0][0].samples
        self.assertEqual(list(samples), [(0, 0, 0)])
        for row in samples[0, 0, 0].reshape(16, 4).tolist():
            self.assertEqual(row, [-376, -156, 156, 376])

    def test_the_bytes_are_those_of_the_table(self):
        rows = re.findall(r"^\| ([0-9A-F]{2}) \| `([^`]*)`", DOCUMENT, re.M)
        self.assertEqual(len(rows), 25)
        for at, text in rows:
            if ".." in text:
                self.assertEqual(self.stream[int(at, 16)], int(text[:2], 16))
            else:
                data = bytes.fromhex(text)
                self.assertEqual(self.stream[int(at, 16) :][: len(data)], data, at)

    def test_the_decisions_are_those_of_the_table(self):
        trace = []

        class Traced(range_decoder.RangeDecoder):
            def decode(self, *models):
                before = self.range, self.code, (self.range >> 16) * 32768
                bit = super().decode(*models)
                trace.append((*before, bit))
                return bit

            def decode_raw(self, count):
                if count:
                    trace.append((self.range, self.code, None, None))
                return super().decode_raw(count)

        decoder = Traced(self.stream[0x60:0x62])
        models = range_decoder.integer_models()
        levels = [decoder.decode_integer(models["coefficient", 0, k]) for k in range(4)]
        self.assertEqual(levels, [0, -36, 0, 0])
        rows = re.findall(r"^\| k = \d, .*? \| ([0-9A-F]{8}) \| ([0-9A-F]{8}) \| ([0-9A-F]{8})? ?\| (.*?) \|$", DOCUMENT, re.M)
        self.assertEqual(len(rows), len(trace))
        for (high, code, bound, bit), row in zip(trace, rows):
            self.assertEqual((f"{high:08X}", f"{code:08X}"), row[:2])
            if bound is not None:
                self.assertEqual((f"{bound:08X}", str(bit)), (row[2], row[3][0]))

    def test_the_block_set_reads_four_bytes_more_than_there_are(self):
        decoder = range_decoder.RangeDecoder(self.stream[0x57:0x5F])
        self.assertEqual(decoder.decode_raw(5), 0)
        self.assertEqual(decoder.decode_raw(63), 0x7000000000000000)
        self.assertEqual(conventions.morton_code((0, 0, 0)), 0x7000000000000000)
        self.assertEqual(decoder.position, 12)


class Tables(unittest.TestCase):
    def test_morton_codes_and_cells_are_inverse(self):
        for b in (-(2**20), 0, 2**20 - 1), (1, -2, 3), (-1048576,) * 3:
            shifted = tuple(c + 2**20 for c in b)
            self.assertEqual(conventions.cell_of_morton_code(conventions.morton_code(b)), shifted)
        self.assertEqual(conventions.morton_code((-(2**20) + 1, -(2**20), -(2**20))), 1)
        self.assertEqual(conventions.morton_code((-(2**20), -(2**20), -(2**20) + 1)), 4)

    def test_scan_order_begins_as_in_the_document(self):
        numbers = block_of_document("  0   1   8  64   9").split()
        self.assertEqual(scan.scan_order(8)[:64], [int(n) for n in numbers])

    def test_sines_and_cosines_are_those_of_the_document(self):
        triples = {}
        for row in re.findall(r"^\| \d+ \| \d+ \| \d+ \| \d+ \| \d+ \| \d+ \| \d+ \| \d+ \| \d+ \|$", DOCUMENT, re.M):
            numbers = [int(n) for n in row.strip("| ").split(" | ")]
            for i, sine, cosine in zip(numbers[::3], numbers[1::3], numbers[2::3]):
                triples[i] = sine, cosine
        self.assertEqual([triples[i] for i in range(33)], list(zip(warp.SIN, warp.COS)))

    def test_matrices_are_those_of_the_document_and_of_the_formula(self):
        for n, matrix in residual.M.items():
            text = block_of_document(f"M{n}[k][j], rows k").partition("\n")[2]
            self.assertEqual(matrix.ravel().tolist(), [int(c) for c in text.split()])
            for k in range(n):
                for j in range(n):
                    s = math.sqrt((1 if k == 0 else 2) / n)
                    self.assertEqual(matrix[k][j], round(2**13 * s * math.cos((2 * j + 1) * k * math.pi / (2 * n))))

    def test_shifts_are_those_of_the_table(self):
        rows = re.findall(r"^\| (4|8|16) \| (\d+)(?: to (\d+))? \| 0 \|(.*)\|$", DOCUMENT, re.M)
        self.assertEqual(len(rows), 15)
        for edge, low, high, numbers in rows:
            for truncation in range(int(low), int(high or low) + 1):
                expected = tuple(int(n) for n in numbers.split("|"))[3:]
                self.assertEqual(residual.shifts(int(edge), 256 * truncation), expected)

    def test_surface_fit_of_the_example(self):
        k, j, i = np.indices((8, 8, 8))
        samples = {
            (-1, 0, 0): (90 * i + 30 * j - 60 * k - 400).astype(np.int16),
            (0, 1, -1): (9 * (i - 3) * (j - 4) + 200 * k - 1100).astype(np.int16),
        }
        prediction = surface_fit.surface_fit((0, 0, 0), list(samples), samples, 1024)
        self.assertEqual(prediction[0, 0].tolist(), [171, 198, 219, 234, 245, 250, 250, 244])
        self.assertEqual(prediction[7, 7].tolist(), [170, 290, 405, 515, 620, 719, 813, 902])

    def test_weights_are_from_1238_down_to_41(self):
        weights = surface_fit.weight(np.arange(128, 1003)).tolist()
        self.assertEqual((weights[0], weights[-2], weights[-1]), (1238, 41, 0))
        self.assertEqual(weights, sorted(weights, reverse=True))

    def test_warp_without_motion_is_the_reference(self):
        block = np.arange(-256, 256).reshape(8, 8, 8).astype(np.int16)
        self.assertTrue((warp.warp({(0, 0, 0): block}, (0, 0, 0), (0, 0, 0), (0, 0, 0), 8, 512) == block).all())

    def test_vector_prediction_of_two_rounds_down(self):
        vectors = {(-1, 0, 0): ((0, 0, 0), (-1, 0, 0)), (0, -1, 0): ((-1, 2, 3), (0, 0, 4))}
        self.assertEqual(paper.predict_vector((0, 0, 0), vectors, paper.ZERO), (((-1, 1, 1), (-1, 0, 2)), 1))


class Checksums(unittest.TestCase):
    def test_crc_of_the_document(self):
        self.assertEqual(zlib.crc32(b"123456789"), 0xCBF43926)

    def test_xxh64_of_known_inputs(self):
        # The empty input is in section 7.12; the others are those of the xxHash specification's implementations.
        for data, expected in {
            b"": 0xEF46DB3751D8E999,
            b"a": 0xD24EC4F1A98C6E5B,
            b"abc": 0x44BC2CF5AD770999,
            b"xxhash": 0x32DD38952C4BC720,
            b"Nobody inspects the spammish repetition": 0xFBCEA83C8A378BF1,
        }.items():
            self.assertEqual(volume_hash.xxh64(data), expected, data)


class RangeDecoder(unittest.TestCase):
    def test_models_begin_at_a_half_and_stay_within_their_range(self):
        for bit in (0, 1):
            model = range_decoder.fresh()
            self.assertEqual(range_decoder.probability(model), 32768)
            for _ in range(10_000):
                range_decoder.update(model, bit)
                self.assertTrue(0 <= model[0] <= 2**26 and 0 <= model[1] <= 2**26)
            self.assertEqual(range_decoder.probability(model), (4, 65532)[bit])
            self.assertEqual(model[2], 512)

    def test_one_model_alone_is_as_one_mixed_with_itself(self):
        segment = bytes(range(7, 207))
        alone, mixed = range_decoder.RangeDecoder(segment), range_decoder.RangeDecoder(segment)
        one, two = range_decoder.fresh(), [range_decoder.fresh(), range_decoder.fresh()]
        for _ in range(500):
            self.assertEqual(alone.decode(one), mixed.decode(*two))

    def test_raw_bits_of_a_segment_of_zeros_are_zeros(self):
        self.assertEqual(range_decoder.RangeDecoder(bytes(20)).decode_raw(100), 0)

    def test_an_overrun_is_malformed_after_the_four_bytes_left_off(self):
        decoder = range_decoder.RangeDecoder(b"")
        self.assertEqual(decoder.decode_raw(7), 0)
        with self.assertRaisesRegex(range_decoder_refused(), "malformed"):
            decoder.decode_raw(1)

    def test_the_first_decision_of_a_mask_segment_may_overrun_if_it_is_0(self):
        model = [0, 0, 0]                             # 1 at a probability of 4/65536
        self.assertEqual(range_decoder.RangeDecoder(b"\xff" * 4).decode_any(model), 0)
        likely = [2, 0, 0]
        with self.assertRaisesRegex(range_decoder_refused(), "malformed"):
            range_decoder.RangeDecoder(b"").decode_any(likely)


def range_decoder_refused():
    from refusal import Refused

    return Refused


if __name__ == "__main__":
    unittest.main()
