"""Sections 5 and 6: container and syntax."""

import struct
import zlib
from dataclasses import dataclass, field

from conventions import clamp
from refusal import Refused, malformed_if

MAGIC = bytes.fromhex("89 49 53 56 0D 0A 1A 0A")
PAPER, MAIN = 0, 1


class Reader:
    """The bytes of a stream, from its beginning, without seeking (5.4)."""

    def __init__(self, file):
        self.file, self.at = file, 0

    def up_to(self, count):
        """`count` bytes, or as many as there are. Memory is taken for bytes that are there, whatever `count` says."""
        taken = bytearray()
        while len(taken) < count and (piece := self.file.read(min(count - len(taken), 2**20))):
            taken += piece
        self.at += len(taken)
        return bytes(taken)

    def take(self, count):
        taken = self.up_to(count)
        if len(taken) < count:
            raise Refused("cut", f"{len(taken)} of {count} bytes")
        return taken


def check_crc(stored, *parts):
    """5.5; CRC-32 is that of zlib."""
    crc = 0
    for part in parts:
        crc = zlib.crc32(part, crc)
    if crc != stored:
        raise Refused("damaged", f"checksum {stored:08x}, but the bytes have {crc:08x}")


@dataclass
class StreamHeader:
    version: int
    profile: int
    colour_layers: int
    masks_by_cell: bool
    edge: int
    mu_codes: int
    coefficients: int                                 # K
    dc_step: int
    ac_step: int


def read_stream_header(reader):
    """6.1"""
    data = reader.up_to(48)
    if data[:8] != MAGIC[: len(data)]:
        raise Refused("foreign", "no magic")
    version = int.from_bytes(data[8:10], "little")
    if len(data) >= 10 and version not in (1, 2):
        raise Refused("unsupported", f"version {version}")
    if len(data) < 48:
        raise Refused("cut", "stream header")
    check_crc(struct.unpack("<I", data[44:])[0], data[:44])
    (length, profile, edge_log2, truncation, layers_and_masks, voxel_nm, numerator, denominator,
     coefficients, reserved, dc_step, ac_step) = struct.unpack("<HBBBBQIIHHII", data[10:44])
    malformed_if(length != 48, "length of the stream header")
    if profile not in (PAPER, MAIN):
        raise Refused("unsupported", f"profile {profile}")
    malformed_if(not 2 <= truncation <= 16, "truncation")
    malformed_if(layers_and_masks > (7 if version == 2 and profile == MAIN else 0), "layers of colour or coding of masks")
    malformed_if(reserved, "reserved fields of the stream header")
    malformed_if(not 10**3 <= voxel_nm <= 10**12, "voxel size")
    malformed_if(numerator == 0 or denominator == 0, "frame rate")
    if profile == PAPER:
        malformed_if(not 2 <= edge_log2 <= 4, "edge")
        malformed_if(not 1 <= coefficients <= 8**edge_log2, "coefficients")
        malformed_if(not 1 <= dc_step <= 2**20 or not 1 <= ac_step <= 2**20, "quantizer step")
    else:
        malformed_if(edge_log2 != 3, "edge")
        malformed_if(coefficients or dc_step or ac_step, "reserved fields of the stream header")
        coefficients = 162
    colour_layers, masks_by_cell = layers_and_masks & 3, layers_and_masks & 4 != 0
    return StreamHeader(version, profile, colour_layers, masks_by_cell, 2**edge_log2, 256 * truncation, coefficients,
                        dc_step, ac_step)


@dataclass
class Packet:
    keyframe: bool
    has_hash: bool
    since_keyframe: int
    payload: bytes
    has_colour: bool


def read_frame_packets(reader, header):
    """5.1 to 5.4 and 6.2: the frame packets of a stream. Returns at its end."""
    while True:
        at = reader.at
        data = reader.up_to(24)
        if not data:
            return
        if len(data) < 24:
            raise Refused("cut", "packet header")
        magic, kind, flags, since_keyframe, payload_bytes, _timestamp, crc = struct.unpack("<4sBBHIQI", data)
        malformed_if(magic != b"ISVP", "magic of a packet")
        if payload_bytes > 2**30:
            raise Refused("limit", f"payload of {payload_bytes} bytes")
        payload = reader.take(payload_bytes)
        check_crc(crc, data[:20], payload)
        if kind not in (1, 2):
            pass_over(header, kind)
            continue
        if kind == 2:
            malformed_if(flags or since_keyframe, "reserved fields of an index packet")
            check_index(payload, at)
            read_trailer(reader, at)
            return
        malformed_if(flags > (7 if header.colour_layers > 0 else 3), "reserved flags of a frame packet")
        keyframe = flags & 1 == 1
        malformed_if(keyframe and since_keyframe != 0, "since_keyframe of a keyframe")
        yield Packet(keyframe, flags & 2 == 2, since_keyframe, payload, flags & 4 == 4)


def pass_over(header, kind):
    """5.2: a packet of an unknown type is skipped, or refused."""
    malformed_if(header.version == 1, f"packet type {kind}")
    if kind < 128:
        raise Refused("unsupported", f"packet type {kind}")


def check_index(payload, index_at):
    """6.5"""
    malformed_if(len(payload) % 8 != 0, "length of the index")
    least = 48
    for (entry,) in struct.iter_unpack("<Q", payload):
        offset = entry >> 1
        malformed_if(not least <= offset < index_at, "offset in the index")
        least = offset + 24


def read_trailer(reader, index_at):
    """6.6, and that nothing follows (5.3)."""
    data = reader.take(16)
    at, magic, crc = struct.unpack("<Q4sI", data)
    malformed_if(magic != b"ISVX", "magic of the trailer")
    check_crc(crc, data[:12])
    malformed_if(at != index_at, "offset of the index packet")
    malformed_if(reader.up_to(1) != b"", "bytes after the trailer")


class Payload:
    """The fields of a payload, in order."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, count):
        malformed_if(self.at + count > len(self.data), "the payload ends inside a field or segment")
        self.at += count
        return self.data[self.at - count : self.at]

    def u8(self):
        return self.take(1)[0]

    def varint(self):
        """6.3"""
        value = 0
        for i in range(5):
            byte = self.u8()
            value |= (byte & 127) << (7 * i)
            if byte < 128:
                malformed_if(value >= 2**32, "varint of more than 32 bits")
                return value
        raise Refused("malformed", "varint of more than 5 bytes")


@dataclass
class Frame:
    """The frame header and the segments. Fields that a frame does not have are 0 or None."""

    prediction: int = 0
    blocks: int = 0
    slices: int = 0
    step: int = 0
    filter: int = 0
    half_voxel_vectors: bool = False
    no_spatial_prediction: bool = False
    filter_limit: int = 0
    volume_hash: int = None
    block_set: bytes = b""
    masks: bytes = b""
    motion: list = field(default_factory=list)        # of each slice
    coefficients: list = field(default_factory=list)  # of each slice
    colour: bytes = None                              # the colour part

    def slice(self, s, blocks):
        """6.4: the blocks of slice s, of all that the block set holds."""
        q, r = divmod(len(blocks), self.slices)
        return blocks[s * q + min(s, r) : (s + 1) * q + min(s + 1, r)]


def block_limit(header):
    """Section 8: the limit on blocks that is this decoder's choice."""
    return 3 * 2**30 // header.edge**3


def split_payload(packet):
    """6.4: geometry part and colour part, which is None if there is none."""
    if not packet.has_colour:
        return packet.payload, None
    malformed_if(len(packet.payload) < 4, "the payload ends before the length of its colour part")
    parts, colour_bytes = packet.payload[:-4], int.from_bytes(packet.payload[-4:], "little")
    malformed_if(colour_bytes > len(parts), f"colour part of {colour_bytes} bytes")
    at = len(parts) - colour_bytes
    return parts[:at], parts[at:]


def parse_frame(header, packet):
    """6.4, and what 7.1 looks at after it."""
    geometry, colour = split_payload(packet)
    payload = Payload(geometry)
    frame = Frame(prediction=payload.u8(), colour=colour)
    known = (0, 1, 2, 3) if header.profile == PAPER else (0, 2, 6, 10)
    malformed_if(frame.prediction not in known, f"prediction {frame.prediction}")
    frame.blocks = payload.varint()
    frame.slices = payload.varint()
    malformed_if(frame.slices == 0, "no slices")
    if frame.slices > 256:
        raise Refused("limit", f"{frame.slices} slices")
    if header.profile == MAIN:
        frame.step = payload.varint()
        malformed_if(not 1 <= frame.step <= 2**20, "quantizer step")
        filter_and_vectors = payload.u8()
        frame.filter = filter_and_vectors & 63
        malformed_if(frame.filter > 25, "strength of the filter")
        frame.half_voxel_vectors = filter_and_vectors & 64 != 0
        frame.no_spatial_prediction = filter_and_vectors & 128 != 0
        if frame.filter > 0:
            frame.filter_limit = payload.u8()
    if packet.has_hash:
        frame.volume_hash = int.from_bytes(payload.take(8), "little")
    block_set_bytes, mask_bytes = payload.varint(), payload.varint()
    lengths = [(payload.varint(), payload.varint()) for _ in range(frame.slices)]
    frame.block_set = payload.take(block_set_bytes)
    frame.masks = payload.take(mask_bytes)
    for motion_bytes, coefficient_bytes in lengths:
        frame.motion.append(payload.take(motion_bytes))
        frame.coefficients.append(payload.take(coefficient_bytes))
    malformed_if(payload.at != len(payload.data), "the segments do not fill the geometry part")
    malformed_if(packet.keyframe and frame.prediction != 0, "prediction of a keyframe")
    check_limits(header, frame)
    return frame


def colour_sample_limit():
    """Section 8: the limit on samples of a frame's colour that is this decoder's choice."""
    return 2**27


@dataclass
class ColourPart:
    kind: int
    steps: tuple                                      # of Y, Cb and Cr
    slices: int
    colour_hash: int = None
    modes: list = field(default_factory=list)         # of each slice
    coefficients: list = field(default_factory=list)  # of each layer, of each slice


def parse_colour(data, layers):
    """6.7"""
    payload = Payload(data)
    kind = payload.u8()
    malformed_if(kind & 127 > 2, f"colour of kind {kind & 127}")
    steps = []
    for _ in range(2):
        steps.append(payload.varint())
        malformed_if(not 1 <= steps[-1] <= 65535, "quantizer step of colour")
    slices = payload.varint()
    malformed_if(slices == 0, "no slices of colour")
    if slices > 256:
        raise Refused("limit", f"{slices} slices of colour")
    part = ColourPart(kind & 127, (steps[0], steps[1], steps[1]), slices)
    if kind & 128:
        part.colour_hash = int.from_bytes(payload.take(8), "little")
    lengths = [[payload.varint() for _ in range(slices)] for _ in range(1 + layers)]
    part.modes, *part.coefficients = [[payload.take(length) for length in of_slices] for of_slices in lengths]
    malformed_if(payload.at != len(data), "the segments do not fill the colour part")
    return part


def check_limits(header, frame):
    """Section 8, as far as it goes by the frame header."""
    if frame.blocks > block_limit(header):
        raise Refused("limit", f"{frame.blocks} blocks")
    if header.profile == PAPER and frame.slices > clamp(65536 // header.coefficients, 1, 256):
        raise Refused("limit", f"{frame.slices} slices of {header.coefficients} coefficients")
