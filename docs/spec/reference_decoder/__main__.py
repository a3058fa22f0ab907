"""The reference decoder of isv streams: sections 7.1 and 7.11, and the command.

    python3 docs/spec/reference_decoder [--colour] [--after-loss] FILE

prints `FRAME HASH` for each frame, in order, and `refused CLASS` as the last line if it refuses something (section 7.11).
With --after-loss it goes on after missing packets (section 7.13) and prints what conformance/loss.txt has: `FRAME INEXACT HASH`,
or `FRAME missing` if the frame is refused. FRAME then counts the frame packets that are there.
With --colour it decodes colour too (section 7.14), and a last word on each line is the colour hash, `-` for a frame without colour,
or `inexact` for colour that is not exact.
"""

import argparse
import sys

import loss
from colour import ColourDecoder
from container import MAIN, Reader, parse_frame, read_frame_packets, read_stream_header
from main import decode_main
from paper import decode_paper
from range_decoder import Models
from refusal import Refused
from volume_hash import volume_hash

RESILIENT = 10


def decode_stream(file, after_loss=False):
    """7.1. Yields the volume of each frame and its hash; None and None for a frame that is refused after a loss."""
    for volume, found, _colour in decode_frames(file, after_loss):
        yield volume, found


def decode_frames(file, after_loss=False, with_colour=False):
    """7.1. As `decode_stream`, and a word on the colour of each frame, which is None unless it is decoded."""
    reader = Reader(file)
    header = read_stream_header(reader)
    decode = decode_main if header.profile == MAIN else decode_paper
    colour = ColourDecoder(header.colour_layers) if with_colour and header.colour_layers > 0 else None
    reference = expected = models = None
    for packet in read_frame_packets(reader, header):
        if packet.keyframe:
            reference = None
        elif reference is None or packet.since_keyframe != expected:
            if not after_loss:
                raise Refused("missing", "the frame before is not there")
            reference = loss.keep_over_loss(reference)
            if colour is not None:
                colour.lose()
        frame = parse_frame(header, packet)
        if packet.keyframe or frame.prediction == RESILIENT:
            models = Models()
        elif not loss.is_exact(reference):
            # Refused, and so lost too.
            reference = loss.keep_over_loss(reference)
            yield None, None, None
            continue
        volume = decode(header, frame, models, reference)
        said = "-" if with_colour else None
        if colour is not None:
            found = colour.decode(packet, volume, frame.colour, loss.is_exact(volume))
            said = "inexact" if not colour.exact else "-" if found is None else f"{found:016x}"
        reference = volume
        expected = (packet.since_keyframe + 1) % 2**16
        found = volume_hash(reference)
        if loss.is_exact(reference) and frame.volume_hash not in (None, found):
            raise Refused("damaged", f"volume hash {frame.volume_hash:016x}, but the volume has {found:016x}")
        yield reference, found, said


def main():
    arguments = argparse.ArgumentParser(prog="reference_decoder", description=__doc__.splitlines()[0])
    arguments.add_argument("--after-loss", action="store_true", help="go on after missing packets")
    arguments.add_argument("--colour", action="store_true", help="decode colour too")
    arguments.add_argument("file")
    arguments = arguments.parse_args()
    with open(arguments.file, "rb") as file:
        try:
            frames = decode_frames(file, arguments.after_loss, arguments.colour)
            for number, (volume, found, colour) in enumerate(frames):
                if volume is None:
                    words = ["missing"]
                elif arguments.after_loss:
                    words = [str(len(volume.inexact)), f"{volume_hash(loss.exact_part(volume)):016x}"]
                else:
                    words = [f"{found:016x}"]
                if volume is not None and colour is not None:
                    words.append(colour)
                print(number, *words, flush=True)
        except Refused as refused:
            print(f"refused {refused.kind}", flush=True)
            print(refused, file=sys.stderr)
        except MemoryError:
            print("refused limit", flush=True)


if __name__ == "__main__":
    main()
