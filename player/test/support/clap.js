// A clap: a take that is small, and large for a moment at every second, and sound that clicks there.

import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { encoded } from './native.js';
import { repeated } from './stream.js';

/** Frames a second, and how many of each second are large. */
export const FPS = 30;
const LARGE = 3;
/** Metres from the middle to a corner. */
export const RADII = { small: 0.1, large: 0.4 };
/** Samples of sound a second. */
const RATE = 48_000;

/** A stream of so many seconds, with two keyframes a second. @param {number} seconds @returns {Uint8Array} */
export function clapStream(seconds) {
  const second = encoded(
    (folder) => {
      for (let frame = 0; frame < FPS; frame++)
        writeFileSync(join(folder, `${String(frame).padStart(2, '0')}.ply`), octahedron(frame < LARGE ? RADII.large : RADII.small));
    },
    ['--voxel', '2cm', '--gop', String(FPS / 2)],
  );
  return repeated(second, seconds * FPS);
}

/** A WAV file that clicks at each second. @param {number} seconds @returns {Buffer} */
export function clapSound(seconds) {
  const samples = Math.round(seconds * RATE);
  const wav = Buffer.alloc(44 + 2 * samples);
  wav.write('RIFF', 0, 'latin1');
  wav.writeUInt32LE(36 + 2 * samples, 4);
  wav.write('WAVEfmt ', 8, 'latin1');
  wav.writeUInt32LE(16, 16);
  wav.writeUInt16LE(1, 20);
  wav.writeUInt16LE(1, 22);
  wav.writeUInt32LE(RATE, 24);
  wav.writeUInt32LE(2 * RATE, 28);
  wav.writeUInt16LE(2, 32);
  wav.writeUInt16LE(16, 34);
  wav.write('data', 36, 'latin1');
  wav.writeUInt32LE(2 * samples, 40);
  for (let second = 0; second < seconds; second++)
    for (let at = 0; at < RATE / 100 && second * RATE + at < samples; at++)
      wav.writeInt16LE(Math.round(26_000 * Math.sin((2 * Math.PI * 1000 * at) / RATE)), 44 + 2 * (second * RATE + at));
  return wav;
}

/** @param {number} radius */
function octahedron(radius) {
  const corners = [0, 1, 2].flatMap((axis) => [1, -1].map((sign) => [0, 1, 2].map((other) => (other === axis ? sign * radius : 0))));
  const faces = [0, 1].flatMap((x) => [2, 3].flatMap((y) => [4, 5].map((z) => ((x + y + z) % 2 ? [x, y, z] : [x, z, y]))));
  const lines = ['ply', 'format ascii 1.0', `element vertex ${corners.length}`, ...['x', 'y', 'z'].map((axis) => `property float ${axis}`)];
  lines.push(`element face ${faces.length}`, 'property list uchar int vertex_indices', 'end_header');
  lines.push(...corners.map((corner) => corner.join(' ')), ...faces.map((face) => `3 ${face.join(' ')}`), '');
  return lines.join('\n');
}
