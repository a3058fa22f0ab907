import assert from 'node:assert/strict';
import { test } from 'node:test';
import { JitterBuffer } from '../src/jitter-buffer.js';
import { LiveConnection } from '../src/live-connection.js';

/** @typedef {{ number: number, timestampNs: number }} Numbered */

/** @param {number} number at 30 a second @returns {Numbered} */
const frame = (number) => ({ number, timestampNs: (number * 1e9) / 30 });
const PERIOD = 1000 / 30;

test('uneven frames are shown evenly, a few frames late', () => {
  const buffer = /** @type {JitterBuffer<Numbered>} */ (new JitterBuffer(30));
  const lateBy = [0, 20, 5, 45, 0, 30, 10, 0, 50, 0];
  // None overtakes another.
  const times = lateBy.map((late, number) => number * PERIOD + late);
  const arrivals = times.map((_, number) => ({ number, at: Math.max(...times.slice(0, number + 1)) }));
  /** @type {{ number: number, at: number }[]} */
  const shown = [];
  for (let now = 0; now < 800; now++) {
    while (arrivals.length && arrivals[0].at <= now) buffer.put(frame(/** @type {any} */ (arrivals.shift()).number), now);
    const due = buffer.take(now);
    if (due) shown.push({ number: due.number, at: now });
  }
  assert.equal(shown.length, 10);
  const gaps = shown.slice(1).map(({ at }, before) => at - shown[before].at);
  assert.ok(
    gaps.every((gap) => Math.abs(gap - PERIOD) < 6),
    gaps.join(),
  );
});

test('frames that come in a heap are dropped, but for the newest that is due', () => {
  const buffer = /** @type {JitterBuffer<Numbered>} */ (new JitterBuffer(30));
  for (let number = 0; number < 40; number++) buffer.put(frame(number), 0);
  assert.ok(buffer.length <= 12);
  assert.equal(buffer.take(10_000)?.number, 39);
  assert.equal(buffer.take(10_000), null);
});

test('a stream that begins anew begins a new timeline', () => {
  const buffer = /** @type {JitterBuffer<Numbered>} */ (new JitterBuffer(30));
  buffer.put(frame(1000), 0);
  assert.equal(buffer.take(150)?.number, 1000);
  buffer.put(frame(0), 200);
  assert.equal(buffer.take(350)?.number, 0);
});

class FakeSocket {
  binaryType = '';
  readyState = 1;
  /** @type {any} */
  onopen;
  /** @type {any} */
  onmessage;
  /** @type {any} */
  onclose;
  /** @type {any[]} */
  sent = [];

  /** @param {any} data */
  send(data) {
    this.sent.push(data);
  }

  close() {
    this.onclose?.();
  }

  /** A message from the server. @param {number} kind @param {...number | Uint8Array} parts numbers are f64 */
  say(kind, ...parts) {
    const bytes = parts.map((part) => (typeof part === 'number' ? new Uint8Array(Float64Array.of(part).buffer) : part));
    const message = Uint8Array.from([kind, ...bytes.flatMap((part) => [...part])]);
    this.onmessage({ data: message.buffer });
  }
}

/** @param {import('node:test').TestContext} context */
function connected(context) {
  context.mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
  /** @type {FakeSocket[]} */
  const sockets = [];
  /** @type {any[]} */
  const events = [];
  const connection = new LiveConnection({
    connect: () => {
      sockets.push(new FakeSocket());
      return /** @type {any} */ (sockets[sockets.length - 1]);
    },
    on: {
      state: (state) => events.push(state),
      header: (header) => events.push(`header ${header.length}`),
      metadata: (packet) => events.push(`metadata ${packet.length}`),
      packet: (packet, serverMs, entry) => events.push(`${entry ? 'entry' : 'packet'} ${packet.length} at ${serverMs}`),
    },
  });
  return { connection, sockets, events, timers: context.mock.timers };
}

test('a live stream is heard', (context) => {
  const { sockets, events } = connected(context);
  sockets[0].onopen();
  sockets[0].say(0, new Uint8Array(48));
  sockets[0].say(5, new Uint8Array(40));
  sockets[0].say(4, 1200, new Uint8Array(50));
  sockets[0].say(1, 1234, new Uint8Array(30));
  sockets[0].say(2);
  sockets[0].say(0, new Uint8Array(48));
  const packets = ['entry 50 at 1200', 'packet 30 at 1234'];
  assert.deepEqual(events, ['waiting', 'header 48', 'live', 'metadata 40', ...packets, 'ended', 'header 48', 'live']);
});

test('a stream that has ended for good is not waited for', (context) => {
  const { connection, sockets, events, timers } = connected(context);
  sockets[0].onopen();
  sockets[0].say(0, new Uint8Array(48));
  sockets[0].say(2);
  sockets[0].say(2, Uint8Array.of(1));
  sockets[0].onclose();
  timers.tick(60_000);
  assert.deepEqual(events, ['waiting', 'header 48', 'live', 'ended', 'over']);
  assert.equal(connection.state, 'over');
  assert.equal(sockets.length, 1, 'the server is not called again');
});

test('messages that are no good are passed over', (context) => {
  const { sockets, events } = connected(context);
  sockets[0].onopen();
  events.length = 0;
  sockets[0].onmessage({ data: 'text' });
  sockets[0].onmessage({ data: new ArrayBuffer(0) });
  sockets[0].say(0, new Uint8Array(47));
  sockets[0].say(1, new Uint8Array(3));
  sockets[0].say(9, new Uint8Array(100));
  assert.deepEqual(events, []);
});

test('a server that goes away is called again, less and less often', (context) => {
  const { connection, sockets, timers } = connected(context);
  sockets[0].onopen();
  sockets[0].onclose();
  assert.equal(connection.state, 'lost');
  for (const wait of [250, 500, 1000, 2000, 4000, 4000]) {
    const before = sockets.length;
    timers.tick(wait - 1);
    assert.equal(sockets.length, before);
    timers.tick(1);
    assert.equal(sockets.length, before + 1);
    sockets[sockets.length - 1].onclose();
  }
  timers.tick(4000);
  const last = sockets[sockets.length - 1];
  last.onopen();
  last.say(0, new Uint8Array(48));
  assert.equal(connection.state, 'live');
  last.onclose();
  const before = sockets.length;
  timers.tick(250);
  assert.equal(sockets.length, before + 1, 'soon again, as it had been there');
});

test('a network that is gone without a word is noticed', (context) => {
  const { connection, sockets, timers } = connected(context);
  let now = 1000;
  context.mock.method(performance, 'now', () => now);
  const pass = (/** @type {number} */ ms) => {
    for (let passed = 0; passed < ms; passed += 1000) {
      now += 1000;
      timers.tick(1000);
    }
  };
  sockets[0].onopen();
  sockets[0].say(0, new Uint8Array(48));
  for (let minute = 0; minute < 3; minute++) {
    // Whatever is heard will do.
    pass(9_000);
    sockets[0].say(2);
  }
  assert.equal(sockets.length, 1);
  sockets[0].close = () => {}; // It waits for the other side.
  pass(16_000);
  assert.equal(sockets.length, 2);
  assert.equal(sockets[0].onmessage, null);
  sockets[1].onopen();
  sockets[1].say(0, new Uint8Array(48));
  assert.equal(connection.state, 'live');
  connection.close();
});

test('a page that slept is not taken for a server that did', (context) => {
  const { connection, sockets, timers } = connected(context);
  let now = 1000;
  context.mock.method(performance, 'now', () => now);
  sockets[0].onopen();
  for (let minute = 0; minute < 5; minute++) {
    sockets[0].say(3, now, now);
    // Timers of a page that is not seen run once a minute.
    now += 60_000;
    timers.tick(3000);
  }
  assert.equal(sockets.length, 1);
  connection.close();
});

test("the server's clock is learned", (context) => {
  const { connection, sockets } = connected(context);
  sockets[0].onopen();
  const asked = new Float64Array(sockets[0].sent[0])[0];
  sockets[0].say(3, asked + 5000, asked);
  assert.ok(Math.abs(connection.offsetMs - 5000) < 100, `${connection.offsetMs}`);
  connection.close();
});

test('no packet arrives before it was sent', (context) => {
  const { connection, sockets } = connected(context);
  const now = performance.timeOrigin + performance.now();
  sockets[0].onopen();
  // An answer that took a second, of which all was the way back: it seems that the server's clock is half a second behind.
  sockets[0].say(3, now - 1000, now - 1000);
  assert.ok(Math.abs(connection.offsetMs + 500) < 100, `${connection.offsetMs}`);
  const sent = performance.timeOrigin + performance.now();
  sockets[0].say(1, sent, new Uint8Array(30));
  assert.ok(connection.serverNow >= sent, `${connection.serverNow} after ${sent}`);
  sockets[0].say(3, now - 1000, now - 1000);
  assert.ok(connection.serverNow >= sent, 'whatever answers follow');
  connection.close();
});

test('a server that comes back may have another clock', (context) => {
  const { connection, sockets, timers } = connected(context);
  sockets[0].onopen();
  const asked = new Float64Array(sockets[0].sent[0])[0];
  sockets[0].say(3, asked + 5000, asked);
  sockets[0].onclose();
  timers.tick(250);
  assert.ok(Math.abs(connection.offsetMs - 5000) < 100, `until more is known: ${connection.offsetMs}`);
  // However long the new answer took.
  const now = performance.timeOrigin + performance.now();
  sockets[1].onopen();
  sockets[1].say(3, now - 8000, now - 1000);
  assert.ok(Math.abs(connection.offsetMs + 7500) < 100, `${connection.offsetMs}`);
  connection.close();
});
