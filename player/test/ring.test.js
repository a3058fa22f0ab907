import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Ring } from '../src/ring.js';

test('the farthest go first, and only as many as need be', () => {
  const ring = new Ring(30);
  for (let frame = 0; frame < 5; frame++) ring.put(frame, { bytes: 10 });
  ring.trim((frame) => Math.abs(frame - 3));
  assert.deepEqual([...ring.numbers()].sort(), [2, 3, 4]);
  assert.equal(ring.bytes, 30);
});

test('the nearest stays, however large it is', () => {
  const ring = new Ring(30);
  ring.put(7, { bytes: 100 });
  ring.put(8, { bytes: 100 });
  ring.trim((frame) => frame);
  assert.deepEqual([...ring.numbers()], [7]);
});

test('a frame put again counts once', () => {
  const ring = new Ring(30);
  ring.put(1, { bytes: 10 });
  ring.put(1, { bytes: 12 });
  assert.equal(ring.bytes, 12);
  assert.equal(ring.meanBytes, 12);
  ring.clear();
  assert.equal(ring.bytes, 0);
});
