"""What the tests share: the decoder's modules, the document and the conformance streams."""

import importlib.util
import sys
import zlib
from pathlib import Path

FOLDER = Path(__file__).resolve().parent.parent
DOCUMENT = (FOLDER.parent / "format.md").read_text()
CONFORMANCE = FOLDER.parent.parent.parent / "conformance"
sys.path.insert(0, str(FOLDER))


def load_command():
    """`__main__.py` of the decoder as a module."""
    spec = importlib.util.spec_from_file_location("reference_decoder", FOLDER / "__main__.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def block_of_document(first_words):
    """The indented or fenced text of the document that begins with these words, to the end of its block."""
    return DOCUMENT[DOCUMENT.index(first_words) :].split("```")[0]


def packets_of(stream):
    """(at, end) of the packets of a well-formed stream, its trailer left out."""
    at, found = 48, []
    while stream[at : at + 4] == b"ISVP":
        end = at + 24 + int.from_bytes(stream[at + 8 : at + 12], "little")
        found.append((at, end))
        at = end
    return found


def with_checksum_of_packet(packet):
    """The packet, its checksum made to fit."""
    crc = zlib.crc32(packet[24:], zlib.crc32(packet[:20]))
    return packet[:20] + crc.to_bytes(4, "little") + packet[24:]


def with_checksum_of_header(header):
    """The 48 bytes of a stream header, their checksum made to fit."""
    return header[:44] + zlib.crc32(header[:44]).to_bytes(4, "little")


def frame_packet(payload, keyframe, since_keyframe):
    """A frame packet without a volume hash."""
    header = b"ISVP\1" + bytes([keyframe]) + since_keyframe.to_bytes(2, "little") + len(payload).to_bytes(4, "little")
    return with_checksum_of_packet(header + bytes(12) + payload)
