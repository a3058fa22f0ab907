// A closed surface that moves and looks the same from no two sides, as PLY files.

import { writeFileSync } from 'node:fs';
import { join } from 'node:path';

const RINGS = 48;
const SECTORS = 96;

/** 8-bit sRGB of a place of the surface, in metres, in a frame. @typedef {(frame: number, place: number[]) => number[]} Paint */

/** Writes frames into a folder. @param {string} folder @param {number} frames @param {Paint} [paint] colours of vertices, if there are to be any */
export function writeBlob(folder, frames, paint) {
  for (let frame = 0; frame < frames; frame++) {
    const painted = paint && ((/** @type {number[]} */ place) => paint(frame, place));
    writeFileSync(join(folder, `${String(frame).padStart(3, '0')}.ply`), blob(frame / 12, painted));
  }
}

/** @param {number} time in turns of its motion @param {(place: number[]) => number[]} [paint] */
function blob(time, paint) {
  const vertices = [0, 1, ...Array.from({ length: (RINGS - 1) * SECTORS }, (_, at) => at + 2)].map((at) => vertex(at, time));
  const triangles = [];
  const ring = (/** @type {number} */ r, /** @type {number} */ s) =>
    r === 0 ? 0 : r === RINGS ? 1 : 2 + (r - 1) * SECTORS + (s % SECTORS);
  for (let r = 0; r < RINGS; r++) {
    for (let s = 0; s < SECTORS; s++) {
      if (r > 0) triangles.push([ring(r, s), ring(r + 1, s), ring(r, s + 1)]);
      if (r < RINGS - 1) triangles.push([ring(r, s + 1), ring(r + 1, s), ring(r + 1, s + 1)]);
    }
  }
  const header = [
    'ply',
    'format binary_little_endian 1.0',
    `element vertex ${vertices.length}`,
    ...['x', 'y', 'z'].map((axis) => `property float ${axis}`),
    ...(paint ? ['red', 'green', 'blue'] : []).map((channel) => `property uchar ${channel}`),
    `element face ${triangles.length}`,
    'property list uchar int vertex_indices',
    'end_header\n',
  ];
  const faces = Buffer.alloc(13 * triangles.length);
  triangles.forEach((corners, at) => {
    faces[13 * at] = 3;
    corners.forEach((corner, c) => faces.writeInt32LE(corner, 13 * at + 1 + 4 * c));
  });
  const rows = vertices.map((place) => {
    const row = Buffer.from(Float32Array.from(place).buffer);
    return paint ? Buffer.concat([row, Buffer.from(paint(place))]) : row;
  });
  return Buffer.concat([Buffer.from(header.join('\n')), ...rows, faces]);
}

/** @param {number} at 0 and 1 are the poles @param {number} time @returns {number[]} x, y, z in metres, y up */
function vertex(at, time) {
  const polar = at === 0 ? 0 : at === 1 ? Math.PI : (Math.PI * (1 + Math.floor((at - 2) / SECTORS))) / RINGS;
  const around = at < 2 ? 0 : (2 * Math.PI * ((at - 2) % SECTORS)) / SECTORS;
  const turn = 2 * Math.PI * time;
  const bumps =
    0.12 * Math.sin(3 * around + turn) * Math.sin(polar) ** 2 + 0.15 * Math.cos(polar) + 0.1 * Math.sin(around) * Math.sin(polar);
  const radius = 0.4 * (1 + bumps);
  const flat = radius * Math.sin(polar);
  return [1.3 * flat * Math.sin(around) + 0.1 * Math.sin(turn), radius * Math.cos(polar) + 0.6, flat * Math.cos(around)];
}
