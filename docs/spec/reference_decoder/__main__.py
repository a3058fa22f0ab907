"""The reference decoder of isv streams: sections 7.1 and 7.11, and the command.

    python3 docs/spec/reference_decoder [--after-loss] FILE

prints `FRAME HASH` for each frame, in order, and `refused CLASS` as the last line if it refuses something (section 7.11).
"""

import argparse
import sys

from container import MAIN, Reader, parse_frame, read_frame_packets, read_stream_header
from main import decode_main
from paper import decode_paper
from range_decoder import Models
from refusal import Refused
from volume_hash import volume_hash

RESILIENT = 10


def decode_stream(file):
    """Yields the volume hash of each frame."""
    reader = Reader(file)
    header = read_stream_header(reader)
    decode = decode_main if header.profile == MAIN else decode_paper
    reference = since_keyframe = models = None
    for packet in read_frame_packets(reader):
        if packet.keyframe:
            reference = None
        elif reference is None or packet.since_keyframe != (since_keyframe + 1) % 2**16:
            raise Refused("missing", "the frame before is not there")
        frame = parse_frame(header, packet)
        if packet.keyframe or frame.prediction == RESILIENT:
            models = Models()
        reference = decode(header, frame, models, reference)
        since_keyframe = packet.since_keyframe
        found = volume_hash(reference)
        if frame.volume_hash is not None and frame.volume_hash != found:
            raise Refused("damaged", f"volume hash {frame.volume_hash:016x}, but the volume has {found:016x}")
        yield found


def main():
    arguments = argparse.ArgumentParser(prog="reference_decoder", description=__doc__.splitlines()[0])
    arguments.add_argument("file")
    with open(arguments.parse_args().file, "rb") as file:
        try:
            for number, found in enumerate(decode_stream(file)):
                print(f"{number} {found:016x}", flush=True)
        except Refused as refused:
            print(f"refused {refused.kind}", flush=True)
            print(refused, file=sys.stderr)
        except MemoryError:
            print("refused limit", flush=True)


if __name__ == "__main__":
    main()
