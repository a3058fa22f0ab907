// A take of one depth camera at the origin, which looks along +z with y down: a wall with a bump.

import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { deflateSync } from 'node:zlib';

const WIDTH = 160;
const HEIGHT = 120;
const FOCAL = 140;

/** Writes a frame into a folder, in the layout of `camera.json`. @param {string} folder */
export function writeDepthTake(folder) {
  const identity = [0, 1, 2, 3].map((row) => [0, 1, 2, 3].map((column) => Number(row === column)));
  const camera = { width: WIDTH, height: HEIGHT, fx: FOCAL, fy: FOCAL, cx: WIDTH / 2, cy: HEIGHT / 2, poses: [identity] };
  writeFileSync(join(folder, 'camera.json'), JSON.stringify(camera));
  mkdirSync(join(folder, 'depth'));
  writeFileSync(join(folder, 'depth', '0.png'), png());
}

/** Depth in mm. @param {number} x @param {number} y */
function depth(x, y) {
  const bump = Math.max(0, 1 - Math.hypot(x - 80, y - 60) / 40);
  return Math.round(1500 - 300 * Math.sqrt(bump));
}

/** Grey of 16 bits. */
function png() {
  const rows = Buffer.alloc(HEIGHT * (1 + 2 * WIDTH));
  for (let y = 0; y < HEIGHT; y++)
    for (let x = 0; x < WIDTH; x++) rows.writeUInt16BE(depth(x, y), y * (1 + 2 * WIDTH) + 1 + 2 * x);
  const header = Buffer.alloc(13);
  header.writeUInt32BE(WIDTH, 0);
  header.writeUInt32BE(HEIGHT, 4);
  header[8] = 16;
  const chunks = [chunk('IHDR', header), chunk('IDAT', deflateSync(rows)), chunk('IEND', Buffer.alloc(0))];
  return Buffer.concat([Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]), ...chunks]);
}

/** @param {string} kind @param {Buffer} data */
function chunk(kind, data) {
  const body = Buffer.concat([Buffer.from(kind, 'latin1'), data]);
  const [length, check] = [Buffer.alloc(4), Buffer.alloc(4)];
  length.writeUInt32BE(data.length);
  check.writeUInt32BE(crc32(body));
  return Buffer.concat([length, body, check]);
}

/** @param {Buffer} bytes */
function crc32(bytes) {
  let crc = 0xffff_ffff;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit++) crc = crc & 1 ? (crc >>> 1) ^ 0xedb8_8320 : crc >>> 1;
  }
  return ~crc >>> 0;
}
