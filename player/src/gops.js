/** Keyframes, and how frames are dealt to workers in runs of whole GOPs. */

import { upTo } from './sorted.js';

/** Fewest frames of a run: with very short GOPs, workers would otherwise be handed work frame by frame. */
const SHORTEST_RUN = 8;

export class Gops {
  /** Frame numbers, ascending. */
  keyframes;
  /** First frames of runs, ascending: every one a keyframe. */
  runs;

  /** @param {ArrayLike<number>} flags 1 at keyframes, one entry a frame */
  constructor(flags) {
    this.frames = flags.length;
    const keyframes = [];
    for (let frame = 0; frame < flags.length; frame++) if (flags[frame]) keyframes.push(frame);
    this.keyframes = Uint32Array.from(keyframes);
    /** @type {number[]} */
    const runs = [];
    for (const frame of keyframes) if (!runs.length || frame - runs[runs.length - 1] >= SHORTEST_RUN) runs.push(frame);
    this.runs = Uint32Array.from(runs);
  }

  /** Number of the GOP that a frame is in, from 0 on; -1 before the first keyframe. @param {number} frame */
  indexOf(frame) {
    return upTo(this.keyframes, frame);
  }

  /** The keyframe that a frame is decoded from; -1 if there is none before it. @param {number} frame */
  keyframeOf(frame) {
    const at = upTo(this.keyframes, frame);
    return at < 0 ? -1 : this.keyframes[at];
  }

  /** The first keyframe after a frame; `frames` if there is none. @param {number} frame */
  keyframeAfter(frame) {
    return this.keyframes[upTo(this.keyframes, frame) + 1] ?? this.frames;
  }

  /** First frame of the run that a frame is in; -1 before the first keyframe. @param {number} frame */
  runOf(frame) {
    const at = upTo(this.runs, frame);
    return at < 0 ? -1 : this.runs[at];
  }

  /** The frame after the last of the run that a frame is in. @param {number} frame */
  runEnd(frame) {
    return this.runs[upTo(this.runs, frame) + 1] ?? this.frames;
  }
}
