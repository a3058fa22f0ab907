// Buttons and boxes of playback.

import { byId } from './element.js';
import { asTime } from './numbers.js';

export class Transport {
  #clock;
  #speed = byId('speed', HTMLSelectElement);
  #frame = byId('frame', HTMLInputElement);
  #of = byId('of');
  #time = byId('clock');
  #up = byId('up');
  #play = button('play');
  #sound = byId('sound');
  #volume = byId('volume', HTMLInputElement);
  #mute = button('mute');
  #toggles = { loop: button('loop'), grid: button('grid'), figures: button('figures') };

  /** @param {import('../clock.js').Clock} clock @param {import('./keyboard.js').Commands & { volume: (volume: number) => void }} commands */
  constructor(clock, commands) {
    this.#clock = clock;
    const { toggle, loop, mute, fit, grid, figures, open, help } = commands;
    /** @type {Record<string, () => void>} */
    const actions = {
      loop,
      mute,
      fit,
      grid,
      up: () => commands.up(1),
      figures,
      open,
      help,
      play: toggle,
      back: () => commands.step(-1),
      forward: () => commands.step(1),
    };
    for (const one of document.querySelectorAll('[data-do]')) {
      const name = /** @type {HTMLElement} */ (one).dataset.do ?? '';
      one.addEventListener('click', () => actions[name]());
    }
    this.#speed.addEventListener('change', () => (clock.speed = Number(this.#speed.value)));
    this.#volume.addEventListener('input', () => commands.volume(this.#volume.valueAsNumber));
    this.#frame.addEventListener('change', () => commands.seek(this.#frame.valueAsNumber || 0));
  }

  /** Takes the next of the speeds offered. @param {number} steps */
  faster(steps) {
    const { options, selectedIndex } = this.#speed;
    this.#speed.selectedIndex = Math.min(options.length - 1, Math.max(0, selectedIndex + steps));
    this.#clock.speed = Number(this.#speed.value);
  }

  /** @param {import('../player.js').IsvPlayer | undefined} player @param {import('./stage.js').Stage} stage @param {boolean} brief whether figures are hidden @param {number} frames */
  update(player, stage, brief, frames) {
    const playing = player?.playing ?? false;
    const label = playing ? 'Pause' : 'Play';
    if (this.#play.getAttribute('aria-label') !== label) {
      this.#play.setAttribute('aria-label', label);
      this.#play.querySelector('use')?.setAttribute('href', playing ? '#i-pause' : '#i-play');
    }
    press(this.#toggles.loop, this.#clock.loop);
    press(this.#toggles.grid, stage.grid);
    press(this.#toggles.figures, !brief);
    write(this.#up, stage.up.toUpperCase().replace('-', '\u2212'));
    if (!player) return;
    if (document.activeElement !== this.#frame) this.#frame.value = String(Math.max(0, player.frame));
    write(this.#of, player.live || !frames ? '' : `of ${frames}`);
    const waits = player.waiting ? ' \u00b7 waiting' : '';
    write(this.#time, player.live ? '' : `${asTime(player.source?.times.starts[Math.max(0, player.frame)] ?? 0)}${waits}`);
    this.#sound.hidden = !player.sound;
    const silent = player.muted || player.volume === 0;
    press(this.#mute, silent);
    const icon = silent ? '#i-muted' : '#i-sound';
    const use = this.#mute.querySelector('use');
    if (use?.getAttribute('href') !== icon) use?.setAttribute('href', icon);
    if (document.activeElement !== this.#volume) this.#volume.value = String(player.muted ? 0 : player.volume);
  }
}

/** @param {string} name */
function button(name) {
  return /** @type {HTMLElement} */ (document.querySelector(`#transport [data-do=${name}]`));
}

/** @param {HTMLElement} toggle @param {boolean} pressed */
function press(toggle, pressed) {
  if (toggle.getAttribute('aria-pressed') !== String(pressed)) toggle.setAttribute('aria-pressed', String(pressed));
}

/** @param {HTMLElement} element @param {string} text */
function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
