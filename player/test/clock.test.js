import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Clock } from '../src/clock.js';

/** A clock of ten frames at ten a second, started at time 0. */
function running() {
  const clock = new Clock({ duration: 1, last: 0.9 });
  clock.play();
  clock.tick(0);
  return clock;
}

/** @param {number} is @param {number} expected @param {string} [message] */
function near(is, expected, message) {
  assert.ok(Math.abs(is - expected) < 1e-3, `${message ?? ''} ${is} is not ${expected}`);
}

test('time goes by, times the speed', () => {
  const clock = running();
  clock.tick(250);
  near(clock.seconds, 0.25);
  clock.speed = 2;
  clock.tick(450);
  near(clock.seconds, 0.65);
});

test('asking twice for the same time moves once', () => {
  const clock = running();
  clock.tick(250);
  clock.tick(250);
  assert.equal(clock.seconds, 0.25);
});

test('a loop goes on with what is left over', () => {
  const clock = running();
  clock.tick(600);
  assert.equal(clock.tick(1150), 'wrapped');
  near(clock.seconds, 0.15);
});

test('a take that nobody has looked at goes on where it was left', () => {
  const clock = new Clock({ duration: 1200, last: 1199.9 });
  clock.play();
  clock.tick(0);
  clock.tick(1000);
  near(clock.seconds, 1);
  clock.tick(301_000);
  near(clock.seconds, 2);
  clock.tick(301_016);
  near(clock.seconds, 2.016);
});

test('without a loop it stops on the last frame and starts over', () => {
  const clock = running();
  clock.loop = false;
  assert.equal(clock.tick(5000), 'ended');
  assert.equal(clock.seconds, 0.9);
  assert.equal(clock.playing, false);
  clock.play();
  assert.equal(clock.seconds, 0);
});

test('it waits before a frame that is not there and goes on when it is', () => {
  const clock = running();
  let missing = 0.3;
  clock.gates.add(() => missing);
  clock.tick(200);
  assert.equal(clock.waitingSince, null);
  clock.tick(400);
  clock.tick(900);
  assert.ok(clock.seconds < 0.3);
  assert.equal(clock.waitingSince, 400);
  missing = Infinity;
  clock.tick(910);
  assert.ok(clock.seconds >= 0.3, 'the frame it waited for comes at once');
  assert.equal(clock.waitingSince, null);
});

test('a wait is not caught up', () => {
  const clock = running();
  let missing = 0.1;
  clock.gates.add(() => missing);
  clock.tick(800);
  missing = Infinity;
  clock.tick(900);
  assert.ok(clock.seconds < 0.21, `${clock.seconds}`);
});

test('of several gates the first counts', () => {
  const clock = running();
  clock.gates.add(() => 0.5);
  clock.gates.add(() => 0.2);
  clock.tick(900);
  near(clock.seconds, 0.2);
});

test('seeking stays within the take', () => {
  const clock = new Clock({ duration: 1, last: 0.9 });
  for (const [asked, got] of [
    [0.4, 0.4],
    [-3, 0],
    [99, 0.9],
    [Infinity, 0],
    [NaN, 0],
  ]) {
    clock.seek(asked);
    assert.equal(clock.seconds, got, `seek(${asked})`);
  }
});

test('pausing stays where it is', () => {
  const clock = running();
  clock.tick(370);
  clock.pause();
  clock.tick(900);
  near(clock.seconds, 0.37);
});

test('speeds are above nothing', () => {
  const clock = new Clock();
  for (const speed of [0, -1, NaN]) assert.throws(() => (clock.speed = speed), RangeError);
});

/** What stands for sound. */
class FakeSound {
  /** @type {number | null} */
  at = 0;
  stalled = false;
  time() {
    return this.at;
  }
}

test('sound leads, however much time has passed', () => {
  const clock = running();
  const sound = new FakeSound();
  clock.leader = sound;
  for (const [now, at] of [
    [16, 0.01],
    [32, 0.2],
    [500, 0.21],
  ]) {
    sound.at = at;
    clock.tick(now);
    assert.equal(clock.seconds, at);
  }
});

test('where there is no sound, time goes by as it does without', () => {
  const clock = running();
  const sound = new FakeSound();
  clock.leader = sound;
  sound.at = 0.2;
  clock.tick(190);
  sound.at = null;
  clock.tick(290);
  near(clock.seconds, 0.3);
});

test('a missing frame holds sound where it is, and is the one that is wanted', () => {
  const clock = running();
  const sound = new FakeSound();
  clock.leader = sound;
  clock.gates.add((/** @type {number} */ seconds) => (seconds >= 0.3 ? 0.3 : Infinity));
  sound.at = 0.55;
  clock.tick(16);
  assert.equal(clock.held, true);
  assert.equal(clock.seconds, 0.55, 'frames that sound has passed are not waited for');
  assert.equal(clock.waitingSince, 16);
  clock.gates.clear();
  clock.tick(32);
  assert.deepEqual([clock.held, clock.waitingSince], [false, null]);
});

test('sound without data is waited for, and is not held', () => {
  const clock = running();
  const sound = new FakeSound();
  clock.leader = sound;
  sound.at = 0.2;
  sound.stalled = true;
  clock.tick(16);
  clock.tick(400);
  assert.deepEqual([clock.seconds, clock.held, clock.waitingSince], [0.2, false, 16]);
});

test('sound that is longer than the take ends with it', () => {
  const clock = running();
  const sound = new FakeSound();
  clock.leader = sound;
  sound.at = 1.02;
  assert.equal(clock.tick(16), 'wrapped');
  assert.equal(clock.seconds, 0);
  assert.equal(clock.jumps, 1);
  clock.loop = false;
  assert.equal(clock.tick(32), 'ended');
  assert.equal(clock.seconds, 0.9);
});
