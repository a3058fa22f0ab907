import assert from 'node:assert/strict';
import { afterEach, test } from 'node:test';
import { IsvFailure } from '../src/failure.js';
import { DecodeAhead } from '../src/workers.js';
import { FRAME_BYTES, FakePort, fakeSource } from './support/fake-stream.js';

/** What the test that runs has begun: one that fails must not decode for ever. @type {DecodeAhead[]} */
const running = [];

afterEach(() => {
  for (const ahead of running.splice(0)) ahead.close();
});

/**
 * @param {object} [options]
 * @param {number} [options.frames]
 * @param {number} [options.gop]
 * @param {number} [options.first] the first keyframe
 * @param {number} [options.workers]
 * @param {number} [options.hold] frames that fit into memory
 * @param {number[]} [options.damaged]
 * @param {Record<number, number>} [options.refused] frames that need too much memory, and how many blocks they have
 * @param {number} [options.memoryBytes] that each worker takes
 * @param {(frame: number) => number} [options.bytesOf] a decoded frame
 * @param {import('../src/allowance.js').Allowance} [options.allowance]
 * @param {boolean} [options.silent] whether nobody listens
 */
function begun({ frames = 100, gop = 10, first = 0, workers = 2, hold = 40, damaged = [], refused = {}, memoryBytes = 0, bytesOf, allowance, silent = false } = {}) {
  const source = fakeSource(frames, gop, first);
  /** @type {FakePort[]} */
  const ports = [];
  /** @type {any[]} */
  const events = [];
  const ahead = new DecodeAhead({
    source: /** @type {any} */ (source),
    module: /** @type {any} */ (null),
    spawn: () => {
      const port = new FakePort({ damaged, refused, memoryBytes, bytesOf });
      ports.push(port);
      return /** @type {any} */ (port);
    },
    workers,
    budget: hold * FRAME_BYTES,
    allowance,
    on: silent ? undefined : {
      frame: (frame) => events.push({ frame }),
      lost: (lost) => events.push({ lost }),
      failed: (error, fatal) => events.push({ failed: error.message, fatal }),
      recovered: () => events.push({ recovered: true }),
    },
  });
  running.push(ahead);
  ahead.start();
  return { ahead, source, ports, events };
}

/** Lets everything that is under way come to rest. */
async function rest() {
  for (let turn = 0; turn < 400; turn++) await new Promise((next) => setImmediate(next));
}

/** @param {DecodeAhead} ahead @param {number} frames */
const held = (ahead, frames) => Array.from({ length: frames }, (_, frame) => frame).filter((frame) => ahead.get(frame));

test('frames come in order from both workers, none after the wrong one', async () => {
  const { ahead, ports, events } = begun({ frames: 40, hold: 60 });
  await rest();
  assert.equal(held(ahead, 40).length, 40);
  assert.ok(
    ports.every(({ decoded }) => decoded.length >= 10),
    'both have decoded',
  );
  assert.equal(events.filter(({ lost }) => lost).length, 0);
  assert.equal(ports.flatMap(({ decoded }) => decoded).length, 40, 'nothing is decoded twice');
});

test('memory is bounded: frames far ahead are not made, those behind are freed', async () => {
  const { ahead } = begun({ frames: 100_000, hold: 40 });
  await rest();
  assert.ok(ahead.bytes <= 40 * FRAME_BYTES, `${ahead.bytes}`);
  assert.ok(ahead.settled(25) && !ahead.settled(45));
  for (let frame = 0; frame < 500; frame += 5) {
    ahead.aim(frame);
    await new Promise((next) => setImmediate(next));
    assert.ok(ahead.bytes <= 41 * FRAME_BYTES);
  }
  await rest();
  assert.equal(ahead.get(400), undefined);
  assert.ok(ahead.settled(495) && ahead.settled(520));
});

/** @param {FakePort[]} ports */
const decodedBy = (ports) => ports.reduce((frames, { decoded }) => frames + decoded.length, 0);

test('a take of which two frames do not fit plays, and comes to rest', async () => {
  const { ahead, ports } = begun({ frames: 20, workers: 1, hold: 1.9 });
  for (let frame = 0; frame < 19; frame++) {
    ahead.aim(frame);
    await rest();
    assert.ok(ahead.get(frame) && ahead.get(frame + 1), `at ${frame}`);
    assert.equal(ahead.held, 2);
  }
  const before = decodedBy(ports);
  await rest();
  assert.equal(decodedBy(ports), before);
});

test('a playhead that stands still has nothing decoded again and again, however short room is', async () => {
  for (const hold of [4, 22.8, 26, 40, 90]) {
    const { ahead, ports } = begun({ frames: 300, gop: 30, hold });
    await rest();
    ahead.aim(100);
    await rest();
    ahead.aim(99, { behind: 8 });
    await rest();
    const before = decodedBy(ports);
    await rest();
    assert.equal(decodedBy(ports), before, `${hold} frames fit`);
    assert.ok(ahead.get(99) && ahead.get(100));
  }
});

test('frames that are larger than those before are not decoded again and again', async () => {
  const bytesOf = (/** @type {number} */ frame) => FRAME_BYTES * (frame < 60 ? 1 : 9);
  const { ahead, ports } = begun({ frames: 300, hold: 100, workers: 4, bytesOf });
  for (const frame of [0, 20, 40, 50, 58, 59, 60]) {
    ahead.aim(frame);
    await rest();
    const before = decodedBy(ports);
    await rest();
    assert.equal(decodedBy(ports), before, `at ${frame}`);
    assert.ok(ahead.get(frame) && ahead.get(frame + 1));
  }
});

test('a frame for which there was no room is decoded when the playhead comes near', async () => {
  const { ahead } = begun({ frames: 300, gop: 30, hold: 4 });
  ahead.aim(99, { behind: 8 });
  await rest();
  assert.ok(!ahead.get(92));
  for (let frame = 98; frame > 90; frame--) {
    ahead.aim(frame, { behind: 8 });
    await rest();
    assert.ok(ahead.get(frame), `${frame}`);
  }
});

test('frames that could be better are decoded again once they have been shown', async () => {
  const { ahead, source, ports } = begun({ frames: 30, hold: 40, workers: 1 });
  source.stream = 1;
  await rest();
  assert.deepEqual(new Set(held(ahead, 30).map((frame) => /** @type {any} */ (ahead.get(frame)).stream)), new Set([1]));
  source.stream = 0;
  for (let frame = 0; frame < 15; frame++) {
    ahead.aim(frame);
    await rest();
  }
  assert.deepEqual(
    held(ahead, 30).map((frame) => /** @type {any} */ (ahead.get(frame)).stream),
    [...new Array(14).fill(0), ...new Array(16).fill(1)],
  );
  const before = ports[0].decoded.length;
  for (let frame = 15; frame < 20; frame++) ahead.aim(frame);
  await rest();
  assert.ok(ports[0].decoded.length > before);
});

test('a take that fits is kept whole and decoded once, however often it goes round', async () => {
  const { ahead, ports } = begun({ frames: 30, hold: 40 });
  await rest();
  for (let round = 0; round < 3; round++) for (let frame = 0; frame < 30; frame++) ahead.aim(frame);
  await rest();
  assert.equal(ports.flatMap(({ decoded }) => decoded).length, 30);
});

test('a seek shows its frame first, decoded from the keyframe before', async () => {
  const { ahead, ports, events } = begun({ frames: 1000 });
  await rest();
  events.length = 0;
  for (const port of ports) port.decoded.length = 0;
  ahead.aim(735);
  await rest();
  assert.equal(events[0].frame, 735);
  assert.deepEqual(ports.find(({ decoded }) => decoded.includes(735))?.decoded.slice(0, 6), [730, 731, 732, 733, 734, 735]);
  assert.equal(ahead.get(732), undefined, 'frames before it are not surfaced');
});

test('a hurried frame has the workers to itself until it is drawn', async () => {
  const { ahead, ports } = begun({ frames: 1000 });
  await rest();
  for (const port of ports) port.decoded.length = 0;
  ahead.aim(735);
  ahead.hurry();
  await rest();
  assert.deepEqual(
    ports.flatMap(({ decoded }) => decoded).filter((frame) => frame > 735),
    [],
    'nothing is decoded ahead',
  );
  assert.ok(ahead.settled(735));
  ahead.release();
  await rest();
  assert.ok(ahead.settled(736) && ahead.settled(750));
});

test('a hurried frame that is there holds nothing up', async () => {
  const { ahead } = begun({ frames: 1000 });
  await rest();
  ahead.aim(10);
  ahead.hurry();
  await rest();
  assert.ok(ahead.settled(36), 'decoding goes on');
});

test('hurrying once more for a frame that has come by then goes on behind it', async () => {
  const { ahead } = begun({ frames: 1000 });
  ahead.aim(735);
  ahead.hurry();
  await rest();
  assert.ok(ahead.settled(735) && !ahead.settled(750));
  ahead.hurry();
  await rest();
  assert.ok(ahead.settled(750));
});

test('who listens late is told what happened', async () => {
  const { ahead, events } = begun({ frames: 30, damaged: [4], silent: true });
  await rest();
  assert.equal(events.length, 0);
  ahead.listen({ frame: (frame) => events.push({ frame }), lost: (lost) => events.push({ lost }) });
  assert.equal(events[0].frame, 0);
  assert.deepEqual(
    events.filter(({ lost }) => lost).map(({ lost }) => [lost.frame, lost.resumes]),
    [[4, 10]],
  );
});

test('stepping back makes the frames before, too', async () => {
  const { ahead } = begun({ frames: 1000 });
  await rest();
  ahead.aim(735, { behind: 8 });
  await rest();
  assert.deepEqual(
    [730, 731, 734, 735].map((frame) => ahead.settled(frame)),
    [true, true, true, true],
  );
});

test('a drag does not queue up what it passed', async () => {
  const { ahead, ports } = begun({ frames: 100_000 });
  await rest();
  for (const port of ports) port.decoded.length = 0;
  for (let frame = 50_005; frame < 52_000; frame += 10) ahead.aim(frame);
  ahead.aim(60_009);
  await rest();
  const passed = ports.flatMap(({ decoded }) => decoded).filter((frame) => frame < 60_000);
  assert.ok(ahead.settled(60_009));
  assert.ok(passed.length < 20, `${passed.length} frames decoded for nothing`);
});

test('a short seek ahead within a GOP goes on from where the decoder is', async () => {
  const { ahead, ports } = begun({ frames: 200, gop: 100, workers: 1, hold: 10 });
  await rest();
  const before = ports[0].decoded.length;
  ahead.aim(40);
  await rest();
  assert.ok(!ports[0].decoded.slice(before).includes(0), 'the keyframe is not decoded again');
  assert.ok(ahead.settled(40));
});

test('a damaged frame loses what follows it, up to the next keyframe', async () => {
  const { ahead, events } = begun({ frames: 40, damaged: [13] });
  await rest();
  assert.deepEqual(
    events.filter(({ lost }) => lost),
    [{ lost: { frame: 13, resumes: 20, message: 'damaged', refused: false, missing: false } }],
  );
  assert.deepEqual(
    [12, 13, 19, 20].map((frame) => Boolean(ahead.get(frame))),
    [true, false, false, true],
  );
  assert.ok(ahead.settled(13), 'nobody waits for it');
});

test('frames before the first keyframe are lost', async () => {
  const { ahead } = begun({ frames: 20, first: 10 });
  await rest();
  ahead.aim(5);
  await rest();
  assert.deepEqual(
    [0, 9, 10].map((frame) => ahead.lost.has(frame)),
    [true, true, false],
  );
  assert.ok(ahead.get(10));
});

test('what cannot be read is tried again', async (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  const { ahead, source, events } = begun({ frames: 20 });
  source.fails = new IsvFailure('missing', 'no network');
  ahead.aim(5);
  await rest();
  assert.ok(events.some(({ failed, fatal }) => failed === 'no network' && !fatal));
  source.fails = null;
  context.mock.timers.tick(600);
  await rest();
  assert.ok(ahead.settled(5));
  assert.ok(events.some(({ recovered }) => recovered));
});

test('a file that has changed is not tried again', async () => {
  const { ahead, source, events, ports } = begun({ frames: 1000 });
  source.fails = new IsvFailure('damaged', 'changed');
  ahead.aim(500);
  await rest();
  assert.ok(events.some(({ failed, fatal }) => failed === 'changed' && fatal));
  assert.ok(ports.every(({ terminated }) => terminated));
});

test('a part that cannot be had is passed over without a wait', async () => {
  const { ahead, source, events } = begun({ frames: 1000 });
  source.gone.add(500);
  ahead.aim(495);
  await rest();
  assert.deepEqual(
    events.filter(({ lost, failed }) => lost || failed),
    [{ lost: { frame: 500, resumes: 510, message: 'no such file', refused: false, missing: true } }],
  );
  assert.ok(ahead.get(499) && ahead.get(510));
});

test('a part that could not be had is asked for again', async () => {
  const { ahead, source, ports } = begun({ frames: 1000 });
  for (const port of ports) port.damaged.add(485);
  source.gone.add(500);
  ahead.aim(480);
  await rest();
  source.gone.delete(500);
  ahead.aim(495);
  await rest();
  assert.ok(ahead.lost.has(500), 'not by itself');
  ahead.askAgain();
  ahead.aim(500);
  await rest();
  assert.ok(ahead.get(500) && !ahead.lost.has(500));
  assert.ok(ahead.lost.has(485), 'what is damaged stays so');
});

test('a frame that cannot be decoded comes from another stream, as long as there is one', async () => {
  const { ahead, source, events, ports } = begun({ frames: 1000 });
  for (const port of ports) port.damaged.add(503);
  source.others = 2;
  ahead.aim(500);
  await rest();
  assert.equal(ports.flatMap(({ decoded }) => decoded).filter((frame) => frame === 503).length, 3);
  assert.deepEqual(events.filter(({ lost }) => lost).map(({ lost }) => [lost.frame, lost.resumes, lost.missing]), [[503, 510, false]]);
});

test('a ladder of which nothing more can be had ends, and not before all is shown that is there', async () => {
  const { ahead, source, events } = begun({ frames: 1000, hold: 500 });
  source.rungs = {};
  for (let keyframe = 500; keyframe < 1000; keyframe += 10) source.gone.add(keyframe);
  ahead.loop = false;
  ahead.aim(480);
  await rest();
  for (let frame = 481; frame < 500; frame++) ahead.aim(frame);
  assert.equal(events.filter(({ failed }) => failed).length, 0);
  ahead.aim(500);
  await rest();
  assert.deepEqual(events.filter(({ failed }) => failed), [{ failed: '10 parts of it in a row cannot be played: no such file', fatal: true }]);
  assert.equal(events.filter(({ lost }) => lost).length, 10);
});

/** A ladder that was given up behind its first 20 frames, which are there. */
async function givenUp() {
  const { ahead, source, events } = begun({ frames: 300, workers: 1, hold: 1000 });
  source.rungs = {};
  for (let keyframe = 20; keyframe < 300; keyframe += 10) source.gone.add(keyframe);
  await rest();
  assert.equal(ahead.lost.size, 100);
  return { ahead, source, events };
}

test('a ladder that was given up is read on after a seek, and ends where that is no use', async () => {
  for (const mended of [true, false]) {
    const { ahead, source, events } = await givenUp();
    if (mended) source.gone.clear();
    ahead.askAgain();
    ahead.aim(5);
    await rest();
    ahead.aim(25);
    await rest();
    assert.equal(Boolean(ahead.get(25)), mended);
    assert.equal(events.filter(({ fatal }) => fatal).length, mended ? 0 : 1);
  }
});

test('a ladder that was given up for damage is read on after a seek', async () => {
  const { ahead, events } = begun({ frames: 300, workers: 1, hold: 1000, damaged: Array.from({ length: 10 }, (_, at) => 20 + 10 * at) });
  /** @type {any} */ (ahead.source).rungs = {};
  await rest();
  assert.ok(!ahead.settled(120));
  ahead.askAgain();
  ahead.aim(150);
  await rest();
  assert.ok(ahead.get(150) && ahead.lost.has(20));
  assert.deepEqual(events.filter(({ failed }) => failed), []);
});

test('details of a ladder that was given up are decoded of what there is', async () => {
  const { ahead, events } = await givenUp();
  ahead.setDetails(true);
  await rest();
  assert.ok(ahead.get(0)?.details && ahead.get(19)?.details);
  assert.deepEqual(events.filter(({ failed }) => failed), []);
});

test('details are asked for only while they are wanted', async () => {
  const { ahead } = begun({ frames: 20 });
  await rest();
  assert.equal(ahead.get(3)?.details, null);
  ahead.setDetails(true);
  assert.equal(ahead.held, 0);
  await rest();
  assert.ok(ahead.get(3)?.details);
});

test('the clock may go as far as there are frames', async () => {
  const { ahead } = begun({ frames: 10, gop: 5, hold: 100, damaged: [7] });
  assert.equal(ahead.firstMissing(0), 0);
  await rest();
  assert.equal(ahead.firstMissing(0), Infinity);
  assert.deepEqual(ahead.spans(), [[0, 7]]);
});

test('a frame that needs too much memory is refused by name, not called damaged', async () => {
  const allowance = { bytes: 512e6, voxels: 42_000_000, trusted: true };
  const { ahead, events } = begun({ frames: 40, refused: { 13: 300_000 }, allowance });
  await rest();
  const [{ lost }] = events.filter(({ lost }) => lost);
  assert.deepEqual([lost.frame, lost.resumes, lost.refused], [13, 20, true]);
  assert.match(lost.message, /^frame 13 needs 300,000 blocks, about 1\.8 GB, and the player was given 50\d MB: .*--max-memory 1\.9GB/);
  assert.deepEqual([...ahead.refused], [13, 14, 15, 16, 17, 18, 19]);
  assert.ok(ahead.get(20), 'what follows is decoded');
});

test('workers that the machine has no memory for are closed, and the others do their work', async () => {
  const allowance = { bytes: 2.5e9, voxels: 1 << 27, trusted: false };
  const { ahead, ports } = begun({ frames: 80, hold: 200, workers: 4, memoryBytes: 1e9, allowance });
  await rest();
  assert.equal(ahead.workers, 2);
  assert.deepEqual(ports.map(({ terminated }) => terminated).sort(), [false, false, true, true]);
  assert.equal(held(ahead, 80).length, 80);
  const large = begun({ frames: 80, hold: 200, workers: 4, memoryBytes: 4e9, allowance });
  await rest();
  assert.equal(large.ahead.workers, 1, 'one is left');
  assert.equal(held(large.ahead, 80).length, 80);
});
