import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { UPS, isUp } from '../src/axes.js';
import { skipUnless } from './support/need.js';

/** @type {typeof import('../src/up.js') | null} */
const module = await import('../src/up.js').catch(() => null);
const skip = skipUnless(module !== null, 'browser', 'three is not installed', 'up.test.js');

test('each axis turns to y, and nothing is mirrored', { skip }, async () => {
  const { toYUp } = /** @type {typeof import('../src/up.js')} */ (module);
  const { Vector3 } = await import('three');
  assert.equal(UPS.length, 6);
  for (const up of UPS) {
    const axis = new Vector3();
    axis[/** @type {'x' | 'y' | 'z'} */ (up.slice(-1))] = up.startsWith('-') ? -1 : 1;
    assert.ok(axis.applyQuaternion(toYUp(up)).distanceTo(new Vector3(0, 1, 0)) < 1e-6, up);
    assert.ok(isUp(up));
  }
  assert.ok(!isUp('w') && !isUp(null) && !isUp('toString'));
});

test('the table is that of the library', { skip }, async () => {
  const { toYUp } = /** @type {typeof import('../src/up.js')} */ (module);
  const { Vector3 } = await import('three');
  const source = readFileSync(new URL('../../crates/apps/isv-take/src/up.rs', import.meta.url), 'utf8');
  const names = { y: 'Y', z: 'Z', x: 'X', '-y': 'MinusY', '-z': 'MinusZ', '-x': 'MinusX' };
  for (const up of UPS) {
    const rows = new RegExp(`Self::${names[up]} => \\[\\[(.*)\\]\\],`).exec(source);
    assert.ok(rows, up);
    const [a, b, c] = rows[1].split('], [').map((row) => new Vector3(.../** @type {[number, number, number]} */ (row.split(', ').map(Number))));
    const point = new Vector3(1, 2, 3);
    const expected = new Vector3(a.dot(point), b.dot(point), c.dot(point));
    assert.ok(point.clone().applyQuaternion(toYUp(up)).distanceTo(expected) < 1e-5, up);
  }
});
