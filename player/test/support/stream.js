// Streams made longer: whole GOPs one after another, with new timestamps, checksums and index (docs/spec/format.md, 5 and 6).

import { crc32 } from 'node:zlib';

const HEADER = 48;
const PACKET_HEADER = 24;

/** Frame packets of a stream, taken apart. @param {Uint8Array} stream @returns {Uint8Array[]} */
export function packetsOf(stream) {
  const view = new DataView(stream.buffer, stream.byteOffset, stream.byteLength);
  const packets = [];
  for (let at = HEADER; at + PACKET_HEADER <= stream.length && stream[at + 4] !== 2;) {
    const end = at + PACKET_HEADER + view.getUint32(at + 8, true);
    if (stream[at + 4] === 1) packets.push(stream.subarray(at, end));
    at = end;
  }
  return packets;
}

/**
 * A stream played several times over, as one stream.
 * @param {Uint8Array} stream that begins with a keyframe
 * @param {number} frames of the new one
 * @param {{ indexed?: boolean, gop?: number }} [options] whether it has an index; frames after which it starts over, all if not given
 * @returns {Uint8Array}
 */
export function repeated(stream, frames, { indexed = true, gop } = {}) {
  const packets = packetsOf(stream).slice(0, gop);
  const header = Buffer.from(stream.subarray(0, HEADER));
  const nsAFrame = (1e9 * header.readUInt32LE(28)) / header.readUInt32LE(24);
  const parts = [header];
  const index = Buffer.alloc(8 * frames);
  let at = HEADER;
  for (let frame = 0; frame < frames; frame++) {
    const packet = Buffer.from(packets[frame % packets.length]);
    packet.writeBigUInt64LE(BigInt(Math.round(frame * nsAFrame)), 12);
    sign(packet);
    index.writeBigUInt64LE((BigInt(at) << 1n) | BigInt(packet[5] & 1), 8 * frame);
    parts.push(packet);
    at += packet.length;
  }
  if (indexed) parts.push(...ending(index, at));
  return Buffer.concat(parts);
}

/** A packet of metadata. @param {unknown} said */
export function metadataPacket(said) {
  const payload = Buffer.from(JSON.stringify(said));
  const packet = Buffer.concat([Buffer.alloc(PACKET_HEADER), payload]);
  packet.write('ISVP', 0, 'latin1');
  packet[4] = 0x80;
  packet.writeUInt32LE(payload.length, 8);
  sign(packet);
  return packet;
}

/** A stream with a packet before its first frame. @param {Uint8Array} stream @param {Uint8Array} packet @param {{ indexed?: boolean }} [options] */
export function withMetadata(stream, packet, { indexed = true } = {}) {
  const packets = packetsOf(stream);
  const index = Buffer.alloc(8 * packets.length);
  let at = HEADER + packet.length;
  packets.forEach((frame, number) => {
    index.writeBigUInt64LE((BigInt(at) << 1n) | BigInt(frame[5] & 1), 8 * number);
    at += frame.length;
  });
  return Buffer.concat([stream.subarray(0, HEADER), packet, ...packets, ...(indexed ? ending(index, at) : [])]);
}

/** Index packet and trailer. @param {Buffer} index its payload @param {number} at where it begins */
export function ending(index, at) {
  const packet = Buffer.concat([Buffer.alloc(PACKET_HEADER), index]);
  packet.write('ISVP', 0, 'latin1');
  packet[4] = 2;
  packet.writeUInt32LE(index.length, 8);
  sign(packet);
  const trailer = Buffer.alloc(16);
  trailer.writeBigUInt64LE(BigInt(at));
  trailer.write('ISVX', 8, 'latin1');
  trailer.writeUInt32LE(crc32(trailer.subarray(0, 12)), 12);
  return [packet, trailer];
}

/** Writes a packet's checksum. @param {Buffer} packet */
function sign(packet) {
  packet.writeUInt32LE(crc32(packet.subarray(PACKET_HEADER), crc32(packet.subarray(0, 20))), 20);
}
