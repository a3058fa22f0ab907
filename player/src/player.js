// The player: a stream as a three.js object that moves.

import { Group, Mesh } from 'three';
import { allowanceOf } from './allowance.js';
import { isUp } from './axes.js';
import { Clock } from './clock.js';
import { IsvFailure, words } from './failure.js';
import { LiveSource } from './live.js';
import { MovingGeometry } from './moving-geometry.js';
import { openFile } from './opening.js';
import { compileDecoder, spawnWorker } from './spawn.js';
import { colouredMaterial, litMaterial } from './surface-material.js';
import { toYUp } from './up.js';

/** Frames before the target that are made on the way to it when going back, so that the next steps back are at once. */
const BEHIND = 8;
/** Wait for a frame, in ms, after which it is called waiting. */
const PATIENCE = 250;
/** Seconds of frames that are there before sound goes on after a wait: one long pause is heard less than many short ones. */
const CUSHION = 0.2;

/**
 * What to play, one of the first three, and how.
 * @typedef {object} PlayerOptions
 * @property {string} [url] a file or the playlist of a ladder, by HTTP
 * @property {Blob | ArrayBuffer | Uint8Array} [source] a file that is already here
 * @property {string} [live] address of a live stream, ws: or wss: or relative
 * @property {string | URL | WebAssembly.Module} [wasm] the decoder, if it is not beside the modules
 * @property {number} [workers] how many decode; as many as there are cores, up to 4
 * @property {number} [memory] most bytes of decoded frames; 256 MiB. Two frames are held, whatever they take. Of a scene of which
 *   one frame takes most of that, half as much again
 * @property {number} [maxMemory] most bytes that decoders may take; half of the machine's memory
 * @property {number} [voxels] most voxels of a frame; as many as that memory has room for
 * @property {import('./axes.js').Up} [up] the axis of the capture that points up; what the take says, or `y`. The object is turned so that it is Y
 * @property {import('three').Material} [material] of the mesh; without it, the stream's colour, unlit, or grey in light where it has none
 * @property {Clock} [clock] shared with other players
 * @property {boolean} [autoplay]
 * @property {boolean} [loop]
 * @property {number} [speed]
 * @property {boolean} [sound] false: its sound is not played, as beside another take
 * @property {number} [volume] of sound, 0 to 1
 * @property {boolean} [muted]
 */

export class IsvPlayer extends EventTarget {
  /** To be added to a scene. Metres, in the axes of the capture, turned so that `up` is Y. */
  object = new Group();
  mesh;
  /** Materials of the surface in its colour and in light; the user's own takes the place of the latter. */
  materials;
  /** Whether the user gave a material. */
  isDressed;
  /** The frame that is shown, with its arrays and measures; null before the first. @type {import('./worker.js').Frame | null} */
  shown = null;
  /** Number of the frame that is shown; -1 before the first. */
  shownFrame = -1;
  /** How long the last frame took to be copied into the mesh and its listeners to look at it, in ms. */
  uploadMs = 0;
  /** The take, once it is open. @type {import('./source.js').Source | null} */
  source = null;
  /** @type {LiveSource | null} */
  live = null;
  /** Sound of the take; null without, and where the browser cannot play it. @type {import('./sound/sound.js').Sound | null} */
  sound = null;
  /** Frames decoded ahead. @type {import('./workers.js').DecodeAhead | null} */
  ahead = null;
  clock;
  /** What ended it; null while it plays. @type {Error | null} */
  error = null;
  /** Settles when the stream is open and its first picture is decoded; rejects with what went wrong, or with an `AbortError` after `dispose`. @type {Promise<IsvPlayer>} */
  ready;
  #gate = (/** @type {number} */ seconds) => this.#gateTime(seconds);
  #details = false;
  /** What the user wants to be up; null if that is left to the take. @type {import('./axes.js').Up | null} */
  #up = null;
  /** Volume and muting that the user wants. */
  #wanted = { volume: 1, muted: false };
  /** Whether it is not known yet if there will be sound: the playhead stands still until then. */
  #listening = false;
  /** Number of the clock's jumps when that was last looked at. */
  #jumps = 0;
  /** The stream of the frame that is shown. */
  #stream = 0;
  /** The refused frame that was told of last; -1 if the playhead was elsewhere since. */
  #refused = -1;
  /** Frames that cannot be shown, where the playhead is: from one to before another. */
  #held = { from: 0, to: 0 };
  #waiting = false;
  #closed = false;
  #opening = new AbortController();
  /** Where a drag on the scrub bar is, while a picture near an earlier place is still on its way. */
  #scrub = -1;
  /** Whether the playhead is being dragged: sound waits for the end of it. */
  #dragged = false;
  /** Settles {@link IsvPlayer.ready}. */
  #first = /** @type {{ resolve: (player: IsvPlayer) => void, reject: (error: Error) => void }} */ ({});

  /** @param {PlayerOptions} options */
  constructor(options) {
    super();
    const { clock = new Clock(), loop, speed, autoplay = false, material, up, volume = 1, muted = false } = options;
    this.clock = clock;
    if (loop !== undefined) clock.loop = loop;
    if (speed !== undefined) clock.speed = speed;
    this.isDressed = material !== undefined;
    this.materials = { colour: colouredMaterial(), shaded: material ?? litMaterial() };
    this.mesh = new Mesh(new MovingGeometry(), this.materials.shaded);
    this.object.add(this.mesh);
    this.#wanted = { volume: Math.min(1, Math.max(0, volume)), muted };
    if (up !== undefined) this.up = up;
    this.ready = new Promise((resolve, reject) => (this.#first = { resolve, reject }));
    this.ready.catch(() => {}); // An error event says it, too.
    this.#open(options).catch((error) => this.#fail(error));
    if (autoplay) this.play();
  }

  /** Number of frames; 0 until the file is open, Infinity of a live stream. */
  get frames() {
    return this.live ? Infinity : (this.source?.frames ?? 0);
  }

  /** Frames a second, as the stream's header says. */
  get fps() {
    return this.facts?.fps ?? 30;
  }

  /** Seconds. */
  get duration() {
    return this.live ? Infinity : (this.source?.times.duration ?? 0);
  }

  /** What the header of the stream says that the shown frame comes from; null until it is there. */
  get facts() {
    return this.source?.facts[this.#stream] ?? this.live?.facts ?? null;
  }

  /** What the take says of itself; empty until it is open, and where it says nothing. */
  get metadata() {
    return this.source?.metadata ?? this.live?.metadata ?? {};
  }

  /** The frame under the playhead. */
  get frame() {
    return this.live ? this.shownFrame : this.#frameAt(this.clock.seconds);
  }

  get playing() {
    return this.live ? this.live.playing : this.clock.playing;
  }

  /** Whether the playhead waits for a frame. */
  get waiting() {
    return this.#waiting;
  }

  /** The axis of the capture that points up. Setting it turns `object`. */
  get up() {
    return this.#up ?? this.metadata.up ?? 'y';
  }

  set up(up) {
    if (!isUp(up)) throw new RangeError(`up is y, z, x, -y, -z or -x, not ${up}`);
    this.#up = up;
    this.#turn();
  }

  /** Volume of sound, 0 to 1. */
  get volume() {
    return this.sound?.volume ?? this.#wanted.volume;
  }

  set volume(volume) {
    this.#wanted.volume = Math.min(1, Math.max(0, volume));
    if (this.sound) this.sound.volume = this.#wanted.volume;
  }

  get muted() {
    return this.sound?.muted ?? this.#wanted.muted;
  }

  set muted(muted) {
    this.#wanted.muted = muted;
    if (this.sound) this.sound.muted = muted;
  }

  get speed() {
    return this.clock.speed;
  }

  set speed(speed) {
    this.clock.speed = speed;
  }

  get loop() {
    return this.clock.loop;
  }

  set loop(loop) {
    this.clock.loop = loop;
  }

  /** Whether frames come with what each block is and took, in `shown.details`. */
  get details() {
    return this.#details;
  }

  set details(wanted) {
    this.#details = wanted;
    this.ahead?.setDetails(wanted);
    if (this.live) this.live.details = wanted;
    if (wanted && this.shown && !this.shown.details) this.shownFrame = -1;
  }

  play() {
    this.clock.play();
    if (this.live) this.live.playing = true;
  }

  pause() {
    this.clock.pause();
    if (this.live) this.live.playing = false;
  }

  /** Moves the playhead; the frame is shown as soon as it is decoded. @param {number} frame */
  seek(frame) {
    this.#scrub = -1;
    this.#dragged = false;
    this.ahead?.askAgain();
    this.#move(frame);
    this.#aim();
    this.ahead?.hurry();
  }

  /** Moves by frames and pauses. @param {number} frames below 0 goes back */
  step(frames) {
    if (this.live) return;
    this.pause();
    const wanted = this.frame + frames;
    const frame = this.loop ? (wanted + this.frames) % this.frames : wanted;
    this.#move(frame);
    this.#aim(frames < 0 ? BEHIND : 0);
  }

  /**
   * Moves the playhead while it is being dragged. What is shown on the way are the keyframes, or frames that are there;
   * places that a drag has left again are not decoded.
   * @param {number} frame
   */
  scrub(frame) {
    if (!this.ahead || !this.source) return;
    this.#dragged = true;
    this.#move(frame);
    if (this.ahead.settled(this.frame)) {
      this.#scrub = -1;
      this.#aim();
    } else {
      const busy = this.#scrub >= 0 && !this.ahead.settled(this.ahead.target);
      this.#scrub = this.frame;
      if (!busy) this.ahead.aim(Math.max(0, this.source.gops.keyframeOf(this.frame)), { loop: this.loop });
    }
  }

  /**
   * To be called for every picture drawn: moves the clock, and the mesh with it.
   * @param {number} [now] ms; what `requestAnimationFrame` gives
   * @returns {boolean} whether the mesh has changed
   */
  update(now = performance.now()) {
    if (this.#closed) return false;
    if (this.live) return this.#updateLive(now);
    if (!this.ahead) return false;
    const { target, lost } = this.ahead;
    if (this.shownFrame === target || lost.has(target)) this.ahead.release();
    this.#noteJumps();
    const event = this.clock.tick(now);
    this.source?.attend?.({ seconds: this.clock.seconds, speed: this.clock.speed, workers: this.ahead.workers });
    if (event) this.#tell(event);
    this.#noteWaiting(now);
    this.#noteLost();
    if (this.#scrub >= 0) {
      this.sound?.follow(this.clock, { still: true });
      return this.#updateScrub();
    }
    this.#aim(this.ahead.behind && this.ahead.target === this.frame ? this.ahead.behind : 0);
    const shown = this.#show(this.frame);
    this.sound?.follow(this.clock, { still: this.#dragged });
    return shown;
  }

  dispose() {
    this.#closed = true;
    this.#opening.abort();
    this.#first.reject(new DOMException('the player was disposed of', 'AbortError'));
    this.clock.gates.delete(this.#gate);
    this.#silence();
    this.ahead?.close();
    this.source?.close();
    this.live?.close();
    this.object.removeFromParent();
    this.mesh.geometry.dispose();
    const { colour, shaded } = this.materials;
    for (const one of new Set([this.mesh.material, colour, shaded].flat())) one.dispose();
  }

  /** @param {PlayerOptions} options */
  async #open(options) {
    if (options.live !== undefined) {
      const module = compileDecoder(options.wasm);
      this.live = new LiveSource({ url: options.live, module, spawn: spawnWorker, allowance: allowanceOf(options) });
      this.live.onevent = (type, detail) => {
        if (type === 'error') return this.#fail(/** @type {{ error: Error }} */ (detail).error);
        // Another stream than the one that could not be played.
        if (type === 'open') {
          this.error = null;
          this.#dress();
        }
        if (type === 'open' || type === 'described') this.#turn();
        this.#tell(type, detail);
      };
      this.live.details = this.#details;
      return;
    }
    const ahead = await openFile({ ...options, signal: this.#opening.signal });
    const { source } = ahead;
    if (this.#closed) {
      ahead.close();
      return source.close();
    }
    this.source = source;
    this.ahead = ahead;
    this.ahead.setDetails(this.#details);
    this.clock.gates.add(this.#gate);
    this.#listening = source.sound !== null && options.sound !== false && !this.clock.leader;
    this.#setClock(source);
    this.#dress();
    this.#turn();
    this.#tell('open');
    this.ahead.listen({
      frame: () => this.#firstPicture(),
      lost: (detail) => {
        this.#tell('lost', detail);
        this.#noPicture(detail);
      },
      failed: (error, fatal) => (fatal ? this.#fail(error) : this.#tell('stalled', { message: words(error) })),
      recovered: () => this.#tell('recovered'),
    });
    this.ahead.aim(this.frame, { loop: this.loop });
    this.ahead.hurry();
    this.ahead.start();
    if (source.silence && options.sound !== false) this.#tell('silent', { message: `the take plays without sound: ${source.silence}` });
    if (source.sound && this.#listening) await this.#listen(source.sound);
  }

  /** Shows a stream that has colour in it, unless the user gave a material. */
  #dress() {
    const { colour, shaded } = this.materials;
    const { material } = this.mesh;
    if (this.isDressed || (material !== colour && material !== shaded)) return;
    this.mesh.material = this.facts?.colour ? colour : shaded;
  }

  /** Turns the object so that what is up is Y. */
  #turn() {
    this.object.quaternion.copy(toYUp(this.up));
  }

  /** Tells the clock how long the take is. Where another already has it, it ends with the shorter one. @param {import('./source.js').Source} source */
  #setClock({ times }) {
    const { duration, last } = times;
    if (this.clock.duration === 0) {
      this.clock.set({ duration, last });
      this.clock.advance = (seconds, passed) => times.advance(seconds, passed);
    } else if (duration < this.clock.duration) this.clock.set({ duration, last });
  }

  /** Has sound played, which then leads the clock. @param {import('./sound/tracks.js').SoundTracks} tracks */
  async #listen(tracks) {
    const { Sound } = await import('./sound/sound.js');
    this.#listening = false;
    if (this.#closed || this.clock.leader) return;
    this.sound = Sound.of(tracks, {
      ...this.#wanted,
      duration: this.clock.duration,
      on: {
        unsupported: (detail) => {
          this.#silence();
          this.#tell('silent', detail);
        },
        blocked: () => this.#tell('blocked'),
        volume: () => this.#tell('volume', { volume: this.volume, muted: this.muted }),
        gap: (detail) => this.#tell('gap', detail),
        stalled: (error) => this.#tell('stalled', { message: words(error) }),
        recovered: () => this.#tell('recovered'),
      },
    });
    if (!this.sound) return;
    this.clock.leader = this.sound;
    this.#tell('sound', { codec: this.sound.codec });
  }

  #silence() {
    if (this.sound && this.clock.leader === this.sound) this.clock.leader = null;
    this.sound?.close();
    this.sound = null;
  }

  #firstPicture() {
    this.#first.resolve(this);
  }

  /** Ends the wait for a first picture where frames are lost without which there is none. @param {import('./workers.js').LostFrames} lost */
  #noPicture({ frame, resumes, message, refused }) {
    const { lost } = /** @type {import('./workers.js').DecodeAhead} */ (this.ahead);
    if (refused && frame <= this.frame && this.frame < resumes) this.#first.reject(new IsvFailure('limit', message));
    else if (lost.size >= this.frames) this.#first.reject(new IsvFailure('damaged', `no frame of it can be decoded: ${message}`));
  }

  /** @param {unknown} cause */
  #fail(cause) {
    if (this.#closed) return;
    const error = cause instanceof Error ? cause : new Error(String(cause));
    this.error = error;
    this.clock.gates.delete(this.#gate);
    this.#first.reject(error);
    this.#tell('error', { error, message: words(error) });
  }

  /** @param {number} [behind] */
  #aim(behind = 0) {
    this.ahead?.aim(this.frame, { loop: this.loop, behind });
  }

  /** @param {number} frame @returns {boolean} whether another frame is shown than before */
  #show(frame) {
    const decoded = this.ahead?.get(frame);
    if (!decoded || frame === this.shownFrame) return false;
    this.#draw(decoded, frame);
    return true;
  }

  /** @param {import('./worker.js').Frame} decoded @param {number} frame */
  #draw(decoded, frame) {
    const begin = performance.now();
    /** @type {MovingGeometry} */ (this.mesh.geometry).show(decoded);
    this.shown = decoded;
    this.shownFrame = frame;
    this.#noteStream(decoded.stream);
    this.#tell('frame', { frame, decoded });
    this.uploadMs = performance.now() - begin;
  }

  /** During a drag, shows what is nearest; goes on to where the drag is as soon as a picture near the place before has come. */
  #updateScrub() {
    const ahead = /** @type {import('./workers.js').DecodeAhead} */ (this.ahead);
    if (ahead.settled(this.#scrub)) {
      const frame = this.#scrub;
      this.#scrub = -1;
      return this.#show(frame);
    }
    if (!ahead.settled(ahead.target)) return false;
    const keyframe = /** @type {import('./source.js').Source} */ (this.source).gops.keyframeOf(this.#scrub);
    const passed = ahead.target;
    ahead.aim(ahead.settled(keyframe) || keyframe < 0 ? this.#scrub : keyframe, { loop: this.loop });
    return this.#show(passed);
  }

  /** @param {number} now */
  #updateLive(now) {
    const live = /** @type {LiveSource} */ (this.live);
    const next = live.next(now);
    if (!next) return false;
    this.#draw(next, this.shownFrame + 1);
    this.#firstPicture();
    return true;
  }

  /** @param {number} now */
  #noteWaiting(now) {
    const since = this.clock.waitingSince;
    const waiting = since !== null && now - since > PATIENCE;
    if (waiting === this.#waiting) return;
    this.#waiting = waiting;
    this.#tell(waiting ? 'waiting' : 'resumed');
  }

  /** Stops at a frame that needs too much memory, and gives up where no frame can be shown. */
  #noteLost() {
    const { lost, refused } = /** @type {import('./workers.js').DecodeAhead} */ (this.ahead);
    const frame = this.frame;
    const why = lost.get(frame);
    if (why === undefined || !refused.has(frame)) {
      this.#refused = -1;
      this.#noteHeld(frame, why);
      const hopeless = !this.shown && !this.error && lost.size >= this.frames;
      if (hopeless) this.#fail(new IsvFailure('damaged', `no frame of it can be decoded: ${why ?? [...lost.values()][0]}`));
      return;
    }
    if (this.clock.playing) {
      this.clock.pause();
      // The first of them, which a slow machine may have passed.
      let first = frame;
      while (refused.has(first - 1) && lost.get(first - 1) === why) first--;
      if (first < frame) this.#move(first);
    }
    if (this.#refused === this.frame) return;
    this.#refused = this.frame;
    this.#first.reject(new IsvFailure('limit', why));
    this.#tell('refused', { frame: this.frame, message: why });
  }

  /** Tells once where the playhead comes to frames that cannot be shown: the picture before them stays. @param {number} frame @param {string | undefined} why */
  #noteHeld(frame, why) {
    if (why === undefined || !this.shown || this.error || this.ahead?.get(frame)) {
      this.#held = { from: 0, to: 0 };
      return;
    }
    if (frame >= this.#held.from && frame < this.#held.to) return;
    const { lost } = /** @type {import('./workers.js').DecodeAhead} */ (this.ahead);
    let to = frame + 1;
    while (lost.has(to)) to++;
    this.#held = { from: frame, to };
    this.#tell('held', { frame, resumes: to, message: why });
  }

  /** The time that the clock may not reach. @param {number} seconds */
  #gateTime(seconds) {
    if (!this.source || !this.ahead) return Infinity;
    if (this.#listening) return seconds;
    const { times, frames } = this.source;
    const frame = times.frameAt(seconds);
    const missing = this.ahead.firstMissing(frame);
    if (missing === Infinity) return Infinity;
    const waits = this.sound !== null && this.clock.held && missing > frame;
    if (waits && !this.ahead.hasAhead(frame, times.frameAt(seconds + CUSHION) - frame)) return times.starts[frame];
    return missing < frames ? times.starts[missing] : times.duration + times.starts[missing - frames];
  }

  /** @param {number} seconds */
  #frameAt(seconds) {
    return this.source?.times.frameAt(seconds) ?? 0;
  }

  /** Moves the playhead to the beginning of a frame. @param {number} frame */
  #move(frame) {
    const { times, frames } = this.source ?? {};
    if (!times || !frames) return;
    this.clock.seek(times.starts[Math.min(frames - 1, Math.max(0, Math.floor(Number.isFinite(frame) ? frame : 0)))]);
    this.#jumps = this.clock.jumps;
  }

  /** Another player, or the user, has moved the clock: its frame is wanted first. */
  #noteJumps() {
    if (this.#jumps === this.clock.jumps) return;
    this.#jumps = this.clock.jumps;
    if (this.#dragged) return;
    this.#aim();
    this.ahead?.hurry();
  }

  /** What the shown frame's stream says may differ from what the one before said. @param {number} stream */
  #noteStream(stream) {
    const rungs = this.source?.rungs;
    if (stream !== this.#stream) {
      this.#stream = stream;
      this.#dress();
    }
    if (!rungs || rungs.shown === stream) return;
    rungs.shown = stream;
    this.#tell('rung', { rung: stream, rungs: rungs.all });
  }

  /** @param {string} type @param {unknown} [detail] */
  #tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
