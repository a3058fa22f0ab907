import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { after, before, test } from 'node:test';
import { LostPart } from '../src/failure.js';
import { Choice } from '../src/ladder/choice.js';
import { NoAnswer, download } from '../src/ladder/download.js';
import { parseMaster, parseMedia } from '../src/ladder/playlist.js';
import { BlobBytes, HttpBytes } from '../src/ranges.js';
import { openSource } from '../src/source.js';
import { Decoder } from '../src/wasm.js';
import { DecodeAhead } from '../src/workers.js';
import { DecoderPort } from './support/decoder-port.js';
import { laddered } from './support/ladder.js';
import { fakeSound } from './support/mp4.js';
import { serve } from './support/server.js';
import { packetsOf, repeated } from './support/stream.js';

const short = await readFile(new URL('../../conformance/main_settled.isv', import.meta.url));
const stream = repeated(short, 90, { gop: 4 });
const packets = packetsOf(stream);
const files = laddered([stream, stream, stream], { sound: fakeSound(3) });
let rungs = 0;
// Told apart by what the playlist says, though they are the same. Any machine has room for the best.
const master = Buffer.from(files['master.m3u8'])
  .toString()
  .replace(/BANDWIDTH=\d+/g, () => `BANDWIDTH=${[4000, 2000, 1000][rungs++]}`);
/** @type {Decoder} */
let parser;
/** @type {import('./support/server.js').Served} */
let server;

before(async () => {
  parser = await Decoder.create();
  server = await serve({ ...files, 'master.m3u8': Buffer.from(master) });
});

after(() => server.close());

const open = (name = 'master.m3u8') => openSource(new HttpBytes(`${server.url}files/${name}`), parser);

/** Which rungs segments were asked of, in order. */
const asked = () => server.requests.map(({ path }) => /rung-(\d)\/\d+\.m4s/.exec(path)?.[1]).filter(Boolean).join('');

test('the frames of a ladder are those of the stream', async () => {
  const source = await open();
  assert.equal(source.frames, 90);
  assert.equal(source.rungs?.all.length, 3);
  assert.ok(Math.abs(source.times.duration - 3) < 1e-4);
  for (const frame of [0, 1, 89, 40, 41, 3]) assert.deepEqual(Buffer.from(await source.packet(frame)), Buffer.from(packets[frame]));
  assert.deepEqual([...source.gops.keyframes], [...packets.keys()].filter((frame) => frame % 4 === 0));
  source.close();
});

test('sound is there with its segments', async () => {
  const { sound } = await open();
  assert.deepEqual([sound?.[0].codec, [...(sound?.[0].starts ?? [])]], ['opus', [0, 1, 2]]);
  assert.deepEqual(Buffer.from((await sound?.[0].fragment(1, new AbortController().signal)) ?? []), Buffer.from(files['sound/1.m4s']));
  assert.deepEqual(Buffer.from((await sound?.[0].init()) ?? []), Buffer.from(files['sound/init.mp4']));
});

test('a playlist of one rung is a ladder of one', async () => {
  const source = await open('rung-1/stream.m3u8');
  assert.equal(source.rungs?.all.length, 1);
  assert.deepEqual(Buffer.from(await source.packet(5)), Buffer.from(packets[5]));
});

test('a rung whose playlist or header the server does not have is left out', async () => {
  for (const path of ['/files/rung-1/stream.m3u8', '/files/rung-0/init.mp4'])
    await damaged('missing', [path], async () => {
      const source = await open();
      assert.deepEqual(source.rungs?.all.map(({ bandwidth }) => bandwidth), path.includes('rung-1') ? [4000, 1000] : [2000, 1000]);
      assert.deepEqual(Buffer.from(await source.packet(5)), Buffer.from(packets[5]));
      source.close();
    });
  const all = [0, 1, 2].map((rung) => `/files/rung-${rung}/stream.m3u8`);
  await damaged('missing', all, () => assert.rejects(open(), { message: 'stream.m3u8: the server has no such file' }));
});

test('a ladder of which only the sound is missing opens without, and says why', async () => {
  for (const [path, name] of [['/files/sound/stream.m3u8', 'stream.m3u8'], ['/files/sound/init.mp4', 'init.mp4']])
    await damaged('missing', [path], async () => {
      const source = await open();
      assert.deepEqual([source.frames, source.sound, source.silence], [90, null, `${name}: the server has no such file`]);
      source.close();
    });
  const source = await open();
  assert.equal(source.silence, undefined);
  source.close();
});

test('it begins at the lowest rung, and goes to the one that the network has room for', async () => {
  server.requests.length = 0;
  const source = await open();
  for (let frame = 0; frame < 20; frame++) await source.packet(frame);
  assert.equal(asked(), '20000');
  assert.deepEqual([source.streamOf(0), source.streamOf(19)], [2, 0]);
  source.close();
});

test('what came from a low rung at first comes from a better one the next time', async () => {
  const source = await open();
  for (let frame = 0; frame < 20; frame++) await source.packet(frame);
  assert.deepEqual([source.streamOf(0), source.outdated?.(2, 0), source.outdated?.(0, 0)], [2, true, false]);
  await source.packet(2);
  assert.equal(source.streamOf(0), 2, 'not in the middle of a GOP');
  await source.packet(0);
  assert.equal(source.streamOf(0), 0);
  source.close();
});

test('frames of a segment come from the rung that its first came from', async () => {
  const source = await open();
  await source.packet(0);
  for (let frame = 4; frame < 90; frame += 4) await source.packet(frame);
  server.requests.length = 0;
  await source.packet(2);
  assert.ok(asked() === '' || asked() === '2', asked());
  source.close();
});

test('segments come one after the other, and those that nobody wants any more are not asked for', async () => {
  server.habits.delayMs = 30;
  const source = await open();
  server.requests.length = 0;
  const leaving = new AbortController();
  const reads = [source.packet(0), source.packet(8, leaving.signal), source.packet(16)];
  leaving.abort();
  await assert.rejects(reads[1]);
  await Promise.all([reads[0], reads[2]]).finally(() => (server.habits.delayMs = 0));
  assert.equal(asked().length, 2);
  source.close();
});

/** What can be wrong with a segment, and how to bring it about. @type {Record<string, (path: string, bytes: Uint8Array) => void>} */
const DAMAGE = {
  missing: (path) => server.habits.missing.add(path),
  empty: (path) => server.files.set(nameOf(path), new Uint8Array()),
  cut: (path, bytes) => server.files.set(nameOf(path), bytes.subarray(0, bytes.length - 10)),
  'of noise': (path, bytes) => server.files.set(nameOf(path), bytes.map((_, at) => (at * 7919) >> 3)),
  'of another track': (path) => server.files.set(nameOf(path), files['sound/0.m4s']),
  // The boxes are right, and a packet is not what its checksum says.
  'of wrong bytes': (path, bytes) => server.files.set(nameOf(path), bytes.map((byte, at) => (at === bytes.length - 5 ? byte ^ 1 : byte))),
};

/** @param {string} path */
const nameOf = (path) => path.slice('/files/'.length);

/** Damages segments while something is done. @param {string | ((path: string) => string)} how @param {string[]} paths @param {() => Promise<void>} what */
async function damaged(how, paths, what) {
  for (const path of paths) DAMAGE[typeof how === 'string' ? how : how(path)](path, files[nameOf(path)]);
  await what().finally(() => {
    server.habits.missing.clear();
    for (const path of paths) server.files.set(nameOf(path), files[nameOf(path)]);
  });
}

/** @param {number} segment */
const everyRung = (segment) => [0, 1, 2].map((rung) => `/files/rung-${rung}/${segment}.m4s`);

test('a segment that cannot be fetched is tried again, past what the browser has kept', async () => {
  const source = await open();
  server.requests.length = 0;
  await damaged('missing', ['/files/rung-2/0.m4s'], async () => {
    setTimeout(() => server.habits.missing.clear(), 100);
    assert.deepEqual(Buffer.from(await source.packet(0)), Buffer.from(packets[0]));
  });
  assert.deepEqual([asked(), source.streamOf(0)], ['22', 2]);
  source.close();
});

for (const how of Object.keys(DAMAGE).filter((how) => how !== 'of wrong bytes'))
  test(`instead of a segment that is ${how} there is one of another rung`, async () => {
    const source = await open();
    server.requests.length = 0;
    await damaged(how, ['/files/rung-2/0.m4s'], async () => {
      assert.deepEqual(Buffer.from(await source.packet(0)), Buffer.from(packets[0]));
    });
    assert.deepEqual([asked(), source.streamOf(0)], ['2221', 1], 'three times, then elsewhere');
    source.close();
  });

test('a rung that fails is tried once only, until it gives a segment', async () => {
  const source = await open();
  await source.packet(0);
  server.requests.length = 0;
  await damaged('missing', [1, 2].map((segment) => `/files/rung-0/${segment}.m4s`), async () => {
    for (const frame of [4, 8, 12]) await source.packet(frame);
  });
  assert.equal(asked(), '0001' + '01' + '0');
  assert.equal(source.outdated?.(1, 4), false, 'it is the best that there is');
  assert.equal(source.outdated?.(2, 4), true);
  source.close();
});

test('a segment that no rung has is lost, and those behind it are there', async () => {
  const source = await open();
  await damaged('missing', everyRung(0), () => assert.rejects(source.packet(0), (error) => {
    assert.ok(error instanceof LostPart);
    assert.deepEqual([error.kind, error.message], ['missing', '0.m4s: the server has no such file']);
    return true;
  }));
  assert.deepEqual(Buffer.from(await source.packet(4)), Buffer.from(packets[4]));
  assert.deepEqual(Buffer.from(await source.packet(0)), Buffer.from(packets[0]), 'who asks again gets it');
  source.close();
});

test('a server that closes connections for one file only has lost it, and one that is gone has not', async () => {
  const source = await open();
  for (const path of everyRung(1)) server.habits.refused.add(path);
  await assert.rejects(source.packet(4), LostPart);
  server.habits.refused.add('/files/rung-2/init.mp4').add('/files/rung-1/init.mp4').add('/files/rung-0/init.mp4');
  await assert.rejects(source.packet(4), NoAnswer).finally(() => server.habits.refused.clear());
  assert.deepEqual(Buffer.from(await source.packet(4)), Buffer.from(packets[4]));
  source.close();
});

test('a server that says nothing is not waited for', async () => {
  server.habits.silent.add('/files/rung-0/0.m4s');
  const begun = performance.now();
  const silent = download(`${server.url}files/rung-0/0.m4s`, { limit: 1e6, silence: 100 });
  await assert.rejects(silent, (error) => error instanceof NoAnswer && /sends nothing/.test(error.message)).finally(() => server.habits.silent.clear());
  assert.ok(performance.now() - begun < 5000);
});

test('a read that nobody waits for any more is not tried again', async () => {
  const source = await open();
  const leaving = new AbortController();
  await damaged('missing', everyRung(0), async () => {
    const read = source.packet(0, leaving.signal);
    while (!asked()) await new Promise((wake) => setTimeout(wake, 5));
    leaving.abort();
    await assert.rejects(read, { name: 'AbortError' });
  });
  server.requests.length = 0;
  await new Promise((wake) => setTimeout(wake, 400));
  assert.equal(asked(), '');
  source.close();
});

test('sound that is missing or damaged is tried again, and then passed over', async () => {
  const { sound } = await open();
  const signal = new AbortController().signal;
  for (const how of ['missing', 'empty', 'cut', 'of noise']) {
    server.requests.length = 0;
    await damaged(how, ['/files/sound/1.m4s'], () => assert.rejects(Promise.resolve(sound?.[0].fragment(1, signal)), LostPart));
    assert.equal(server.requests.filter(({ path }) => path === '/files/sound/1.m4s').length, 3, how);
  }
  assert.deepEqual(Buffer.from((await sound?.[0].fragment(1, signal)) ?? []), Buffer.from(files['sound/1.m4s']));
});

/** Plays a ladder from its first frame to its last, as fast as it is decoded. */
async function played() {
  const source = await open();
  /** @type {any[]} */
  const events = [];
  /** @type {string[]} */
  const fatal = [];
  const decoders = [await Decoder.create(), await Decoder.create()];
  const ahead = new DecodeAhead({
    source,
    module: /** @type {any} */ (null),
    spawn: () => /** @type {any} */ (new DecoderPort(/** @type {Decoder} */ (decoders.pop()))),
    workers: 2,
    budget: 30 * 100,
    on: { lost: (lost) => events.push(lost), failed: (error, ends) => ends && fatal.push(error.message) },
  });
  ahead.aim(0, { loop: false });
  ahead.start();
  /** The rung that each frame was shown from; -1 where the picture before is held. @type {number[]} */
  const shown = [];
  for (let frame = 0; frame < source.frames && !fatal.length; frame++) {
    ahead.aim(frame);
    while (!ahead.settled(frame) && !fatal.length) await new Promise((wake) => setTimeout(wake, 2));
    shown.push(ahead.get(frame)?.stream ?? -1);
  }
  ahead.close();
  source.close();
  return { shown, events, fatal };
}

/** Frames that were not shown. @param {number[]} shown */
const held = (shown) => [...shown.keys()].filter((frame) => shown[frame] < 0);

/** Segments that are damaged in some way each. @type {Map<number, string>} */
const WAYS = new Map(Object.keys(DAMAGE).map((how, at) => [2 + 3 * at, how]));

/** @param {string} path */
const wayOf = (path) => WAYS.get(Number(/(\d+)\.m4s/.exec(path)?.[1])) ?? '';

test('a take plays to its end, whatever segments of one rung are like', async () => {
  await damaged(wayOf, [...WAYS.keys()].map((segment) => `/files/rung-0/${segment}.m4s`), async () => {
    const { shown, events, fatal } = await played();
    assert.deepEqual([shown.length, held(shown), events, fatal], [90, [], [], []]);
    for (const [segment, how] of WAYS) assert.notEqual(shown[4 * segment + 3], 0, `${how}: from another rung`);
    assert.ok(shown.includes(0), 'the best is shown again');
  });
});

test('segments that no rung has whole are passed over, and each is told of once', async () => {
  await damaged(wayOf, [...WAYS.keys()].flatMap(everyRung), async () => {
    const { shown, events, fatal } = await played();
    const lost = [...WAYS].map(([segment, how]) => ({
      // Frames before the one that is wrong are shown.
      frame: 4 * segment + (how === 'of wrong bytes' ? 3 : 0),
      resumes: 4 * segment + 4,
      missing: how === 'missing',
      refused: false,
    }));
    assert.deepEqual([shown.length, fatal], [90, []]);
    assert.deepEqual(held(shown), lost.flatMap(({ frame, resumes }) => Array.from({ length: resumes - frame }, (_, at) => frame + at)));
    assert.deepEqual(
      events.map(({ frame, resumes, missing, refused }) => ({ frame, resumes, missing, refused })).sort((a, b) => a.frame - b.frame),
      lost,
    );
  });
});

test('it gives up behind a run of segments that no rung has, after showing what is there', async () => {
  const all = Array.from({ length: 18 }, (_, at) => everyRung(at + 5)).flat();
  await damaged('missing', all, async () => {
    server.requests.length = 0;
    const { shown, fatal } = await played();
    assert.equal(fatal.length, 1);
    assert.match(fatal[0], /^10 parts of it in a row cannot be played: \d+\.m4s: the server has no such file$/);
    assert.deepEqual(shown.slice(0, 20).filter((rung) => rung < 0), []);
    assert.ok(asked().length < 80, `${asked().length} requests`);
  });
});

test('what is no ladder is said', async () => {
  const blob = new BlobBytes(new Blob([new Uint8Array(files['master.m3u8'])]), 'master.m3u8');
  await assert.rejects(openSource(blob, parser), { kind: 'unsupported', message: /from a server/ });
  for (const [name, changed, kind, says] of /** @type {[string, (text: string) => string, string, RegExp][]} */ ([
    ['rung-1/stream.m3u8', (text) => text.replace('ISV-FRAMES:4', 'ISV-FRAMES:5'), 'damaged', /other segments/],
    ['rung-0/stream.m3u8', (text) => text.replaceAll(/#EXT-X-ISV-FRAMES:\d+\n/g, ''), 'damaged', /how many frames/],
    ['rung-0/stream.m3u8', (text) => text.replace('#EXT-X-MAP', '#EXT-X-WHAT'), 'damaged', /no segments/],
    ['rung-0/stream.m3u8', (text) => text.replace('URI="init.mp4"', 'URI="stream.m3u8"'), 'damaged', /damaged/],
    ['rung-0/stream.m3u8', (text) => text.replace('URI="init.mp4"', 'URI="../sound/init.mp4"'), 'not-isv', /without isv geometry/],
    ['rung-0/stream.m3u8', () => '#EXTM3U', 'damaged', /no segments/],
    ['rung-0/stream.m3u8', () => 'hello', 'damaged', /does not begin/],
    ['master.m3u8', (text) => text.replaceAll('isv1.1.2', 'avc1.640028'), 'not-isv', /no isv geometry/],
    ['master.m3u8', (text) => text.replace('rung-0/stream', 'master'), 'damaged', /damaged/],
  ])) {
    const was = /** @type {Uint8Array} */ (server.files.get(name));
    server.files.set(name, Buffer.from(changed(Buffer.from(was).toString())));
    await assert.rejects(open(), (/** @type {any} */ error) => {
      assert.deepEqual([error.name, error.kind], ['IsvFailure', kind], `${name}: ${error.stack}`);
      assert.match(error.message, says);
      return true;
    }).finally(() => server.files.set(name, was));
  }
});

const BASE = 'https://example.org/takes/master.m3u8';

test('master playlists are parsed', () => {
  const text = `#EXTM3U\r
#EXT-X-MEDIA:TYPE=AUDIO,GROUP-ID="a",URI="s/other.m3u8"
#EXT-X-MEDIA:TYPE=AUDIO,GROUP-ID="a",DEFAULT=YES,NAME="x, y",URI="s/stream.m3u8"
#EXT-X-STREAM-INF:BANDWIDTH=1000,CODECS="isv1.1.2,opus",AUDIO="a"
low.m3u8
# a comment

#EXT-X-STREAM-INF:AVERAGE-BANDWIDTH=5,BANDWIDTH=9000,CODECS="isv1.1.2"
https://cdn.example.org/high.m3u8
#EXT-X-STREAM-INF:BANDWIDTH=5000,CODECS="avc1.640028"
picture.m3u8
`;
  const { rungs, sounds } = parseMaster(text, BASE);
  assert.deepEqual(rungs, [
    { url: 'https://cdn.example.org/high.m3u8', bandwidth: 9000, codecs: 'isv1.1.2', sound: null },
    { url: 'https://example.org/takes/low.m3u8', bandwidth: 1000, codecs: 'isv1.1.2,opus', sound: 'a' },
  ]);
  assert.deepEqual([...sounds], [['a', 'https://example.org/takes/s/stream.m3u8']]);
});

test('playlists that lie are refused', () => {
  const media = (/** @type {string} */ body) => `#EXTM3U\n#EXT-X-MAP:URI="i.mp4"\n${body}`;
  for (const [text, kind] of /** @type {[string, string][]} */ ([
    ['', 'damaged'],
    [media(''), 'damaged'],
    [media('0.m4s'), 'damaged'],
    [media('#EXTINF:0,\n0.m4s'), 'damaged'],
    [media('#EXTINF:-1,\n0.m4s'), 'damaged'],
    [media('#EXTINF:NaN,\n0.m4s'), 'damaged'],
    [media('#EXTINF:1e9,\n0.m4s'), 'damaged'],
    [media('#EXTINF:Infinity,\n0.m4s'), 'damaged'],
    [media('#EXT-X-ISV-FRAMES:1e9\n#EXTINF:1,\n0.m4s'), 'damaged'],
    [media('#EXT-X-ISV-FRAMES:1.5\n#EXTINF:1,\n0.m4s'), 'damaged'],
    [media('#EXTINF:1,\nfile:///etc/passwd'), 'damaged'],
    [media('#EXTINF:1,\njavascript:alert(1)'), 'damaged'],
    [media('#EXTINF:1,\ndata:,x'), 'damaged'],
    [media('#EXTINF:1,\nhttp://['), 'damaged'],
    [media('#EXT-X-BYTERANGE:5@0\n#EXTINF:1,\n0.m4s'), 'unsupported'],
    [media('#EXT-X-KEY:METHOD=AES-128,URI="k"\n#EXTINF:1,\n0.m4s'), 'unsupported'],
    [media('#EXT-X-MAP:URI="j.mp4"\n#EXTINF:1,\n0.m4s'), 'unsupported'],
    [media('#EXTINF:1,\n0.m4s\n'.repeat(140_000)), 'damaged'],
    [media('\n'.repeat(600_000)), 'damaged'],
    [media('#'.repeat(5_000_000)), 'damaged'],
  ]))
    assert.throws(() => parseMedia(text, BASE), { name: 'IsvFailure', kind }, text.slice(0, 80));
  for (const bandwidth of ['BANDWIDTH=0', 'BANDWIDTH=-5', 'BANDWIDTH=x', 'BANDWIDTH=1e99', 'CODECS="isv1"'])
    assert.throws(() => parseMaster(`#EXTM3U\n#EXT-X-STREAM-INF:${bandwidth}\na.m3u8`, BASE), { kind: 'damaged' }, bandwidth);
  const many = '#EXT-X-STREAM-INF:BANDWIDTH=1\na.m3u8\n'.repeat(20);
  assert.throws(() => parseMaster(`#EXTM3U\n${many}`, BASE), { kind: 'damaged' });
});

/** A choice among 8, 4, 2 and 1 Mbit/s, and what it chooses when it is asked. */
function ladder() {
  const choice = new Choice([8e6, 4e6, 2e6, 1e6]);
  const next = (speed = 1) => choice.next({ frameMs: 33, workers: 2, speed });
  /** A segment of a second over a line of so many bits a second. @param {number} line */
  const download = (line) => choice.downloaded([8e6, 4e6, 2e6, 1e6][choice.current] / 8, [8e6, 4e6, 2e6, 1e6][choice.current] / line);
  return { choice, next, download };
}

test('the right rung is found within two segments, up and down', () => {
  for (const [line, rung] of [
    [100e6, 0],
    [5.5e6, 1],
    [3e6, 2],
    [1.3e6, 3],
    [0.2e6, 3],
  ]) {
    const { next, download } = ladder();
    assert.equal(next(), 3, 'the lowest at first');
    download(line);
    assert.equal(next(), rung, `${line} after one`);
    for (let more = 0; more < 5; more++) {
      download(line);
      assert.equal(next(), rung, `${line}`);
    }
    for (let more = 0; more < 2; more++) {
      download(1.5e6);
      next();
    }
    assert.equal(next(), 3, `${line}, then 1.5 Mbit/s`);
  }
});

test('a throughput at the edge of a rung does not go up and down', () => {
  const { next, download } = ladder();
  next();
  const chosen = new Set();
  for (let segment = 0; segment < 40; segment++) {
    download(segment % 2 ? 4.6e6 : 5.1e6);
    if (segment > 2) chosen.add(next());
    else next();
  }
  assert.equal(chosen.size, 1);
});

test('a slow device gets what it can decode, and is not asked for more again and again', () => {
  const { choice, next, download } = ladder();
  next();
  download(100e6);
  assert.equal(next(), 0);
  for (let frame = 0; frame < 30; frame++) choice.decoded(0, 90);
  assert.equal(next(), 1);
  for (let frame = 0; frame < 30; frame++) choice.decoded(1, 55);
  for (let segment = 0; segment < 20; segment++) {
    download(100e6);
    assert.equal(next(), 1);
  }
});

test('a device that was slow for a moment is asked for more later', () => {
  const { choice, next, download } = ladder();
  next();
  download(100e6);
  next();
  for (let frame = 0; frame < 20; frame++) choice.decoded(0, 90);
  assert.equal(next(), 1);
  for (let frame = 0; frame < 400; frame++) choice.decoded(1, 10);
  assert.equal(next(), 0);
});

test('at twice the speed there is half the room', () => {
  const { next, download } = ladder();
  next();
  download(5.5e6);
  assert.equal(next(2), 2);
});

test('a download that would keep the playhead waiting is given up for a lower rung, if that is sooner there', () => {
  const { choice } = ladder();
  const download = { rung: 0, bytes: 1e6, got: 1e5, passed: 1, ahead: 2, seconds: 1 };
  assert.equal(choice.instead(download), 2, '2 Mbit are there in 2.5 s of 9');
  assert.equal(choice.instead({ ...download, ahead: 10 }), null, 'there is time');
  assert.equal(choice.instead({ ...download, passed: 0.1 }), null, 'it has only begun');
  assert.equal(choice.instead({ ...download, got: 9.5e5 }), null, 'it is almost there');
  assert.equal(choice.instead({ ...download, rung: 3 }), null, 'there is no lower one');
});
