// A take as a ladder of rates: the same frames in several qualities, cut into segments that begin with a keyframe.

import { IsvFailure, LostPart } from '../failure.js';
import { FrameTimes } from '../frame-times.js';
import { Gops } from '../gops.js';
import { METADATA_LIMIT, metadataOf } from '../metadata.js';
import { Box, boxAt, broken } from '../mp4/boxes.js';
import { addSamples, noSamples, tracksIn } from '../mp4/fragments.js';
import { codecOf, readMovie, soundsOf } from '../mp4/movie.js';
import { attempts } from './attempts.js';
import { Choice } from './choice.js';
import { download } from './download.js';
import { PLAYLIST_LIMIT, isMaster, parseMaster, parseMedia } from './playlist.js';

/** @typedef {import('./playlist.js').Media} Media @typedef {import('../source.js').StreamFacts} StreamFacts @typedef {import('../source.js').Source} Source */

const STREAM_HEADER_BYTES = 48;
const PACKET_HEADER_BYTES = 24;
/** Largest header of a track, and largest segment. */
const INIT_LIMIT = 1 << 22;
const SEGMENT_LIMIT = 1 << 28;
/** Most frames of all segments. */
const FRAME_LIMIT = 1 << 23;
/** Bytes of segments kept, and how many are kept whatever they have. */
const KEPT_BYTES = 1 << 25;
const KEPT = 4;
/** Seconds by which a segment's own time may differ from what the playlist says. */
const TRUSTED = 0.5;

/**
 * Rungs of a ladder.
 * @typedef {object} Rungs
 * @property {{ bandwidth: number, codecs: string }[]} all the best first
 * @property {number} shown the rung of the frame that is shown; -1 before the first
 * @property {number} throughput bits a second that the network gives; 0 until that is known
 *
 * @typedef {object} Rung
 * @property {number} bandwidth bits a second
 * @property {string} codecs as the playlist has them
 * @property {Media} media
 * @property {import('../mp4/movie.js').Track} track
 *
 * @typedef {{ bytes: number }} Meter bytes downloaded so far
 *
 * @typedef {object} Loading a segment, or what will be one
 * @property {number} rung
 * @property {Promise<Uint8Array[]>} packets
 * @property {number} bytes 0 until it is there
 * @property {number} waiting how many wait for it
 * @property {AbortController} abort
 */

/** @implements {Source} */
export class LadderSource {
  /** @type {Rungs} */
  rungs;
  indexed = true;
  /** Place and speed of the playhead. */
  #playhead = { seconds: 0, speed: 1, workers: 1 };
  #rungs;
  #meter;
  #choice;
  /** First frame of each segment, and one more. */
  #firsts;
  /** The rung that each segment comes from; -1 before that is known. */
  #chosen;
  /** Rungs that a segment is not whole in, a bit each. */
  #spoiled;
  /** Rungs whose last segment could not be had: the next one is tried once only. @type {Set<number>} */
  #failing = new Set();
  /** Segments by number, in order of last use. @type {Map<number, Loading>} */
  #segments = new Map();
  /** Settles when the download before has ended. @type {Promise<unknown>} */
  #queue = Promise.resolve();
  #closing = new AbortController();

  /**
   * @param {string} name
   * @param {Rung[]} rungs
   * @param {{ headers: Uint8Array[], facts: StreamFacts[], metadata: import('../metadata.js').Metadata, all: Rungs['all'],
   *   sound: import('../sound/tracks.js').SoundTracks | null, silence?: string, meter: Meter }} what
   */
  constructor(name, rungs, { headers, facts, metadata, sound, silence, all, meter }) {
    this.name = name;
    this.headers = headers;
    this.facts = facts;
    this.metadata = metadata;
    this.sound = sound;
    this.silence = silence;
    this.rungs = { all, shown: -1, throughput: 0 };
    this.#rungs = rungs;
    this.#meter = meter;
    this.#choice = new Choice(rungs.map(({ bandwidth }) => bandwidth));
    const { segments } = rungs[0].media;
    this.#chosen = new Int8Array(segments.length).fill(-1);
    this.#spoiled = new Uint16Array(segments.length);
    this.#firsts = new Float64Array(segments.length + 1);
    const starts = [0];
    /** @type {number[]} */
    const keyframes = [];
    segments.forEach(({ frames, seconds }, at) => {
      const first = this.#firsts[at];
      const begin = starts[first];
      for (let frame = 1; frame <= frames; frame++) starts[first + frame] = begin + (seconds * frame) / frames;
      for (let frame = 0; frame < frames; frame++) keyframes.push(frame ? 0 : 1);
      this.#firsts[at + 1] = first + frames;
    });
    this.times = new FrameTimes(Float64Array.from(starts));
    this.gops = new Gops(keyframes);
  }

  /**
   * Opens a ladder, or a single playlist as one of one rung.
   * @param {import('../ranges.js').Bytes & { url?: string }} bytes of its playlist, that are open
   * @param {number} length
   * @param {import('../source.js').Parser | Promise<import('../source.js').Parser>} parser
   * @returns {Promise<LadderSource>}
   */
  static async open(bytes, length, parser) {
    if (bytes.url === undefined) throw new IsvFailure('unsupported', `${bytes.name} is a playlist: it plays from a server, with its segments`);
    if (length > PLAYLIST_LIMIT) throw broken(`a playlist of ${length} bytes`);
    const url = new URL(bytes.url, globalThis.location?.href).href;
    const text = new TextDecoder().decode(await bytes.read(0, length));
    const master = isMaster(text) ? parseMaster(text, url) : { rungs: [{ url, bandwidth: 1, codecs: '', sound: null }], sounds: new Map() };
    const soundUrl = [...master.sounds.values()][0];
    const meter = { bytes: 0 };
    const [rungs, { sound, silence }] = await Promise.all([
      thoseThere(master.rungs.map((rung) => readRung(rung, rung.url === url ? text : undefined))),
      soundUrl === undefined ? { sound: null, silence: undefined } : soundThere(readSound(master.sounds.get(master.rungs[0].sound ?? '') ?? soundUrl, meter)),
    ]);
    checkAligned(rungs);
    const parse = await parser;
    return new LadderSource(bytes.name, rungs, {
      headers: rungs.map(({ isvC }) => isvC.slice(0, STREAM_HEADER_BYTES)),
      facts: rungs.map(({ isvC }) => opened(parse, isvC.slice(0, STREAM_HEADER_BYTES), bytes.name)),
      metadata: metadataOf(rungs[0].isvC.subarray(STREAM_HEADER_BYTES, METADATA_LIMIT)),
      all: rungs.map(({ bandwidth, codecs }) => ({ bandwidth, codecs })),
      sound,
      silence,
      meter,
    });
  }

  get frames() {
    return this.gops.frames;
  }

  /** @param {number} frame */
  streamOf(frame) {
    return Math.max(0, this.#chosen[this.#segmentOf(frame)]);
  }

  offsetOf() {
    return 0;
  }

  /** Bytes by the rate of the rung that is downloaded. @param {number} from @param {number} to */
  bytesBetween(from, to) {
    const { starts } = this.times;
    const seconds = starts[Math.min(to, this.frames)] - starts[Math.max(0, from)];
    return (seconds * this.#rungs[this.#choice.current].bandwidth) / 8;
  }

  /** Says where the playhead is, how fast it goes, and how many decode. @param {{ seconds: number, speed: number, workers: number }} playhead */
  attend(playhead) {
    this.#playhead = playhead;
  }

  /** @param {number} stream @param {number} [frame] that comes from it: a better rung may lack it */
  outdated(stream, frame) {
    const { current } = this.#choice;
    return stream > (frame === undefined ? current : (this.#soundRung(this.#segmentOf(frame), current) ?? current));
  }

  /** Learns how long a frame took. @param {import('../worker.js').Frame} frame */
  measured({ stream, decodeMs, surfaceMs }) {
    this.#choice.decoded(stream, decodeMs + surfaceMs);
  }

  /** Notes that a frame cannot be decoded from the rung that it came from. @param {number} frame @returns {boolean} whether another rung may have it */
  spoil(frame) {
    const segment = this.#segmentOf(frame);
    const rung = this.#chosen[segment];
    if (rung < 0) return false;
    this.#spoiled[segment] |= 1 << rung;
    const held = this.#segments.get(segment);
    if (held?.rung === rung) this.#drop(segment, held);
    return this.#soundRung(segment, rung) !== null;
  }

  /**
   * A frame's packet. Rejects with a `LostPart` where no rung has its segment whole.
   * @param {number} frame
   * @param {AbortSignal} [signal]
   */
  async packet(frame, signal) {
    const segment = this.#segmentOf(frame);
    const within = frame - this.#firsts[segment];
    const packets = await this.#segment(segment, within > 0, signal);
    return packets[within].slice();
  }

  close() {
    this.#closing.abort();
    this.#segments.clear();
  }

  /** @param {number} frame */
  #segmentOf(frame) {
    return this.gops.indexOf(frame);
  }

  /**
   * @param {number} number
   * @param {boolean} begun whether frames of it have been decoded: then the rest comes from the same rung
   * @param {AbortSignal} [signal]
   * @returns {Promise<Uint8Array[]>} its packets
   */
  async #segment(number, begun, signal) {
    const held = this.#segments.get(number);
    if (held?.bytes && !begun && !held.waiting && this.outdated(held.rung, this.#firsts[number])) this.#drop(number, held);
    const loading = this.#segments.get(number) ?? this.#begin(number, begun && this.#chosen[number] >= 0 ? this.#chosen[number] : null);
    // Moves it to the end: it is the one used last.
    this.#segments.delete(number);
    this.#segments.set(number, loading);
    loading.waiting++;
    const leave = () => {
      // Nobody wants it any more.
      if (--loading.waiting === 0 && !loading.bytes) this.#drop(number, loading);
    };
    signal?.addEventListener('abort', leave, { once: true });
    try {
      const packets = await loading.packets;
      signal?.throwIfAborted();
      return packets;
    } finally {
      signal?.removeEventListener('abort', leave);
      if (!signal?.aborted) loading.waiting--;
    }
  }

  /** @param {number} number @param {Loading} loading */
  #drop(number, loading) {
    loading.abort.abort();
    if (this.#segments.get(number) === loading) this.#segments.delete(number);
  }

  /** Has a segment downloaded when those before it are. @param {number} number @param {number | null} rung null if it is free to choose @returns {Loading} */
  #begin(number, rung) {
    const abort = new AbortController();
    const signal = AbortSignal.any([abort.signal, this.#closing.signal]);
    /** @type {Loading} */
    const loading = { rung: -1, packets: Promise.resolve([]), bytes: 0, waiting: 0, abort };
    const before = this.#queue;
    loading.packets = (async () => {
      await before.catch(() => {});
      signal.throwIfAborted();
      const frameMs = 1000 / this.facts[0].fps;
      return this.#load(number, loading, rung ?? this.#choice.next({ frameMs, ...this.#playhead }), signal);
    })();
    this.#queue = loading.packets;
    loading.packets.catch(() => this.#drop(number, loading));
    return loading;
  }

  /**
   * Gets a segment of a rung, or of another where that is missing or damaged.
   * @param {number} number
   * @param {Loading} loading
   * @param {number} wanted
   * @param {AbortSignal} signal
   * @returns {Promise<Uint8Array[]>}
   */
  async #load(number, loading, wanted, signal) {
    /** What was wrong with the rung that was wanted. @type {LostPart | null} */
    let failure = null;
    let rung = this.#soundRung(number, wanted);
    while (rung !== null) {
      try {
        const packets = await this.#fromRung(number, loading, { rung, once: failure !== null || this.#failing.has(rung) }, signal);
        if (typeof packets !== 'number') return packets;
        this.#choice.current = rung = packets;
      } catch (error) {
        if (!(error instanceof LostPart)) throw error;
        failure ??= error;
        this.#failing.add(rung);
        this.#spoiled[number] |= 1 << rung;
        rung = this.#soundRung(number, rung);
      }
    }
    // Whoever asks once more has every rung tried again.
    this.#spoiled[number] = 0;
    throw failure ?? new LostPart('damaged', 'no rung has it whole');
  }

  /** The rung to take a segment from instead of one that is spoiled: a lower one is there sooner. @param {number} number @param {number} rung */
  #soundRung(number, rung) {
    const lower = this.#rungs.slice(rung).map((_, at) => rung + at);
    const higher = this.#rungs.slice(0, rung).map((_, at) => rung - 1 - at);
    return [...lower, ...higher].find((one) => !(this.#spoiled[number] & (1 << one))) ?? null;
  }

  /**
   * @param {number} number
   * @param {Loading} loading
   * @param {{ rung: number, once: boolean }} from once: whether it is tried only once
   * @param {AbortSignal} signal
   * @returns {Promise<Uint8Array[] | number>} its packets, or the lower rung that it was given up for
   */
  async #fromRung(number, loading, { rung, once }, signal) {
    const { media, track } = this.#rungs[rung];
    const { url, frames } = media.segments[number];
    const how = { signal, witness: media.init, once };
    const got = await attempts(url, async (again) => {
      const bytes = await this.#download(number, rung, signal, again);
      return typeof bytes === 'number' ? bytes : { bytes: bytes.length, ...readSegment(bytes, track, frames) };
    }, how);
    if (typeof got === 'number') return got;
    this.#refine(number, got.starts);
    this.#failing.delete(rung);
    loading.rung = rung;
    loading.bytes = got.bytes;
    this.#chosen[number] = rung;
    this.#trim();
    return got.packets;
  }

  /**
   * @param {number} number
   * @param {number} rung
   * @param {AbortSignal} signal
   * @param {boolean} again whether an earlier download of it failed
   * @returns {Promise<Uint8Array | number>} a segment, or the lower rung that it was given up for
   */
  async #download(number, rung, signal, again) {
    const { media, bandwidth } = this.#rungs[rung];
    const { url, seconds } = media.segments[number];
    const begun = performance.now();
    const giveUp = new AbortController();
    /** @type {number | null} */
    let lower = null;
    let got = 0;
    const before = this.#meter.bytes;
    const look = (/** @type {number} */ length) => {
      const passed = (performance.now() - begun) / 1000;
      const ahead = (this.times.starts[this.#firsts[number]] - this.#playhead.seconds) / this.#playhead.speed;
      const bytes = length || (bandwidth * seconds) / 8;
      lower ??= this.#choice.instead({ rung, bytes, got, passed, ahead, seconds });
      if (lower !== null && this.#spoiled[number] & (1 << lower)) lower = null;
      if (lower !== null) giveUp.abort();
    };
    // A network that gives nothing makes no progress.
    const timer = setInterval(() => look(0), 200);
    try {
      const bytes = await download(url, {
        limit: SEGMENT_LIMIT,
        signal: AbortSignal.any([signal, giveUp.signal]),
        again,
        progress: (all, length) => {
          this.#meter.bytes += all - got;
          got = all;
          look(length);
        },
      });
      this.#note(before, begun);
      return bytes;
    } catch (error) {
      if (got || lower !== null) this.#note(before, begun);
      if (lower === null || signal.aborted) throw error;
      return lower;
    } finally {
      clearInterval(timer);
    }
  }

  /** Notes what the network gave, to sound as well. @param {number} before bytes that the meter showed @param {number} begun ms */
  #note(before, begun) {
    this.#choice.downloaded(this.#meter.bytes - before, (performance.now() - begun) / 1000);
    this.rungs.throughput = this.#choice.throughput;
  }

  /** Takes a segment's times, which are exact. @param {number} number @param {number[]} starts in seconds, one more than frames */
  #refine(number, starts) {
    const first = this.#firsts[number];
    const stated = this.times.starts[first];
    const end = this.times.starts[this.#firsts[number + 1]];
    const shift = Math.abs(starts[0] - stated) < TRUSTED ? 0 : stated - starts[0];
    const last = starts.length - 1;
    const exact = starts.map((start) => start + shift);
    // What follows begins when the playlist says, as its own segment may not have been read.
    this.times.refine(first, exact.slice(0, last).map((start) => Math.min(start, end)));
  }

  #trim() {
    const held = () => [...this.#segments.values()].reduce((sum, { bytes }) => sum + bytes, 0);
    for (const [number, { bytes, waiting }] of [...this.#segments]) {
      if (this.#segments.size <= KEPT || held() <= KEPT_BYTES) return;
      if (bytes && !waiting) this.#segments.delete(number);
    }
  }
}

/** @param {import('./playlist.js').RungFacts} rung @param {string} [text] of its playlist, if that is there @returns {Promise<Rung & { isvC: Uint8Array }>} */
async function readRung({ url, bandwidth, codecs }, text) {
  const media = parseMedia(text ?? (await downloadText(url)), url);
  const { ftyp, moov } = await readInit(media.init);
  const { geometry, isvC } = readMovie(moov, ftyp, 'the playlist');
  return { bandwidth, codecs, media, track: geometry, isvC };
}

/**
 * Those rungs whose playlist and header the server has. It rejects where there are none, and where one is not what it should be.
 * @template T
 * @param {Promise<T>[]} rungs
 */
async function thoseThere(rungs) {
  const read = await Promise.allSettled(rungs);
  const failed = read.filter((one) => one.status === 'rejected').map(({ reason }) => reason);
  const wrong = failed.find((reason) => !(reason instanceof IsvFailure && reason.kind === 'missing'));
  if (wrong || failed.length === rungs.length) throw wrong ?? failed[0];
  return read.filter((one) => one.status === 'fulfilled').map(({ value }) => value);
}

/**
 * Sound of which the server has playlist and header, or why there is none: the take can be played without.
 * @param {ReturnType<typeof readSound>} reading
 * @returns {Promise<{ sound: Awaited<ReturnType<typeof readSound>>, silence?: string }>}
 */
async function soundThere(reading) {
  try {
    return { sound: await reading };
  } catch (error) {
    if (!(error instanceof IsvFailure && error.kind === 'missing')) throw error;
    return { sound: null, silence: error.message };
  }
}

/** @param {string} url of a playlist @param {Meter} meter @returns {Promise<import('../sound/tracks.js').SoundTracks | null>} */
async function readSound(url, meter) {
  const media = parseMedia(await downloadText(url), url);
  const { moov, bytes } = await readInit(media.init);
  const track = soundsOf(moov)[0];
  if (!track) return null;
  const starts = new Float64Array(media.segments.length);
  for (let at = 1; at < starts.length; at++) starts[at] = starts[at - 1] + media.segments[at - 1].seconds;
  return [
    {
      codec: codecOf(track),
      begin: 0,
      starts,
      init: async () => bytes,
      fragment: (at, signal) => {
        const { url } = media.segments[at];
        return attempts(url, async (again) => checkSound(await downloadMetered(url, meter, signal, again), track), { signal, witness: media.init });
      },
    },
  ];
}

/** @param {string} url @param {Meter} meter @param {AbortSignal} signal @param {boolean} again */
function downloadMetered(url, meter, signal, again) {
  let before = 0;
  const progress = (/** @type {number} */ got) => {
    meter.bytes += got - before;
    before = got;
  };
  return download(url, { limit: SEGMENT_LIMIT, signal, again, progress });
}

/** @param {string} url */
async function downloadText(url) {
  return new TextDecoder().decode(await download(url, { limit: PLAYLIST_LIMIT }));
}

/** @param {string} url @returns {Promise<{ bytes: Uint8Array, ftyp: Uint8Array, moov: Box }>} */
async function readInit(url) {
  const bytes = await download(url, { limit: INIT_LIMIT });
  const boxes = new Box(bytes, 'file', 0, 0, bytes.length).children();
  const moov = boxes.find(({ type }) => type === 'moov');
  if (!moov) throw broken('a header has no tracks');
  return { bytes, ftyp: boxes.find(({ type }) => type === 'ftyp')?.whole ?? new Uint8Array(), moov };
}

/** Every rung has the same frames in the same segments. @param {Rung[]} rungs */
function checkAligned(rungs) {
  const [best] = rungs;
  const frames = best.media.segments.reduce((sum, segment) => sum + segment.frames, 0);
  if (best.media.segments.some((segment) => segment.frames === 0)) throw broken('the playlist does not say how many frames segments have');
  if (frames > FRAME_LIMIT) throw broken('it has too many frames');
  for (const { media } of rungs) {
    const same = media.segments.length === best.media.segments.length && media.segments.every(({ frames }, at) => frames === best.media.segments[at].frames);
    if (!same) throw broken('rungs have other segments than the best one');
  }
}

/** Packets of a segment, and when they are shown in seconds. @param {Uint8Array} bytes @param {import('../mp4/movie.js').Track} track @param {number} frames */
function readSegment(bytes, track, frames) {
  const { samples } = samplesOf(bytes, track, PACKET_HEADER_BYTES);
  if (samples.offsets.length !== frames || !samples.keyframes[0]) throw broken('a segment has other frames than the playlist says');
  const packets = samples.offsets.map((offset, frame) => bytes.subarray(offset, offset + samples.sizes[frame]));
  return { packets, starts: samples.starts.map((start) => start / track.timescale) };
}

/** Makes sure that a segment of sound is whole: a browser that is given another plays no sound any more. @param {Uint8Array} bytes @param {import('../mp4/movie.js').Track} track */
function checkSound(bytes, track) {
  const { samples, all } = samplesOf(bytes, track, 1);
  if (!all || !samples.offsets.length) throw broken('a segment of sound is not whole');
  return bytes;
}

/** Samples of a segment, and whether all of them are there. @param {Uint8Array} bytes @param {import('../mp4/movie.js').Track} track @param {number} least bytes of a sample */
function samplesOf(bytes, track, least) {
  const samples = noSamples();
  let all = true;
  for (let at = 0; at < bytes.length; ) {
    const box = boxAt(bytes, at);
    at = box.end;
    if (box.type !== 'moof') continue;
    for (const { track: id, traf, time } of tracksIn(box))
      if (id === track.id) all &&= addSamples(samples, traf, { track, moofAt: box.start, time, length: bytes.length, least });
  }
  return { samples, all };
}

/** @param {import('../source.js').Parser} parse @param {Uint8Array} header @param {string} name */
function opened(parse, header, name) {
  try {
    return parse.open(header);
  } catch (cause) {
    const why = /** @type {Error} */ (cause).message;
    throw new IsvFailure('not-isv', `${name} has a rung that this player does not know: ${why}`, { cause });
  }
}
