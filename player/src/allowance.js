// The memory that a decoder may take: by default what the machine has room for, or what the user gives it.

import { IsvFailure } from './failure.js';

/** Bytes of WebAssembly memory for each voxel of a frame at the peak of decoding, with its surface, rounded up from 10.4. */
export const VOXEL_BYTES = 12;
/** More of them where a frame has colour at half voxels: 9 of a person at 5 mm, rounded up. */
export const COLOUR_BYTES = 12;
/** Most voxels of a frame: 524,288 blocks of 8. WebAssembly has 4 GiB of addresses. */
export const MOST_VOXELS = 1 << 28;
/** Voxels that every machine is trusted with: 131,072 blocks of 8. */
const LEAST_VOXELS = 1 << 26;
/** Memory of a machine whose browser does not tell, in GiB. */
const UNKNOWN_GIB = 4;
const GIB = 2 ** 30;
/** Names of units and their bytes. */
const UNITS = new Map([
  ['', 1],
  ['KB', 1e3],
  ['MB', 1e6],
  ['GB', 1e9],
  ['KIB', 2 ** 10],
  ['MIB', 2 ** 20],
  ['GIB', GIB],
]);

/**
 * What a decoder may take.
 * @typedef {object} Allowance
 * @property {number} bytes of all decoders of a player
 * @property {number} voxels of a frame
 * @property {number} [voxelBytes] bytes that a voxel takes; {@link VOXEL_BYTES} if not given
 * @property {boolean} trusted whether the user chose it: then a frame may take it however few bytes its stream has
 */

/**
 * The memory for decoding: half of the machine's, unless the user says otherwise.
 * @param {{ maxMemory?: number, voxels?: number }} [options] bytes, and most voxels of a frame
 * @param {{ deviceMemory?: number }} [machine] in GiB; browsers round it, to 8 at most
 * @returns {Allowance}
 */
export function allowanceOf({ maxMemory, voxels } = {}, machine = /** @type {{ deviceMemory?: number }} */ (globalThis.navigator)) {
  const half = ((machine?.deviceMemory ?? UNKNOWN_GIB) * GIB) / 2;
  const bytes = maxMemory ?? Math.max(half, LEAST_VOXELS * VOXEL_BYTES);
  const room = voxels ?? Math.floor(bytes / VOXEL_BYTES);
  return { bytes, voxels: Math.min(MOST_VOXELS, Math.max(1, room)), trusted: maxMemory !== undefined };
}

/**
 * The allowance of a stream: colour takes memory of its own.
 * @param {Allowance} allowance
 * @param {{ colour: boolean }} facts
 * @returns {Allowance}
 */
export function allowanceFor(allowance, { colour }) {
  if (!colour) return allowance;
  const voxelBytes = VOXEL_BYTES + COLOUR_BYTES;
  const room = Math.floor(Math.min(allowance.bytes, MOST_VOXELS * VOXEL_BYTES) / voxelBytes);
  return { ...allowance, voxelBytes, voxels: Math.max(1, Math.min(allowance.voxels, room)) };
}

/**
 * An amount of memory in words, such as `500MB` or `2GiB`, or in bytes.
 * @param {string} text
 * @returns {number} bytes
 */
export function parseMemory(text) {
  const match = /^(\d+(?:\.\d*)?|\.\d+)\s*([a-z]*)$/i.exec(text.trim());
  const bytes = match ? Number(match[1]) * (UNITS.get(match[2].toUpperCase()) ?? NaN) : NaN;
  if (bytes >= 1 && Number.isFinite(bytes)) return Math.floor(bytes);
  throw new IsvFailure('limit', `max-memory=${text} is no amount of memory: write 500MB or 2GiB`);
}

/**
 * Why a frame is refused, and what to do about it.
 * @param {number | null} frame null in a live stream
 * @param {number} blocks that it needs; 0 if that is not known
 * @param {number} blockSide voxels along an edge of a block
 * @param {Allowance} allowance
 * @returns {string} a sentence without a full stop
 */
export function refusal(frame, blocks, blockSide, { bytes, voxels: most, voxelBytes = VOXEL_BYTES }) {
  const which = frame === null ? 'the live stream' : `frame ${frame}`;
  if (!blocks) return `${which} needs more memory than this browser gives a decoder: larger voxels need less`;
  const voxels = blocks * blockSide ** 3;
  const needs = `${which} needs ${blocks.toLocaleString('en')} blocks, about ${amount(voxels * voxelBytes)}`;
  if (voxels * voxelBytes > MOST_VOXELS * VOXEL_BYTES) {
    const limit = amount(MOST_VOXELS * VOXEL_BYTES);
    return `${needs}, and a decoder in a browser can have ${limit}: larger voxels need less, and isv render and isv decode have no such limit`;
  }
  const enough = `${Math.ceil((voxels * voxelBytes) / 1e8) / 10}GB`;
  const advice = `isv view --max-memory ${enough}, or max-memory=${enough} in the page's address, allows it`;
  if (voxels <= most) return `${needs}, far more than so short a stream should need: if you trust it, ${advice}`;
  return `${needs}, and the player was given ${amount(Math.min(bytes, most * voxelBytes))}: ${advice}`;
}

/** @param {number} bytes */
function amount(bytes) {
  if (bytes < 999.5e3) return `${Math.max(1, Math.round(bytes / 1e3))} kB`;
  return bytes < 999.5e6 ? `${Math.round(bytes / 1e6)} MB` : `${(bytes / 1e9).toFixed(1)} GB`;
}
