import assert from 'node:assert/strict';
import { test } from 'node:test';
import { facingOf } from '../src/facing.js';

/** A grid of triangles in a plane of z, seen counter-clockwise from +z, or from -z if turned. @param {number} side @param {boolean} [turned] */
function plane(side, turned = false) {
  const positions = [];
  const indices = [];
  for (let y = 0; y <= side; y++) for (let x = 0; x <= side; x++) positions.push(x, y, 2);
  for (let y = 0; y < side; y++)
    for (let x = 0; x < side; x++) {
      const a = y * (side + 1) + x;
      const [b, c, d] = [a + 1, a + side + 1, a + side + 2];
      indices.push(...(turned ? [a, c, b, b, c, d] : [a, b, c, b, d, c]));
    }
  return { positions: Float32Array.from(positions), indices: Uint32Array.from(indices) };
}

/** A tetrahedron. */
const closed = {
  positions: Float32Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1),
  indices: Uint32Array.of(0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3),
};

test('an open surface is seen from the side of its front faces', () => {
  assert.deepEqual(facingOf(plane(4)), [0, 0, 1]);
  assert.deepEqual(facingOf(plane(4, true)), [0, 0, -1], 'as a depth camera at the origin sees it, looking along +z');
});

test('a large surface is looked at in part, with the same result', () => {
  const facing = facingOf(plane(700));
  assert.deepEqual(facing, [0, 0, 1]);
});

test('a closed surface, and none, has no side', () => {
  assert.equal(facingOf(closed), null);
  assert.equal(facingOf({ positions: new Float32Array(), indices: new Uint32Array() }), null);
  // A closed surface with a hole as large as open soles are of a person.
  const holed = { ...closed, indices: closed.indices.slice(0, 9) };
  assert.notEqual(facingOf(holed), null, 'a quarter of a tetrahedron is a large hole');
});
