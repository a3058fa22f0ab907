// The player: a stream as a three.js object that moves.

import { Group, Mesh } from 'three';
import { allowanceOf } from './allowance.js';
import { Clock } from './clock.js';
import { IsvFailure, words } from './failure.js';
import { LiveSource } from './live.js';
import { MovingGeometry } from './moving-geometry.js';
import { openFile } from './opening.js';
import { compileDecoder, spawnWorker } from './spawn.js';
import { colouredMaterial, litMaterial } from './surface-material.js';
import { isUp, toYUp } from './up.js';

/** Frames before the target that are made on the way to it when going back, so that the next steps back are at once. */
const BEHIND = 8;
/** Wait for a frame, in ms, after which it is called waiting. */
const PATIENCE = 250;

/**
 * What to play, one of the first three, and how.
 * @typedef {object} PlayerOptions
 * @property {string} [url] a file, by HTTP with ranges
 * @property {Blob | ArrayBuffer | Uint8Array} [source] a file that is already here
 * @property {string} [live] address of a live stream, ws: or wss: or relative
 * @property {string | URL | WebAssembly.Module} [wasm] the decoder, if it is not beside the modules
 * @property {number} [workers] how many decode; as many as there are cores, up to 4
 * @property {number} [memory] most bytes of decoded frames; 256 MiB
 * @property {number} [maxMemory] most bytes that decoders may take; half of the machine's memory
 * @property {number} [voxels] most voxels of a frame; as many as that memory has room for
 * @property {import('./up.js').Up} [up] the axis of the capture that points up; the object is turned so that it is Y
 * @property {import('three').Material} [material] of the mesh; without it, the stream's colour, unlit, or grey in light where it has none
 * @property {Clock} [clock] shared with other players
 * @property {boolean} [autoplay]
 * @property {boolean} [loop]
 * @property {number} [speed]
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
  /** The stream, once it is open. @type {import('./source.js').FileSource | null} */
  source = null;
  /** @type {LiveSource | null} */
  live = null;
  /** Frames decoded ahead. @type {import('./workers.js').DecodeAhead | null} */
  ahead = null;
  clock;
  /** What ended it; null while it plays. @type {Error | null} */
  error = null;
  /** Settles when the stream is open and its first picture is decoded; rejects with what went wrong. @type {Promise<IsvPlayer>} */
  ready;
  #gate = (/** @type {number} */ position) => this.#gatePosition(position);
  #details = false;
  /** @type {import('./up.js').Up} */
  #up = 'y';
  /** The refused frame that was told of last; -1 if the playhead was elsewhere since. */
  #refused = -1;
  #waiting = false;
  #closed = false;
  /** Where a drag on the scrub bar is, while a picture near an earlier place is still on its way. */
  #scrub = -1;
  /** Settles {@link IsvPlayer.ready}. */
  #first = /** @type {{ resolve: (player: IsvPlayer) => void, reject: (error: Error) => void }} */ ({});

  /** @param {PlayerOptions} options */
  constructor(options) {
    super();
    const { clock = new Clock(), loop, speed, autoplay = false, material, up = 'y' } = options;
    this.clock = clock;
    if (loop !== undefined) clock.loop = loop;
    if (speed !== undefined) clock.speed = speed;
    this.isDressed = material !== undefined;
    this.materials = { colour: colouredMaterial(), shaded: material ?? litMaterial() };
    this.mesh = new Mesh(new MovingGeometry(), this.materials.shaded);
    this.object.add(this.mesh);
    this.up = up;
    this.ready = new Promise((resolve, reject) => (this.#first = { resolve, reject }));
    this.ready.catch(() => {}); // An error event says it, too.
    this.#open(options).catch((error) => this.#fail(error));
    if (autoplay) this.play();
  }

  /** Number of frames; 0 until the file is open, Infinity of a live stream. */
  get frames() {
    return this.live ? Infinity : (this.source?.frames ?? 0);
  }

  /** Frames a second. */
  get fps() {
    return this.facts?.fps ?? 30;
  }

  /** Seconds. */
  get duration() {
    return this.frames / this.fps;
  }

  /** What the stream's header says; null until it is there. */
  get facts() {
    return this.source?.facts ?? this.live?.facts ?? null;
  }

  /** The frame under the playhead. */
  get frame() {
    return this.live ? this.shownFrame : this.#frameAt(this.clock.position);
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
    return this.#up;
  }

  set up(up) {
    if (!isUp(up)) throw new RangeError(`up is y, z, x, -y, -z or -x, not ${up}`);
    this.#up = up;
    this.object.quaternion.copy(toYUp(up));
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
    this.clock.seek(this.#clockFrame(frame));
    this.#aim();
    this.ahead?.hurry();
  }

  /** Moves by frames and pauses. @param {number} frames below 0 goes back */
  step(frames) {
    if (this.live) return;
    this.pause();
    const wanted = this.frame + frames;
    const frame = this.loop ? (wanted + this.frames) % this.frames : wanted;
    this.clock.seek(this.#clockFrame(frame));
    this.#aim(frames < 0 ? BEHIND : 0);
  }

  /**
   * Moves the playhead while it is being dragged. What is shown on the way are the keyframes, or frames that are there;
   * places that a drag has left again are not decoded.
   * @param {number} frame
   */
  scrub(frame) {
    if (!this.ahead || !this.source) return;
    this.clock.seek(this.#clockFrame(frame));
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
    const event = this.clock.tick(now);
    if (event) this.#tell(event);
    this.#noteWaiting(now);
    this.#noteLost();
    if (this.#scrub >= 0) return this.#updateScrub();
    this.#aim(this.ahead.behind && this.ahead.target === this.frame ? this.ahead.behind : 0);
    return this.#show(this.frame);
  }

  dispose() {
    this.#closed = true;
    this.clock.gates.delete(this.#gate);
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
        this.#tell(type, detail);
      };
      this.live.details = this.#details;
      return;
    }
    const ahead = await openFile(options);
    const { source } = ahead;
    if (this.#closed) {
      ahead.close();
      return source.close();
    }
    this.source = source;
    this.ahead = ahead;
    this.ahead.setDetails(this.#details);
    this.clock.gates.add(this.#gate);
    if (this.clock.frames === 0) this.clock.set({ fps: source.facts.fps, frames: source.frames });
    else this.#shorten(source);
    this.#dress();
    this.#tell('open');
    this.ahead.listen({
      frame: () => this.#firstPicture(),
      lost: (detail) => this.#tell('lost', detail),
      failed: (error, fatal) => (fatal ? this.#fail(error) : this.#tell('stalled', { message: words(error) })),
      recovered: () => this.#tell('recovered'),
    });
    this.ahead.aim(this.frame, { loop: this.loop });
    this.ahead.hurry();
    this.ahead.start();
  }

  /** Shows a stream that has colour in it, unless the user gave a material. */
  #dress() {
    const { colour, shaded } = this.materials;
    const { material } = this.mesh;
    if (this.isDressed || (material !== colour && material !== shaded)) return;
    this.mesh.material = this.facts?.colour ? colour : shaded;
  }

  /** Another stream already has the clock: it ends with the shorter one. @param {import('./source.js').FileSource} source */
  #shorten(source) {
    const frames = Math.floor((source.frames * this.clock.fps) / source.facts.fps + 1e-6);
    this.clock.set({ fps: this.clock.fps, frames: Math.max(1, Math.min(this.clock.frames, frames)) });
  }

  #firstPicture() {
    this.#first.resolve(this);
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
    const keyframe = /** @type {import('./source.js').FileSource} */ (this.source).gops.keyframeOf(this.#scrub);
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
      const hopeless = !this.shown && !this.error && lost.size >= this.frames;
      if (hopeless) this.#fail(new IsvFailure('damaged', `no frame of it can be decoded: ${why ?? [...lost.values()][0]}`));
      return;
    }
    if (this.clock.playing) {
      this.clock.pause();
      // The first of them, which a slow machine may have passed.
      let first = frame;
      while (refused.has(first - 1) && lost.get(first - 1) === why) first--;
      if (first < frame) this.clock.seek(this.#clockFrame(first));
    }
    if (this.#refused === this.frame) return;
    this.#refused = this.frame;
    this.#first.reject(new IsvFailure('limit', why));
    this.#tell('refused', { frame: this.frame, message: why });
  }

  /** The position that the clock may not reach, in its own frames. @param {number} position */
  #gatePosition(position) {
    const missing = this.ahead?.firstMissing(this.#frameAt(position)) ?? Infinity;
    return (missing / this.fps) * this.clock.fps;
  }

  /** A frame of the clock as one of this stream, whose rate may be another. @param {number} position */
  #frameAt(position) {
    if (!this.source) return 0;
    const { facts, frames } = this.source;
    return Math.min(frames - 1, Math.floor((Math.floor(position) / this.clock.fps) * facts.fps + 1e-6));
  }

  /** @param {number} frame of this stream */
  #clockFrame(frame) {
    return Math.ceil((frame / this.fps) * this.clock.fps - 1e-6);
  }

  /** @param {string} type @param {unknown} [detail] */
  #tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
