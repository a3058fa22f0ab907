// Streams taken apart, as tests need it.

import { Decoder } from '../src/wasm.js';

/**
 * A frame's packet.
 * @typedef {object} FramePacket
 * @property {number} at Where it begins in the stream.
 * @property {boolean} keyframe
 * @property {Uint8Array} bytes Header and payload.
 */

/**
 * The first bytes of a stream.
 * @param {Uint8Array} stream
 */
export function streamHeader(stream) {
  return stream.subarray(0, Decoder.STREAM_HEADER_BYTES);
}

/**
 * The frames of a stream, one after the other up to the index or the end.
 * @param {Decoder} decoder that the stream was opened with
 * @param {Uint8Array} stream
 * @returns {FramePacket[]}
 */
export function packetsByWalking(decoder, stream) {
  const packets = [];
  let at = Decoder.STREAM_HEADER_BYTES;
  while (at < stream.length) {
    const { kind, bytes, end } = packetAt(decoder, stream, at);
    if (kind === 'index') {
      break;
    }
    if (kind !== 'unknown') packets.push({ at, keyframe: kind === 'keyframe', bytes });
    at = end;
  }
  return packets;
}

/**
 * The frames of a stream by its index.
 * @param {Decoder} decoder
 * @param {Uint8Array} stream
 * @returns {FramePacket[]}
 */
export function packetsByIndex(decoder, stream) {
  const trailer = stream.subarray(stream.length - Decoder.TRAILER_BYTES);
  const indexAt = decoder.parseTrailer(trailer);
  if (indexAt === undefined) {
    throw new Error('the stream has no trailer');
  }
  const { offsets, keyframes } = decoder.parseIndex(packetAt(decoder, stream, indexAt).bytes, indexAt);
  return Array.from(offsets, (at, frame) => {
    return { at, keyframe: keyframes[frame] === 1, bytes: packetAt(decoder, stream, at).bytes };
  });
}

/**
 * @param {Decoder} decoder
 * @param {Uint8Array} stream
 * @param {number} at
 */
function packetAt(decoder, stream, at) {
  const payloadAt = at + Decoder.PACKET_HEADER_BYTES;
  const { kind, payloadBytes } = decoder.parsePacketHeader(stream.subarray(at, payloadAt), at);
  const end = payloadAt + payloadBytes;
  return { kind, bytes: stream.subarray(at, end), end };
}
