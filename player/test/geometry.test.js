import assert from 'node:assert/strict';
import { test } from 'node:test';
import { skipUnless } from './support/need.js';

/** @type {typeof import('../src/moving-geometry.js') | null} */
const moving = await import('../src/moving-geometry.js').catch(() => null);
const skip = skipUnless(moving !== null, 'browser', 'three is not installed', 'geometry.test.js');
const { EdgeGeometry } = moving ? await import('../src/edge-geometry.js') : { EdgeGeometry: null };
const { VertexBits } = moving ? await import('../src/vertex-bits.js') : { VertexBits: null };

/** A surface of some vertices. @param {number} vertices @returns {any} */
const surface = (vertices) => ({
  positions: new Float32Array(3 * vertices).fill(vertices),
  normals: new Float32Array(3 * vertices),
  colours: new Uint8Array(0),
  indices: new Uint32Array(3 * vertices),
  bounds: [0, 0, 0, 1, 1, 1],
});

/** Names of attributes whose buffers were freed, each time that buffers were. @param {import('three').BufferGeometry} geometry */
function freed(geometry) {
  /** @type {string[][]} */
  const names = [];
  geometry.addEventListener('dispose', () => names.push(Object.keys(geometry.attributes)));
  return names;
}

// three.js frees the buffers of all attributes of a geometry, and does not notice that another geometry uses them too.
test("lines of edges never free the surface's vertices", { skip }, () => {
  const geometry = new /** @type {any} */ (moving).MovingGeometry();
  const edges = new /** @type {any} */ (EdgeGeometry)();
  const names = freed(edges);
  for (const vertices of [10, 100]) {
    geometry.show(surface(vertices));
    edges.show(geometry, surface(vertices).indices);
    assert.equal(edges.getAttribute('position'), geometry.getAttribute('position'));
  }
  edges.dispose();
  assert.deepEqual(names, [[], [], []]);
});

test("bits beside a surface leave its buffers alone, and go with them", { skip }, () => {
  const geometry = new /** @type {any} */ (moving).MovingGeometry();
  const bits = new /** @type {any} */ (VertexBits)();
  geometry.show(surface(100));
  const names = freed(geometry);
  bits.show(geometry, new Float32Array(100).fill(3));
  assert.equal(geometry.getAttribute('bits').array[99], 3);
  assert.deepEqual(names, []);
  geometry.show(surface(101));
  assert.notEqual(geometry.getAttribute('bits'), undefined, 'there is room');
  geometry.show(surface(1000));
  assert.equal(geometry.getAttribute('bits'), undefined);
  assert.deepEqual(names, [['position', 'normal', 'bits']]);
  bits.show(geometry, null);
  assert.equal(geometry.getAttribute('bits').count, geometry.getAttribute('position').count);
});

test('colours are there where a stream has any, and grow with the surface', { skip }, () => {
  const geometry = new /** @type {any} */ (moving).MovingGeometry();
  geometry.show(surface(100));
  assert.equal(geometry.hasAttribute('srgb'), false);
  const coloured = (/** @type {number} */ vertices) => ({ ...surface(vertices), colours: new Uint8Array(3 * vertices).fill(vertices) });
  geometry.show(coloured(101));
  const held = geometry.getAttribute('srgb');
  assert.deepEqual([held.count, held.itemSize, held.normalized], [125, 3, true]);
  assert.equal(held.array[3 * 101 - 1], 101);
  geometry.show(coloured(90));
  assert.equal(geometry.getAttribute('srgb'), held, 'the same buffer is written again');
  assert.deepEqual([held.array[0], geometry.reallocations], [90, 1]);
  geometry.show(coloured(200));
  assert.equal(geometry.getAttribute('srgb').count, geometry.getAttribute('position').count);
  geometry.show(surface(200));
});
