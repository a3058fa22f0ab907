// Decodes ahead of the playhead: deals runs of whole GOPs to workers and keeps what they give in a ring, bounded in bytes.
// The frame under the playhead always comes first: until it is there, nothing else is begun.

import { allowanceOf, refusal } from './allowance.js';
import { IsvFailure, LostPart, isAbort, words } from './failure.js';
import { Lane, Task } from './lane.js';
import { Ring } from './ring.js';

/** Part of the ring that frames ahead may fill; the rest is for those just shown and for frames larger than the mean. */
const AHEAD_PART = 0.75;
/** Frames ahead until it is known how large they are. */
const FIRST_WINDOW = 8;
/** How far ahead the clock looks for missing frames. */
const GATE_FRAMES = 32;
/** Waits in ms before a read that failed is tried again, the last one over and over. */
const RETRIES = [500, 1000, 2000, 4000, 8000];
/** Most parts of a take that are passed over one after the other: behind so many, the rest is not worth asking for. */
const MOST_PASSED = 10;

/**
 * @typedef {import('./worker.js').Frame} Frame
 * @typedef {{ frame: number, resumes: number, message: string, refused: boolean, missing: boolean }} LostFrames frames `frame` to before
 *   `resumes` cannot be shown: they are damaged, `missing` from the server, or `refused` as they need more memory than the decoder may have
 * @typedef {object} Events
 * @property {(frame: number) => void} [frame] a frame has come
 * @property {(lost: LostFrames) => void} [lost]
 * @property {(error: Error, fatal: boolean) => void} [failed] bytes cannot be read, which is tried again; or, fatal, no decoder works
 * @property {() => void} [recovered] they can be read again
 */

export class DecodeAhead {
  /** Frames that cannot be decoded, and why. @type {Map<number, string>} */
  lost = new Map();
  /** Those of them that are sound but need more memory than the decoder may have. @type {Set<number>} */
  refused = new Set();
  /** Those of them that a server did not have. @type {Set<number>} */
  #absent = new Set();
  loop = true;
  details = false;
  /** Settles when a decoder works, or none ever will. @type {Promise<void>} */
  begun;
  #settle = () => {};
  /** The frame under the playhead. */
  target = 0;
  /** How many frames before the target are wanted, too, as when stepping back. */
  behind = 0;
  #source;
  #gops;
  /** Who hears of what happens. @type {Events | null} */
  #on;
  /** What happened before anyone did. @type {(() => void)[]} */
  #unheard = [];
  /** Whether nothing but the target is decoded. */
  #hurried = false;
  #ring;
  /** @type {Lane[]} */
  #lanes = [];
  #tasks = 0;
  #failures = 0;
  /** Parts of a ladder that were passed over since a frame was decoded last. */
  #passed = 0;
  /** Why nothing more is read; null while it is. Frames that are there are still shown. @type {IsvFailure | null} */
  #hopeless = null;
  #retrying = /** @type {ReturnType<typeof setTimeout> | null} */ (null);
  #broken = false;
  /** Frames for which there was no room beside nearer ones. Decoding them again would end the same way while these are wanted. @type {Set<number>} */
  #noRoom = new Set();
  #allowance;

  /**
   * @param {object} options
   * @param {import('./source.js').Source} options.source
   * @param {WebAssembly.Module} options.module
   * @param {() => import('./lane.js').Port} options.spawn starts a worker
   * @param {number} options.workers
   * @param {number} options.budget bytes
   * @param {import('./allowance.js').Allowance} [options.allowance] memory of the decoders
   * @param {Events} [options.on] without it, {@link DecodeAhead.listen} is told what happened until then
   */
  constructor({ source, module, spawn, workers, budget, allowance = allowanceOf(), on }) {
    this.#source = source;
    this.#allowance = allowance;
    this.#gops = source.gops;
    this.#on = on ?? null;
    /** @type {Ring<Frame>} */
    this.#ring = new Ring(budget);
    const start = { module, header: source.headers[0], allowance };
    this.begun = new Promise((resolve) => (this.#settle = resolve));
    const answers = {
      ready: () => this.#settle(),
      done: this.#done.bind(this),
      lost: this.#lose.bind(this),
      broken: this.#break.bind(this),
    };
    const useful = Math.min(workers, this.#gops.runs.length || 1);
    for (let lane = 0; lane < useful; lane++) this.#lanes.push(new Lane(spawn(), start, answers));
  }

  /** The file. */
  get source() {
    return this.#source;
  }

  get bytes() {
    return this.#ring.bytes;
  }

  get budget() {
    return this.#ring.budget;
  }

  /** How many frames are held. */
  get held() {
    return this.#ring.size;
  }

  /** How many workers decode. */
  get workers() {
    return this.#lanes.length;
  }

  /** Moves the playhead. @param {number} frame @param {{ loop?: boolean, behind?: number }} [options] */
  aim(frame, { loop = this.loop, behind = 0 } = {}) {
    if (frame === this.target && loop === this.loop && behind === this.behind) return;
    if (frame !== this.target) this.#leave(this.target);
    this.#noRoom.clear();
    this.target = frame;
    this.loop = loop;
    this.behind = behind;
    this.#deal();
    this.#giveUp();
  }

  /** Frees a frame that has been passed, if there would be a better one by the next time. @param {number} frame */
  #leave(frame) {
    const passed = this.#ring.get(frame);
    if (passed && this.#source.outdated?.(passed.stream, frame)) this.#ring.drop(frame);
  }

  /** @param {Events} on */
  listen(on) {
    this.#on = on;
    for (const tell of this.#unheard.splice(0)) tell();
  }

  /** Decodes nothing but the target until {@link DecodeAhead.release}: it has the processors to itself, and so has the drawing of it. */
  hurry() {
    if (this.settled(this.target)) this.release();
    else this.#hurried = true;
  }

  /** The target's picture has been drawn. */
  release() {
    if (!this.#hurried) return;
    this.#hurried = false;
    this.#noRoom.clear();
    this.#deal();
  }

  /** Asks a server again for what it did not have: it may have it now. A ladder that was given up gets another chance. */
  askAgain() {
    if (!this.#absent.size && !this.#hopeless) return;
    for (const frame of this.#absent) this.lost.delete(frame);
    this.#absent.clear();
    this.#hope();
    this.#deal();
  }

  /** Reads on, though parts before could not be played: as many are passed over again before it is given up. */
  #hope() {
    this.#hopeless = null;
    this.#passed = 0;
  }

  /** Begins to decode; later, is called whenever something has changed. */
  start() {
    this.#deal();
  }

  /** @param {number} frame @returns {Frame | undefined} */
  get(frame) {
    return this.#ring.get(frame);
  }

  /** Whether a frame need not be waited for: it is there, or never will be. @param {number} frame */
  settled(frame) {
    return this.#ring.has(frame) || this.lost.has(frame);
  }

  /** First frame after one that would have to be waited for, counted on past the end when it goes round. @param {number} frame @returns {number} Infinity if it is far off */
  firstMissing(frame) {
    const frames = this.#gops.frames;
    for (let next = frame; next <= frame + GATE_FRAMES; next++) {
      if (next >= frames && !this.loop) return Infinity;
      if (!this.settled(next % frames)) return next;
    }
    return Infinity;
  }

  /** Whether frames from one on are there: so many, or as many as fit into memory. @param {number} frame @param {number} frames */
  hasAhead(frame, frames) {
    return this.#missing(frame, Math.min(frame + frames, frame + this.#window, this.#gops.frames)) < 0;
  }

  /** Spans `[from, to)` of frames that are there, ascending. @returns {[number, number][]} */
  spans() {
    /** @type {[number, number][]} */
    const spans = [];
    for (const frame of [...this.#ring.numbers()].sort((a, b) => a - b)) {
      const last = spans[spans.length - 1];
      if (last && last[1] === frame) last[1]++;
      else spans.push([frame, frame + 1]);
    }
    return spans;
  }

  /** Whether frames come with details of their blocks. All are decoded again. @param {boolean} wanted */
  setDetails(wanted) {
    if (wanted === this.details) return;
    this.details = wanted;
    if (!wanted) return; // Frames that have them do no harm.
    this.#ring.clear();
    this.#noRoom.clear();
    // What was there is gone: without another try nothing would ever be shown.
    this.#hope();
    for (const lane of this.#lanes) lane.cancel();
    this.#deal();
  }

  close() {
    this.#broken = true;
    this.#settle();
    if (this.#retrying !== null) clearTimeout(this.#retrying);
    for (const lane of this.#lanes) lane.close();
    this.#ring.clear();
  }

  /** How many frames from the target on are wanted. */
  get #window() {
    if (this.#hurried) return 1;
    const frames = this.#gops.frames;
    const mean = this.#ring.meanBytes;
    if (!mean) return Math.min(frames, FIRST_WINDOW);
    const { room } = this.#ring;
    if (mean * frames * 1.05 <= room) return frames;
    return Math.min(frames, Math.max(2, Math.floor((room * AHEAD_PART) / mean)));
  }

  /** The frames that are wanted, as spans, most urgent first. @returns {[number, number][]} */
  #wanted() {
    const frames = this.#gops.frames;
    const end = this.target + this.#window;
    /** @type {[number, number][]} */
    const spans = [[this.target, Math.min(frames, end)]];
    if (this.loop && end > frames) spans.push([0, Math.min(end - frames, this.target)]);
    if (this.behind > 0) spans.push([Math.max(0, this.target - this.behind), this.target]);
    return spans;
  }

  /** First frame of a span that is neither there nor lost and has room, -1 if there is none. @param {number} from @param {number} to */
  #missing(from, to) {
    for (let frame = from; frame < to; frame++) if (!this.settled(frame) && !this.#noRoom.has(frame)) return frame;
    return -1;
  }

  /** The next wanted frame in `[from, end)`, -1 if there is none. @param {number} from @param {number} end */
  #nextWanted(from, end) {
    const found = this.#wanted()
      .map(([first, last]) => this.#missing(Math.max(first, from), Math.min(last, end)))
      .filter((frame) => frame >= 0);
    return found.length ? Math.min(...found) : -1;
  }

  /** Gives work to workers that have none, and takes it from one if the target would wait otherwise. */
  #deal() {
    if (this.#broken || this.#hopeless || this.#retrying !== null) return;
    if (!this.settled(this.target)) this.#dropUnwanted();
    for (const [from, to] of this.#wanted()) {
      for (let frame = this.#missing(from, to); frame >= 0; frame = this.#missing(frame, to)) {
        if (this.#gops.runOf(frame) < 0) {
          this.#loseUntilKeyframe(frame, 'there is no keyframe before it');
          continue;
        }
        const urgent = frame === this.target;
        if (!this.#isComing(frame)) {
          const lane = this.#idleLane(frame) ?? (urgent ? this.#leastUseful(frame) : null);
          if (!lane) return;
          this.#work(lane, frame);
        }
        if (urgent) return;
        frame = this.#gops.runEnd(frame);
      }
    }
  }

  /** After a seek: takes from workers what is no longer wanted, so that it does not slow down what is. */
  #dropUnwanted() {
    const wanted = (/** @type {number} */ frame) => this.#wanted().some(([from, to]) => from <= frame && frame < to);
    for (const lane of this.#lanes) {
      const comes = [...lane.coming].some(wanted) || (lane.task && this.#nextWanted(lane.task.at, lane.task.end) >= 0);
      if (!comes && (lane.task || lane.coming.size)) lane.cancel();
    }
  }

  /** Whether a worker is on its way to a frame. @param {number} frame */
  #isComing(frame) {
    return this.#lanes.some(({ task, coming }) => coming.has(frame) || (task && task.at <= frame && frame < task.end));
  }

  /** The idle worker that has the least to decode before a frame. @param {number} frame */
  #idleLane(frame) {
    const idle = this.#lanes.filter(({ task }) => !task);
    return idle.sort((a, b) => frame - this.#begin(b, frame) - (frame - this.#begin(a, frame)))[idle.length - 1];
  }

  /** Where a worker would begin in order to come to a frame. @param {Lane} lane @param {number} frame */
  #begin(lane, frame) {
    const keyframe = this.#gops.keyframeOf(frame);
    return lane.next > keyframe && lane.next <= frame ? lane.next : keyframe;
  }

  /** A busy worker, freed: one that is in the target's own run, or else the one that is farthest ahead. @param {number} frame */
  #leastUseful(frame) {
    const run = this.#gops.runOf(frame);
    const urgency = (/** @type {Lane} */ { task }) =>
      task && this.#gops.runOf(task.at) === run ? Infinity : this.#distance(task?.at ?? 0);
    const lane = [...this.#lanes].sort((a, b) => urgency(b) - urgency(a))[0];
    lane.cancel();
    return lane;
  }

  /** Decodes what is wanted from a frame to the end of its run. @param {Lane} lane @param {number} frame */
  async #work(lane, frame) {
    const task = new Task(++this.#tasks, this.#begin(lane, frame), this.#gops.runEnd(frame));
    lane.task = task;
    try {
      for (;;) {
        const wanted = this.#nextWanted(task.at, task.end);
        if (wanted < 0) break;
        task.at = Math.max(task.at, this.#gops.keyframeOf(wanted));
        const packet = await this.#source.packet(task.at, task.cancelling.signal);
        const at = this.#source.offsetOf(task.at);
        const stream = this.#source.streamOf(task.at);
        const keyframe = this.#gops.keyframeOf(task.at);
        if (stream !== lane.stream && lane.next === task.at && task.at > keyframe) {
          // The rest of a GOP comes from another rung now: it is decoded from its beginning.
          task.at = keyframe;
          continue;
        }
        await lane.room();
        if (task.cancelled) return;
        this.#readAgain();
        const surface = this.#nextWanted(task.at, task.at + 1) === task.at;
        lane.decode({ frame: task.at, packet, at, surface, details: this.details, stream, header: this.#source.headers[stream] });
        task.at++;
      }
    } catch (error) {
      if (task.cancelled) return;
      if (!(error instanceof LostPart)) return this.#fail(lane, /** @type {Error} */ (error));
      this.#readAgain();
      this.#pass(task.at, words(error), { missing: error.kind === 'missing' });
    }
    lane.task = null;
    this.#deal();
  }

  /** @param {import('./worker.js').Done} answer */
  #done({ frame, mesh, memoryBytes = 0 }) {
    this.#spare(memoryBytes);
    if (!mesh || (this.details && !mesh.details)) return;
    this.#passed = 0;
    this.#source.measured?.(mesh);
    this.#ring.put(frame, mesh);
    this.#ring.trim((held) => this.#distance(held));
    if (!this.#ring.has(frame)) this.#noRoom.add(frame);
    this.#tell((on) => on.frame?.(frame));
    this.#deal();
  }

  /** Closes workers for which there is no memory, once it is known what one takes. @param {number} memoryBytes */
  #spare(memoryBytes) {
    const most = memoryBytes ? Math.max(1, Math.floor(this.#allowance.bytes / memoryBytes)) : Infinity;
    while (this.#lanes.length > most) {
      const idle = this.#lanes.findLastIndex(({ task, coming }) => !task && !coming.size);
      const [lane] = this.#lanes.splice(idle < 0 ? this.#lanes.length - 1 : idle, 1);
      lane.close();
    }
  }

  /** How far a frame is from being shown. @param {number} frame */
  #distance(frame) {
    const frames = this.#gops.frames;
    const ahead = (frame - this.target + frames) % frames;
    const window = this.#window;
    return ahead < window && (this.loop || frame >= this.target) ? ahead : window + Math.abs(this.target - frame);
  }

  /** @param {Lane} lane @param {import('./worker.js').Lost} answer */
  #lose(lane, { frame, message, refused = false, blocks = 0 }) {
    lane.cancel();
    if (!refused && this.#source.spoil?.(frame)) return this.#deal();
    const { blockSide } = this.#source.facts[this.#source.streamOf(frame)];
    if (refused) this.#loseUntilKeyframe(frame, refusal(frame, blocks, blockSide, this.#allowance), { refused });
    else this.#pass(frame, message);
    this.#deal();
  }

  /** Goes on behind frames that cannot be had or decoded. Of a ladder that costs requests: there is an end to it. @param {number} frame @param {string} message @param {{ missing?: boolean }} [why] */
  #pass(frame, message, why) {
    this.#loseUntilKeyframe(frame, message, why);
    if (!this.#source.rungs || ++this.#passed < MOST_PASSED) return;
    this.#hopeless = new IsvFailure('damaged', `${this.#passed} parts of it in a row cannot be played: ${message}`);
    this.#giveUp();
  }

  /** Ends it where nothing more is read, once all is shown that is there. */
  #giveUp() {
    if (!this.#hopeless || this.#broken || this.#ring.has(this.target)) return;
    this.#break(this.#hopeless);
  }

  /** @param {number} frame @param {string} message @param {{ refused?: boolean, missing?: boolean }} [why] */
  #loseUntilKeyframe(frame, message, { refused = false, missing = false } = {}) {
    const resumes = this.#gops.keyframeAfter(frame);
    const known = this.lost.has(frame);
    for (let lost = frame; lost < resumes; lost++) {
      this.lost.set(lost, message);
      if (refused) this.refused.add(lost);
      if (missing) this.#absent.add(lost);
    }
    if (!known) this.#tell((on) => on.lost?.({ frame, resumes, message, refused, missing }));
  }

  /** Bytes could not be read. @param {Lane} lane @param {Error} error */
  #fail(lane, error) {
    lane.cancel();
    if (isAbort(error) || this.#broken) return;
    const hopeless = error instanceof IsvFailure && error.kind !== 'missing';
    this.#tell((on) => on.failed?.(error, hopeless));
    if (hopeless) return this.close();
    if (this.#retrying !== null) return;
    const wait = RETRIES[Math.min(this.#failures++, RETRIES.length - 1)];
    this.#retrying = setTimeout(() => {
      this.#retrying = null;
      this.#deal();
    }, wait);
  }

  #readAgain() {
    if (!this.#failures) return;
    this.#failures = 0;
    this.#tell((on) => on.recovered?.());
  }

  /** @param {(on: Events) => void} what */
  #tell(what) {
    if (this.#on) what(this.#on);
    else this.#unheard.push(() => this.#tell(what));
  }

  /** @param {Error} error */
  #break(error) {
    if (this.#broken) return;
    this.close();
    this.#tell((on) => on.failed?.(error, true));
  }
}
