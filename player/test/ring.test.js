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

test('what frames share counts once, and does not push them out', () => {
  const ring = new Ring(30);
  const scene = { bytes: 100 };
  for (let frame = 0; frame < 4; frame++) ring.put(frame, { bytes: 5, batches: new Set([scene, { bytes: 5 }]) });
  assert.deepEqual([ring.bytes, ring.sharedBytes, ring.meanBytes, ring.limit], [120, 100, 5, 150]);
  ring.trim((frame) => frame);
  assert.equal(ring.size, 4);
  // Another keyframe: it shares nothing, and there is no room for both.
  ring.put(9, { bytes: 100 });
  ring.trim((frame) => frame);
  assert.deepEqual([...ring.numbers()].sort(), [0, 1, 2, 3]);
  for (let frame = 0; frame < 3; frame++) ring.drop(frame);
  assert.deepEqual([ring.bytes, ring.sharedBytes], [105, 0]);
  ring.drop(3);
  assert.deepEqual([ring.bytes, ring.meanBytes], [0, 0]);
});
