"""The reference decoder of isv streams: sections 7.1 and 7.11, and the command.

    python3 docs/spec/reference_decoder [--after-loss] FILE

prints `FRAME HASH` for each frame, in order, and `refused CLASS` as the last line if it refuses something (section 7.11).
With --after-loss it goes on after missing packets (section 7.13) and prints what conformance/loss.txt has: `FRAME INEXACT HASH`,
or `FRAME missing` if the frame is refused. FRAME then counts the frame packets that are there.
"""

import argparse
import sys

import loss
from container import MAIN, Reader, parse_frame, read_frame_packets, read_stream_header
from main import decode_main
from paper import decode_paper
from range_decoder import Models
from refusal import Refused
from volume_hash import volume_hash

RESILIENT = 10


def decode_stream(file, after_loss=False):
    """7.1. Yields the volume of each frame and its hash; None and None for a frame that is refused after a loss."""
    reader = Reader(file)
    header = read_stream_header(reader)
    decode = decode_main if header.profile == MAIN else decode_paper
    reference = expected = models = None
    for packet in read_frame_packets(reader, header):
        if packet.keyframe:
            reference = None
        elif reference is None or packet.since_keyframe != expected:
            if not after_loss:
                raise Refused("missing", "the frame before is not there")
            reference = loss.keep_over_loss(reference)
        frame = parse_frame(header, packet)
        if packet.keyframe or frame.prediction == RESILIENT:
            models = Models()
        elif not loss.is_exact(reference):
            # Refused, and so lost too.
            reference = loss.keep_over_loss(reference)
            yield None, None
            continue
        reference = decode(header, frame, models, reference)
        expected = (packet.since_keyframe + 1) % 2**16
        found = volume_hash(reference)
        if loss.is_exact(reference) and frame.volume_hash not in (None, found):
            raise Refused("damaged", f"volume hash {frame.volume_hash:016x}, but the volume has {found:016x}")
        yield reference, found


def main():
    arguments = argparse.ArgumentParser(prog="reference_decoder", description=__doc__.splitlines()[0])
    arguments.add_argument("--after-loss", action="store_true", help="go on after missing packets")
    arguments.add_argument("file")
    arguments = arguments.parse_args()
    with open(arguments.file, "rb") as file:
        try:
            for number, (volume, found) in enumerate(decode_stream(file, arguments.after_loss)):
                if not arguments.after_loss:
                    print(f"{number} {found:016x}", flush=True)
                elif volume is None:
                    print(f"{number} missing", flush=True)
                else:
                    print(f"{number} {len(volume.inexact)} {volume_hash(loss.exact_part(volume)):016x}", flush=True)
        except Refused as refused:
            print(f"refused {refused.kind}", flush=True)
            print(refused, file=sys.stderr)
        except MemoryError:
            print("refused limit", flush=True)


if __name__ == "__main__":
    main()
