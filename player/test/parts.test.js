import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { test } from 'node:test';
import { PartedSurface } from '../src/parts.js';
import { Decoder } from '../src/wasm.js';
import { skipUnless } from './support/need.js';

/** @type {typeof import('../src/moving-geometry.js') | null} */
const moving = await import('../src/moving-geometry.js').catch(() => null);
const skip = skipUnless(moving !== null, 'browser', 'three is not installed', 'parts.test.js');

/** The packets of the frames of a conformance stream. @param {Decoder} decoder @param {string} name */
async function packetsOf(decoder, name) {
  const bytes = new Uint8Array(await readFile(new URL(`../../conformance/${name}`, import.meta.url)));
  decoder.open(bytes.slice(0, Decoder.STREAM_HEADER_BYTES));
  const end = /** @type {number} */ (decoder.parseTrailer(bytes.slice(-Decoder.TRAILER_BYTES)));
  const { offsets } = decoder.parseIndex(bytes.slice(end, bytes.length - Decoder.TRAILER_BYTES), end);
  return [...offsets].map((at, frame) => bytes.slice(at, offsets[frame + 1] ?? end));
}

/** The frames of a stream, each as a whole and in parts. @param {string} name @returns {Promise<{ whole: any, frame: any }[]>} */
async function framesOf(name) {
  const [whole, parted] = await Promise.all([Decoder.create(), Decoder.create()]);
  await packetsOf(parted, name);
  const surface = new PartedSurface();
  const { boundsOf, boundsOfParts } = await import('../src/bounds.js');
  return (await packetsOf(whole, name)).map((packet) => {
    const decoded = parted.decode(packet, { normals: true, parts: 0 });
    const changes = decoded.changes && { ...decoded.changes, bounds: boundsOfParts(decoded.positions, decoded.changes) };
    const frame = surface.complete(/** @type {any} */ ({ ...decoded, changes, bytes: 4 * decoded.positions.length }));
    const all = whole.decode(packet, { normals: true });
    return { whole: { ...all, bounds: boundsOf(all.positions), parts: null }, frame };
  });
}

/**
 * The triangles of a mesh that have three corners, as text, sorted.
 * @param {ArrayLike<number>} positions @param {ArrayLike<number>} normals @param {ArrayLike<number>} indices
 */
function triangles(positions, normals, indices) {
  const corner = (/** @type {number} */ v) => [0, 1, 2].flatMap((axis) => [positions[3 * v + axis], normals[3 * v + axis]]).join();
  const texts = [];
  for (let at = 0; at < indices.length; at += 3) {
    const [a, b, c] = [indices[at], indices[at + 1], indices[at + 2]];
    if (a !== b && b !== c && c !== a) texts.push([a, b, c].map(corner).join(' '));
  }
  return texts.sort();
}

test('frames in parts have the surfaces of whole frames, and share what stands still', async () => {
  const frames = await framesOf('main_still_cells.isv');
  let shared = 0;
  for (const [number, { whole, frame }] of frames.entries()) {
    const own = [...frame.parts.values()].flatMap((part) => triangles(part.positions, part.normals, part.indices));
    assert.deepEqual(own.sort(), triangles(whole.positions, whole.normals, whole.indices), `frame ${number}`);
    assert.equal(frame.triangles, whole.indices.length / 3);
    assert.deepEqual(frame.bounds, whole.bounds);
    assert.equal(frame.positions.length, 0);
    if (number) for (const [key, part] of frame.parts) shared += Number(frames[number - 1].frame.parts.get(key) === part);
  }
  assert.ok(shared > 0);
});

test('a geometry draws the parts of the frame that it shows, whatever it showed before', { skip }, async () => {
  const geometry = new /** @type {any} */ (moving).MovingGeometry();
  const frames = [...(await framesOf('main_still_cells.isv')), ...(await framesOf('main_inter.isv'))];
  const shown = (/** @type {any} */ frame) => {
    geometry.show({ colours: new Uint8Array(0), ...frame });
    const { array } = geometry.getAttribute('position');
    return triangles(array, geometry.getAttribute('normal').array, geometry.drawn);
  };
  const order = [...frames.keys(), ...[...frames.keys()].reverse(), 0, frames.length - 1, 0];
  for (const number of order) {
    const { whole, frame } = frames[number];
    const expected = triangles(whole.positions, whole.normals, whole.indices);
    assert.deepEqual(shown(frame), expected, `frame ${number} in parts`);
    if (number % 3 === 0) assert.deepEqual(shown(whole), expected, `frame ${number} as a whole`);
  }
  assert.ok(geometry.reallocations < 6, `${geometry.reallocations} times new buffers`);
});

test('a scene without triangles is drawn as nothing', { skip }, async () => {
  const geometry = new /** @type {any} */ (moving).MovingGeometry();
  const [{ frame, whole }] = await framesOf('main_still_cells.isv');
  const colours = new Uint8Array(0);
  const nothing = { ...frame, colours, parts: new Map(), triangles: 0 };
  geometry.show(nothing);
  assert.equal(geometry.drawRange.count, 0);
  geometry.show({ ...whole, colours, positions: whole.normals.subarray(0, 0), normals: whole.normals.subarray(0, 0), indices: whole.indices.subarray(0, 0) });
  assert.equal(geometry.drawRange.count, 0);
  geometry.show({ ...frame, colours });
  assert.ok(geometry.drawRange.count > 0);
  geometry.show(nothing);
  const { drawn } = geometry;
  assert.ok(drawn.every((/** @type {number} */ index, /** @type {number} */ at) => index === drawn[at - (at % 3)]), 'no triangle has area');
});

test('ranges of a mesh that is not in view do not become more and more', { skip }, async () => {
  const geometry = new /** @type {any} */ (moving).MovingGeometry();
  const frames = await framesOf('main_still_cells.isv');
  const colours = new Uint8Array(0);
  const copy = (/** @type {any} */ frame) => new Map([...frame.parts].map(([key, part]) => [key, { ...part }]));
  for (let round = 0; round < 20_000; round += frames[0].frame.parts.size) geometry.show({ ...frames[0].frame, colours, parts: copy(frames[0].frame) });
  assert.ok(geometry.index.updateRanges.length <= 1 << 14);
});

test('of a frame that shares parts only what is new is uploaded', { skip }, async () => {
  const geometry = new /** @type {any} */ (moving).MovingGeometry();
  const [first, second] = await framesOf('main_still_cells.isv');
  geometry.show({ ...first.frame, colours: new Uint8Array(0) });
  const position = geometry.getAttribute('position');
  // As three.js does once they are on the GPU.
  for (const attribute of [position, geometry.getAttribute('normal'), geometry.index]) attribute.clearUpdateRanges();
  geometry.show({ ...second.frame, colours: new Uint8Array(0) });
  const uploaded = position.updateRanges.reduce((/** @type {number} */ sum, /** @type {any} */ range) => sum + range.count, 0);
  const changed = [...second.frame.parts].filter(([key, part]) => first.frame.parts.get(key) !== part);
  assert.equal(uploaded, changed.reduce((sum, [, part]) => sum + part.positions.length, 0));
  assert.ok(uploaded < 3 * geometry.getAttribute('position').count);
});
