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

test('the two nearest stay, however large they are', () => {
  const ring = new Ring(30);
  for (const frame of [9, 7, 8]) ring.put(frame, { bytes: 100 });
  ring.trim((frame) => frame);
  assert.deepEqual([...ring.numbers()], [7, 8]);
});

test('a keyframe of a scene stays beside the frame before it, though they share nothing', () => {
  const ring = new Ring(30);
  const scenes = [{ bytes: 100 }, { bytes: 100 }];
  for (const frame of [8, 9, 10, 11]) ring.put(frame, { bytes: 5, batches: new Set([scenes[frame < 10 ? 0 : 1], { bytes: 5 }]) });
  ring.trim((frame) => Math.abs(frame - 9.1));
  assert.deepEqual([...ring.numbers()], [9, 10]);
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
  const frame = () => ({ bytes: 5, batches: new Set([scene, { bytes: 5 }]) });
  for (let number = 0; number < 4; number++) ring.put(number, frame());
  assert.deepEqual([ring.bytes, ring.largest, ring.limit, ring.room], [120, 105, 157.5, 52.5]);
  assert.equal(ring.meanBytes, 5);
  ring.trim((number) => number);
  assert.equal(ring.size, 4);
  // Another keyframe: it shares nothing, and there is no room for both.
  ring.put(9, { bytes: 100, batches: new Set([{ bytes: 100 }]) });
  ring.trim((number) => number);
  assert.deepEqual([...ring.numbers()].sort(), [0, 1, 2, 3]);
  for (let number = 0; number < 4; number++) ring.drop(number);
  assert.equal(ring.bytes, 0);
  ring.clear();
  assert.deepEqual([ring.limit, ring.largest], [30, 0]);
});

test('changes that live on in the next frame count against the bound', () => {
  const ring = new Ring(30);
  const scene = { bytes: 100 };
  let before = { bytes: 3 };
  for (let number = 0; number < 1000; number++) {
    const own = { bytes: 3 };
    ring.put(number, { bytes: 3, batches: new Set([scene, before, own]) });
    ring.trim((held) => number - held);
    before = own;
    assert.ok(ring.bytes < 170, `${ring.bytes} bytes`);
  }
  assert.ok(ring.size > 10 && ring.meanBytes > 2 && ring.meanBytes < 4, `${ring.size} frames of ${ring.meanBytes} bytes`);
});
