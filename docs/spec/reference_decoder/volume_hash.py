"""Section 7.12: volume hash."""

import struct

import numpy as np

P1, P2, P3, P4, P5 = (0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5)
WORD = 2**64 - 1


def rotate(a, n):
    return (a << n | a >> (64 - n)) & WORD


def mix(accumulator, lane):
    return rotate((accumulator + lane * P2) & WORD, 31) * P1 & WORD


def xxh64(data):
    """XXH64 with seed 0, as in the xxHash specification."""
    at = 0
    if len(data) >= 32:
        a, b, c, d = (P1 + P2) & WORD, P2, 0, -P1 & WORD
        at = len(data) // 32 * 32
        for lanes in struct.iter_unpack("<4Q", data[:at]):
            a, b, c, d = mix(a, lanes[0]), mix(b, lanes[1]), mix(c, lanes[2]), mix(d, lanes[3])
        h = (rotate(a, 1) + rotate(b, 7) + rotate(c, 12) + rotate(d, 18)) & WORD
        for accumulator in (a, b, c, d):
            h = ((h ^ mix(0, accumulator)) * P1 + P4) & WORD
    else:
        h = P5
    h = (h + len(data)) & WORD
    while at + 8 <= len(data):
        h = (rotate(h ^ mix(0, int.from_bytes(data[at : at + 8], "little")), 27) * P1 + P4) & WORD
        at += 8
    if at + 4 <= len(data):
        h = (rotate(h ^ int.from_bytes(data[at : at + 4], "little") * P1 & WORD, 23) * P2 + P3) & WORD
        at += 4
    for byte in data[at:]:
        h = rotate(h ^ byte * P5 & WORD, 11) * P1 & WORD
    h = (h ^ h >> 33) * P2 & WORD
    h = (h ^ h >> 29) * P3 & WORD
    return h ^ h >> 32


def volume_hash(volume):
    data = bytearray()
    for b, samples in volume.samples.items():
        data += struct.pack("<3i", *b)
        data += samples.astype("<i2").tobytes()
        mask = volume.masks.get(b, b"")
        data += struct.pack("<I", sum(mask))
        if any(mask):
            data += np.packbits(np.frombuffer(mask, np.uint8), bitorder="little").tobytes()
    return xxh64(bytes(data))
