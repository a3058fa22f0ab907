// The scrub bar: a slider over marks of keyframes and of what is buffered.

import { byId } from './element.js';

/** Half the slider's thumb: its track ends so far from the edges. */
const END = 7;
/** Keyframes nearer to each other than this, in pixels, are not marked: they would only be a grey. */
const NEAREST_MARKS = 4;

export class ScrubBar {
  #slider = byId('position', HTMLInputElement);
  #canvas = byId('marks', HTMLCanvasElement);
  #dragging = false;
  /** Whether the drag has moved the playhead. */
  #moved = false;
  #drawn = '';

  /** @param {{ scrub: (frame: number) => void, seek: (frame: number) => void }} on */
  constructor({ scrub, seek }) {
    const slider = this.#slider;
    slider.addEventListener('pointerdown', () => (this.#dragging = true));
    slider.addEventListener('input', () => {
      this.#moved = this.#dragging;
      (this.#dragging ? scrub : seek)(slider.valueAsNumber);
    });
    // A drag may end anywhere, and where it ends at the value that it began with, not every browser sends a change.
    const end = () => {
      this.#dragging = false;
      if (!this.#moved) return;
      this.#moved = false;
      seek(slider.valueAsNumber);
    };
    slider.addEventListener('change', end);
    addEventListener('pointerup', end);
    addEventListener('pointercancel', end);
  }

  /** @param {import('../player.js').IsvPlayer | undefined} player @param {number} frames */
  update(player, frames) {
    const slider = this.#slider;
    const last = String(Math.max(0, frames - 1));
    if (slider.max !== last) slider.max = last;
    if (!player?.source || !player.ahead) return;
    if (!this.#dragging && slider.value !== String(player.frame)) slider.value = String(player.frame);
    slider.setAttribute('aria-valuetext', `frame ${player.frame} of ${frames}`);
    this.#draw(player.frame, frames, player.ahead.spans(), player.source.gops.keyframes, player.ahead.lost);
  }

  /** @param {number} frame @param {number} frames @param {[number, number][]} spans @param {Uint32Array} keyframes @param {Map<number, string>} lost */
  #draw(frame, frames, spans, keyframes, lost) {
    const { clientWidth: width, clientHeight: height } = this.#canvas;
    const ratio = Math.min(devicePixelRatio, 2);
    const dark = matchMedia('(prefers-color-scheme: dark)').matches;
    const drawn = [frame, frames, width, ratio, dark, spans, lost.size].join();
    if (drawn === this.#drawn) return;
    this.#drawn = drawn;
    this.#canvas.width = width * ratio;
    this.#canvas.height = height * ratio;
    const context = this.#canvas.getContext('2d');
    if (!context) return;
    const style = getComputedStyle(this.#canvas);
    const fill = (/** @type {string} */ name) => (context.fillStyle = style.getPropertyValue(name));
    const x = (/** @type {number} */ at) => END + ((width - 2 * END) * at) / Math.max(1, frames - 1);
    const bar = (/** @type {number} */ from, /** @type {number} */ to) => {
      context.beginPath();
      context.roundRect(from, height / 2 - 2, Math.max(2, to - from), 4, 2);
      context.fill();
    };
    context.scale(ratio, ratio);
    fill('--track');
    bar(END, width - END);
    fill('--buffered');
    for (const [from, to] of spans) bar(x(from), x(Math.min(to, frames - 1)));
    fill('--accent');
    bar(END, x(frame));
    fill('--bad');
    for (const at of lost.keys()) if (at < frames) context.fillRect(x(at), height / 2 - 2, Math.max(1, x(1) - x(0)), 4);
    fill('--mark');
    let marked = -Infinity;
    for (const keyframe of keyframes.length > 1 ? keyframes : []) {
      if (x(keyframe) - marked < NEAREST_MARKS) continue;
      marked = x(keyframe);
      context.fillRect(marked - 0.5, height / 2 + 5, 1, 4);
    }
  }
}
