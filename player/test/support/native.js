// What the native program makes of the same streams.

import { execFileSync, spawn } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { inflateSync } from 'node:zlib';
import { writeBlob } from './blob.js';
import { writeDepthTake } from './depth-take.js';
import { writeScene } from './scene.js';

/** The program: the environment's `ISV_BIN`, or none. */
export const ISV_BIN = process.env.ISV_BIN && existsSync(process.env.ISV_BIN) ? resolve(process.env.ISV_BIN) : null;

/** Runs the program in a folder that is gone afterwards. @template T @param {(folder: string) => T} use @returns {T} */
function inFolder(use) {
  const folder = mkdtempSync(join(tmpdir(), 'isv-player-'));
  try {
    return use(folder);
  } finally {
    rmSync(folder, { recursive: true });
  }
}

/** @param {string[]} words @param {string} folder */
function isv(words, folder) {
  if (!ISV_BIN) throw new Error('ISV_BIN names no program');
  execFileSync(ISV_BIN, words, { cwd: folder, stdio: ['ignore', 'ignore', 'pipe'] });
}

/** A stream of files. @param {(folder: string) => void} write @param {string[]} words options of `isv encode` @returns {Uint8Array} */
export function encoded(write, words) {
  return inFolder((folder) => {
    write(folder);
    isv(['encode', '.', '-o', 'out.isv', ...words], folder);
    return readFileSync(join(folder, 'out.isv'));
  });
}

/** A stream of a blob that moves, with one keyframe or more. @param {number} frames @param {{ paint?: import('./blob.js').Paint, gop?: number }} [options] @returns {Uint8Array} */
export function blobStream(frames, { paint, gop = frames } = {}) {
  return encoded((folder) => writeBlob(folder, frames, paint), ['--voxel', '1cm', '--gop', String(gop), '--checksums']);
}

/** A frame of a ball of more than 131,072 blocks, as coarse as that allows. @returns {Uint8Array} */
export function largeStream() {
  return encoded((folder) => writeBlob(folder, 1), ['--voxel', '1.1mm', '--backend', 'cpu']);
}

/** A stream of a scene that is shown in parts. @param {number} frames @returns {Uint8Array} */
export function sceneStream(frames) {
  const words = ['--voxel', '2cm', '--gop', String(frames), '--preset', 'realtime', '--backend', 'cpu'];
  return encoded((folder) => writeScene(folder, frames), words);
}

/** A stream of a depth camera's take. @returns {Uint8Array} */
export function depthStream() {
  return encoded(writeDepthTake, ['--voxel', '1cm', '--backend', 'cpu']);
}

/** A stream in MP4 with the sound of a WAV file. @param {Uint8Array} stream @param {Uint8Array} [wav] @returns {Uint8Array} */
export function muxed(stream, wav) {
  return inFolder((folder) => {
    if (wav) writeFileSync(join(folder, 'sound.wav'), wav);
    isv(['mux', fileOf(stream, folder), ...(wav ? ['--audio', 'sound.wav'] : []), '-o', 'take.mp4'], folder);
    return readFileSync(join(folder, 'take.mp4'));
  });
}

/** Files of a ladder of a stream, by name. @param {Uint8Array} stream @param {Uint8Array} wav @param {number} rungs @returns {Map<string, Uint8Array>} */
export function packaged(stream, wav, rungs) {
  return inFolder((folder) => {
    writeFileSync(join(folder, 'sound.wav'), wav);
    isv(['package', fileOf(stream, folder), '--audio', 'sound.wav', '-o', 'site', '--rungs', String(rungs)], folder);
    const site = join(folder, 'site');
    const names = readdirSync(site, { recursive: true, encoding: 'utf8' }).filter((name) => /\.(m3u8|mp4|m4s)$/.test(name));
    return new Map(names.map((name) => [name, readFileSync(join(site, name))]));
  });
}

/** Exports the player with a stream; gone when `use` is done. @template T @param {Uint8Array} stream @param {(folder: string) => Promise<T>} use @returns {Promise<T>} */
export async function exported(stream, use) {
  const folder = mkdtempSync(join(tmpdir(), 'isv-export-'));
  try {
    isv(['export-player', 'site', fileOf(stream, folder), '--up=-y', '--max-memory', '1GiB'], folder);
    return await use(join(folder, 'site'));
  } finally {
    rmSync(folder, { recursive: true });
  }
}

/**
 * The meshes that the program decodes, frame by frame.
 * @param {Uint8Array} stream
 * @returns {{ vertices: number, triangles: number, positions: Float32Array, colours: Uint8Array }[]} colours: empty without colour
 */
export function decodedMeshes(stream) {
  return inFolder((folder) => {
    isv(['decode', fileOf(stream, folder), '-o', 'meshes', '--format', 'ply'], folder);
    const meshes = [];
    for (let frame = 0; ; frame++) {
      const path = join(folder, 'meshes', `frame_${String(frame).padStart(4, '0')}.ply`);
      if (!existsSync(path)) return meshes;
      meshes.push(parsePly(readFileSync(path)));
    }
  });
}

/** A frame as the program draws it on nothing, by normals unless it is another look. @param {Uint8Array} stream @param {number} frame @param {number} size @param {number} yaw degrees @param {number} pitch degrees @param {string} [look] */
export function rendered(stream, frame, size, yaw, pitch, look = 'normals') {
  return inFolder((folder) => {
    const view = ['--size', String(size), '--yaw', String(yaw), '--pitch', String(pitch), '--background', 'transparent', '--shade', look];
    isv(['render', fileOf(stream, folder), '-o', 'picture.png', '--frame', String(frame), ...view], folder);
    return parsePng(readFileSync(join(folder, 'picture.png')));
  });
}

/** @param {Uint8Array} stream @param {string} folder */
function fileOf(stream, folder) {
  const path = join(folder, 'stream.isv');
  writeFileSync(path, stream);
  return path;
}

/** @param {Buffer} ply with float x, y, z first and colours last, if there are any, binary and little-endian */
function parsePly(ply) {
  const end = ply.indexOf('end_header\n') + 'end_header\n'.length;
  const header = ply.toString('latin1', 0, end);
  const count = (/** @type {string} */ what) => Number(new RegExp(`element ${what} (\\d+)`).exec(header)?.[1]);
  const vertices = count('vertex');
  const floats = 4 * [...header.matchAll(/property float /g)].length;
  const stride = floats + [...header.matchAll(/property uchar /g)].length;
  const positions = new Float32Array(3 * vertices);
  for (let at = 0; at < positions.length; at++) positions[at] = ply.readFloatLE(end + stride * Math.floor(at / 3) + 4 * (at % 3));
  const colours = new Uint8Array(stride > floats ? 3 * vertices : 0);
  for (let at = 0; at < colours.length; at++) colours[at] = ply[end + stride * Math.floor(at / 3) + floats + (at % 3)];
  return { vertices, triangles: count('face'), positions, colours };
}

/** @typedef {{ width: number, height: number, rgba: Uint8Array }} Pixels */

/** @param {Buffer} png 8 bits a channel, RGB or RGBA @returns {Pixels} */
export function parsePng(png) {
  let width = 0;
  let height = 0;
  let channels = 4;
  const parts = [];
  for (let at = 8; at < png.length; at += 12 + png.readUInt32BE(at)) {
    const length = png.readUInt32BE(at);
    const kind = png.toString('latin1', at + 4, at + 8);
    const data = png.subarray(at + 8, at + 8 + length);
    if (kind === 'IHDR') {
      width = data.readUInt32BE(0);
      height = data.readUInt32BE(4);
      channels = { 2: 3, 6: 4 }[data[9]] ?? 0;
      if (data[8] !== 8 || !channels || data[12]) throw new Error('a kind of PNG that tests do not read');
    }
    if (kind === 'IDAT') parts.push(data);
  }
  return { width, height, rgba: unfiltered(inflateSync(Buffer.concat(parts)), width, height, channels) };
}

/** @param {Uint8Array} rows with a filter each @param {number} width @param {number} height @param {number} channels */
function unfiltered(rows, width, height, channels) {
  const stride = width * channels;
  const bytes = new Uint8Array(stride * height);
  for (let y = 0; y < height; y++) {
    const filter = rows[y * (stride + 1)];
    for (let x = 0; x < stride; x++) {
      const left = x < channels ? 0 : bytes[y * stride + x - channels];
      const up = y ? bytes[(y - 1) * stride + x] : 0;
      const corner = y && x >= channels ? bytes[(y - 1) * stride + x - channels] : 0;
      const guess = [0, left, up, (left + up) >> 1, paeth(left, up, corner)][filter];
      bytes[y * stride + x] = rows[y * (stride + 1) + 1 + x] + guess;
    }
  }
  if (channels === 4) return bytes;
  return Uint8Array.from({ length: 4 * width * height }, (_, at) => (at % 4 === 3 ? 255 : bytes[(at >> 2) * 3 + (at % 4)]));
}

/** @param {number} left @param {number} up @param {number} corner */
function paeth(left, up, corner) {
  const guess = left + up - corner;
  const [a, b, c] = [left, up, corner].map((value) => Math.abs(guess - value));
  return a <= b && a <= c ? left : b <= c ? up : corner;
}

/** A stream of the first frames of a capture; null where there are no captures. @param {string} name @param {number} frames */
export function captureStream(name, frames) {
  const captures = process.env.ISV_DATA ?? fileURLToPath(new URL('../../../../shared/data', import.meta.url));
  const capture = join(captures, name);
  if (!existsSync(capture)) return null;
  return inFolder((folder) => {
    isv(['encode', capture, '-o', 'out.isv', '--voxel', '5mm', '--frames', `0..${frames}`], folder);
    return readFileSync(join(folder, 'out.isv'));
  });
}

/**
 * Serves streams by `isv view`.
 * @param {Uint8Array[]} streams one or two
 * @returns {Promise<{ url: string, close: () => void }>}
 */
export async function viewed(streams) {
  const folder = mkdtempSync(join(tmpdir(), 'isv-view-'));
  const paths = streams.map((stream, at) => {
    const path = join(folder, `${at}.isv`);
    writeFileSync(path, stream);
    return path;
  });
  const { url, close } = await serving(['view', '--no-open', '--port', '0', ...paths]);
  return {
    url,
    close: () => {
      close();
      rmSync(folder, { recursive: true });
    },
  };
}

/**
 * Runs the program as a server.
 * @param {string[]} words
 * @returns {Promise<{ url: string, close: () => void, stdin: import('node:stream').Writable, status: Promise<number | null> }>} once it says
 *   where its page is; `close` kills it, `status` is how it ended
 */
export async function serving(words) {
  if (!ISV_BIN) throw new Error('ISV_BIN names no program');
  const server = spawn(ISV_BIN, words);
  const status = new Promise((/** @type {(status: number | null) => void} */ ended) => server.on('exit', ended));
  const url = await new Promise((/** @type {(url: string) => void} */ found, reject) => {
    let said = '';
    const hear = (/** @type {Buffer} */ data) => {
      said += data;
      const match = /http:\/\/\S+/.exec(said);
      if (match) found(match[0]);
    };
    server.stdout.on('data', hear);
    server.stderr.on('data', hear);
    server.on('exit', () => reject(new Error(`isv ${words[0]} ended: ${said}`)));
  });
  return { url, close: () => server.kill('SIGKILL'), stdin: server.stdin, status };
}
