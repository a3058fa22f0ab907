import assert from 'node:assert/strict';
import { test } from 'node:test';
import { FrameTimes } from '../src/frame-times.js';

test('a frame is shown from its start until the next', () => {
  const times = new FrameTimes(Float64Array.of(0, 0.1, 0.5, 0.6));
  for (const [seconds, frame] of [
    [-1, 0],
    [0, 0],
    [0.09, 0],
    [0.1, 1],
    [0.499, 1],
    [0.5, 2],
    [0.6, 2],
    [99, 2],
  ])
    assert.equal(times.frameAt(seconds), frame, `at ${seconds}`);
  assert.deepEqual([times.frames, times.duration, times.last], [3, 0.6, 0.5]);
});

test('a time that was rounded to microseconds is that of its frame', () => {
  const times = FrameTimes.nominal(3000, 29.97);
  for (let frame = 0; frame < 3000; frame++)
    for (const digits of [6, 7]) assert.equal(times.frameAt(Number(times.starts[frame].toFixed(digits))), frame);
});

test('exact times pass as they are', () => {
  const times = new FrameTimes(Float64Array.of(0, 0.1, 0.5, 0.6));
  times.learn(0, 0);
  times.learn(1, 9e9);
  assert.equal(times.advance(0.05, 0.3), 0.35);
});

test('a frame of a stream stays as long as its packets say', () => {
  const times = FrameTimes.nominal(4, 10);
  // 0.3 s, 0.05 s, and then what the rate says.
  for (const [frame, ms] of [
    [0, 1000],
    [1, 1300],
    [2, 1350],
  ])
    times.learn(frame, ms * 1e6);
  for (const [passed, frame] of [
    [0.29, 0],
    [0.31, 1],
    [0.345, 1],
    [0.355, 2],
    [0.44, 2],
    [0.46, 3],
  ])
    assert.equal(times.frameAt(times.advance(0, passed)), frame, `after ${passed}`);
  let at = 0;
  for (let tick = 0; tick < 31; tick++) at = times.advance(at, 0.01);
  assert.equal(times.frameAt(at), 1, 'tick by tick it is the same');
  assert.ok(times.advance(0, 5) > times.duration);
});

test('timestamps that go back or far ahead are not believed', () => {
  const times = FrameTimes.nominal(3, 10);
  times.learn(0, 5e9);
  times.learn(1, 1e9);
  times.learn(2, 1e18);
  assert.equal(times.frameAt(times.advance(0, 0.15)), 1);
  assert.equal(times.frameAt(times.advance(0, 0.25)), 2);
});
