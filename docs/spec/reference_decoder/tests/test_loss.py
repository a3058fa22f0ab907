"""Section 7.13 against its definition: what a decoder after a loss calls exact is what a decoder without loss has."""

import io
import random
import unittest

from common import CONFORMANCE, frame_packet, load_command, packets_of, with_checksum_of_packet

import container
from refusal import Refused

command = load_command()


def varint(value):
    data = bytearray()
    while value >= 128:
        data.append(value & 127 | 128)
        value >>= 7
    return bytes(data) + bytes([value])


def resilient_payload(keyframe, seed, spatial, filter_strength):
    """A resilient frame of the keyframe's blocks in four slices. Random bytes are symbols, but the first slices, as many as
    `spatial`, have a motion segment of zeros: they say that all blocks are spatial."""
    numbers = random.Random(seed)
    # A first decision that is 0 says that all blocks are without a mask.
    segments = [keyframe.block_set, b"\xff"]
    for s in range(4):
        segments += [bytes(40) if s < spatial else numbers.randbytes(1000), numbers.randbytes(8000)]
    head = bytes([10]) + varint(keyframe.blocks) + b"\4" + varint(600) + bytes([filter_strength])
    return head + (b"\x20" if filter_strength else b"") + b"".join(varint(len(s)) for s in segments) + b"".join(segments)


def decoded(header, packets, after_loss):
    """The volumes; None for a frame that is refused."""
    return [volume for volume, _ in command.decode_stream(io.BytesIO(header + b"".join(packets)), after_loss)]


class Loss(unittest.TestCase):
    def setUp(self):
        stream = (CONFORMANCE / "main_inter.isv").read_bytes()
        self.header = stream[:48]
        (at, end), (second_at, second_end) = packets_of(stream)[:2]
        self.keyframe, self.inter = stream[at:end], stream[second_at:second_end]
        reader = container.Reader(io.BytesIO(stream))
        stream_header = container.read_stream_header(reader)
        self.frame = container.parse_frame(stream_header, next(container.read_frame_packets(reader, stream_header)))

    def resilient(self, since_keyframe, spatial, filter_strength=0):
        """A packet that decodes: of random symbols some say that a vector is too long."""
        for seed in range(since_keyframe, 1000, 10):
            payload = resilient_payload(self.frame, seed, spatial, filter_strength)
            try:
                decoded(self.header, [self.keyframe, frame_packet(payload, False, 1)], False)
            except Refused:
                continue
            return frame_packet(payload, False, since_keyframe)
        raise AssertionError("no payload decodes")

    def check_exact(self, packets, lost):
        """Decodes all packets, and those that are left. Returns for each of these how many blocks are exact, of how many."""
        whole = decoded(self.header, packets, False)
        left = [n for n in range(len(packets)) if n not in lost]
        counts = []
        for n, volume in zip(left, decoded(self.header, [packets[n] for n in left], True), strict=True):
            self.assertEqual(list(volume.samples), list(whole[n].samples))
            exact = [b for b in volume.samples if command.loss.is_exact_at(volume, b)]
            for b in exact:
                self.assertTrue((volume.samples[b] == whole[n].samples[b]).all(), f"frame {n}, block {b}")
            if len(exact) == len(volume.samples):
                self.assertEqual(command.volume_hash(volume), command.volume_hash(whole[n]))
            counts.append((len(exact), len(volume.samples)))
        return counts

    def test_a_spatial_frame_is_exact_after_a_loss_and_goes_on(self):
        packets = [self.keyframe, *(self.resilient(n, 4 if n == 2 else 0, filter_strength=20) for n in (1, 2, 3))]
        for lost in [], [1], [0, 1]:
            self.assertTrue(all(exact == total for exact, total in self.check_exact(packets, lost)), lost)

    def test_exact_blocks_are_those_of_a_decoder_without_loss(self):
        for filter_strength in (0, 25):
            packets = [self.keyframe, *(self.resilient(n, n % 4, filter_strength) for n in (1, 2, 3, 4))]
            for lost in [1], [0, 2]:
                counts = self.check_exact(packets, lost)
                self.assertTrue(any(0 < exact < total for exact, total in counts), counts)

    def test_other_frames_are_refused_until_all_blocks_are_exact(self):
        inter = with_checksum_of_packet(self.inter[:6] + b"\3\0" + self.inter[8:])
        temporal, spatial = self.resilient(2, spatial=0), self.resilient(2, spatial=4)
        last = with_checksum_of_packet(temporal[:6] + b"\4\0" + temporal[8:])
        volumes = decoded(self.header, [self.keyframe, temporal, inter, last], True)
        self.assertEqual([volume is None for volume in volumes], [False, False, True, False])
        self.assertEqual([command.loss.is_exact(volume) for volume in volumes if volume], [True, False, False])
        self.assertEqual(decoded(self.header, [inter], True), [None])
        self.assertTrue(command.loss.is_exact(decoded(self.header, [self.keyframe, spatial], True)[1]))

    def test_a_refused_frame_is_lost_like_one_that_did_not_come(self):
        inter = with_checksum_of_packet(self.inter[:6] + b"\4\0" + self.inter[8:])
        partly, after = self.resilient(3, spatial=2), self.resilient(4, spatial=0)
        later = with_checksum_of_packet(after[:6] + b"\5\0" + after[8:])
        exact = []
        for packets in [after], [later], [inter, after]:
            *_, last = decoded(self.header, [self.keyframe, partly, *packets], True)
            exact.append({b for b in last.samples if command.loss.is_exact_at(last, b)})
        self.assertGreater(exact[0], exact[1])
        self.assertEqual(exact[1], exact[2])

    def test_without_the_option_a_missing_packet_is_the_end(self):
        with self.assertRaisesRegex(Refused, "missing"):
            decoded(self.header, [self.keyframe, self.resilient(2, spatial=4)], False)

    def test_frames_of_profile_paper_wait_for_a_keyframe(self):
        stream = (CONFORMANCE / "paper_ends_edge_8.isv").read_bytes()
        packets = [stream[at:end] for at, end in packets_of(stream)][:7]
        volumes = decoded(stream[:48], packets[:1] + packets[2:], True)
        self.assertEqual([volume is None for volume in volumes], [False, True, True, True, True, False])


class Table(unittest.TestCase):
    """`conformance/loss.txt`."""

    def test_frames_after_losses_are_as_committed(self):
        expected = {}
        for line in (CONFORMANCE / "loss.txt").read_text().splitlines():
            stream, lost, *frame = line.split(" ")
            expected.setdefault((stream, lost), []).append(frame)
        self.assertGreaterEqual(len(expected), 10)
        for (name, lost), frames in expected.items():
            stream = (CONFORMANCE / name).read_bytes()
            packets = [stream[at:end] for at, end in packets_of(stream) if stream[at + 4] == 1]
            left = [n for n in range(len(packets)) if str(n) not in lost.split(",")]
            whole = decoded(stream[:48], packets, False)
            found = []
            for n, volume in zip(left, decoded(stream[:48], [packets[n] for n in left], True), strict=True):
                if volume is None:
                    found.append([str(n), "missing", "-"])
                    continue
                part = command.loss.exact_part(volume)
                self.assertTrue(all((part.samples[b] == whole[n].samples[b]).all() for b in part.samples), f"{name}, frame {n}")
                found.append([str(n), str(len(volume.inexact)), f"{command.volume_hash(part):016x}"])
            self.assertEqual(found, frames, f"{name} without {lost}")


if __name__ == "__main__":
    unittest.main()
