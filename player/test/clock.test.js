import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Clock } from '../src/clock.js';

/** A clock of ten frames at ten a second, started at time 0. */
function running() {
  const clock = new Clock({ fps: 10, frames: 10 });
  clock.play();
  clock.tick(0);
  return clock;
}

test('frames go by at the rate of the stream, times the speed', () => {
  const clock = running();
  clock.tick(250);
  assert.equal(clock.frame, 2);
  clock.speed = 2;
  clock.tick(450);
  assert.equal(clock.frame, 6);
});

test('asking twice for the same time moves once', () => {
  const clock = running();
  clock.tick(250);
  clock.tick(250);
  assert.equal(clock.position, 2.5);
});

test('a loop goes on with what is left over', () => {
  const clock = running();
  assert.equal(clock.tick(1150), 'wrapped');
  assert.ok(Math.abs(clock.position - 1.5) < 1e-9);
});

test('without a loop it stops on the last frame and starts over', () => {
  const clock = running();
  clock.loop = false;
  assert.equal(clock.tick(5000), 'ended');
  assert.equal(clock.frame, 9);
  assert.equal(clock.playing, false);
  clock.play();
  assert.equal(clock.frame, 0);
});

test('it waits before a frame that is not there and goes on when it is', () => {
  const clock = running();
  let missing = 3;
  clock.gates.add(() => missing);
  clock.tick(200);
  assert.equal(clock.waitingSince, null);
  clock.tick(400);
  clock.tick(900);
  assert.equal(clock.frame, 2);
  assert.equal(clock.waitingSince, 400);
  missing = Infinity;
  clock.tick(910);
  assert.equal(clock.frame, 3, 'the frame it waited for comes at once');
  assert.equal(clock.waitingSince, null);
});

test('a wait is not caught up', () => {
  const clock = running();
  let missing = 1;
  clock.gates.add(() => missing);
  clock.tick(800);
  missing = Infinity;
  clock.tick(900);
  assert.equal(clock.frame, 1);
});

test('of several gates the first counts', () => {
  const clock = running();
  clock.gates.add(() => 5);
  clock.gates.add(() => 2);
  clock.tick(900);
  assert.equal(clock.frame, 1);
});

test('seeking stays within the take', () => {
  const clock = new Clock({ fps: 10, frames: 10 });
  for (const [asked, got] of [
    [4, 4],
    [-3, 0],
    [99, 9],
    [Infinity, 0],
    [NaN, 0],
    [2.7, 2],
  ]) {
    clock.seek(asked);
    assert.equal(clock.frame, got, `seek(${asked})`);
  }
});

test('pausing stays on the frame that is seen', () => {
  const clock = running();
  clock.tick(370);
  clock.pause();
  clock.tick(900);
  assert.equal(clock.position, 3);
});

test('speeds are above nothing', () => {
  const clock = new Clock();
  for (const speed of [0, -1, NaN]) assert.throws(() => (clock.speed = speed), RangeError);
});
