import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Gops } from '../src/gops.js';

/** @param {string} frames K for each keyframe */
const gops = (frames) => new Gops([...frames].map((kind) => (kind === 'K' ? 1 : 0)));

test('a frame is decoded from the keyframe before it', () => {
  const { keyframes, ...rest } = gops('..K...K..');
  assert.deepEqual([...keyframes], [2, 6]);
  assert.equal(rest.frames, 9);
  const of = gops('..K...K..');
  assert.deepEqual(
    [0, 1, 2, 5, 6, 8].map((frame) => of.keyframeOf(frame)),
    [-1, -1, 2, 2, 6, 6],
  );
  assert.deepEqual(
    [0, 2, 5, 6, 8].map((frame) => of.keyframeAfter(frame)),
    [2, 6, 6, 9, 9],
  );
});

test('runs are whole GOPs of eight frames or more', () => {
  const of = gops('K.K.K.K.K.K.K.K.K.');
  assert.deepEqual([...of.runs], [0, 8, 16]);
  assert.equal(of.runOf(15), 8);
  assert.equal(of.runEnd(15), 16);
  assert.equal(of.runEnd(17), 18);
});

test('long GOPs are a run each', () => {
  const of = gops('K.........K.........');
  assert.deepEqual([...of.runs], [0, 10]);
});

test('nothing can be decoded without a keyframe', () => {
  assert.equal(gops('...').runOf(1), -1);
  assert.equal(gops('').frames, 0);
});
