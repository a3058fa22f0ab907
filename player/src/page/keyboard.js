// Keys, and the list of them.

import { byId, make } from './element.js';
import { VIEWS } from '../views.js';

/**
 * What keys can do.
 * @typedef {object} Commands
 * @property {() => void} toggle play or pause
 * @property {(frames: number) => void} step
 * @property {(frame: number) => void} seek
 * @property {(steps: number) => void} faster
 * @property {() => void} loop
 * @property {() => void} mute
 * @property {(steps: number) => void} louder
 * @property {(number: number) => void} view
 * @property {(yaw: number, pitch: number) => void} turn radians
 * @property {(right: number, up: number) => void} pan parts of the distance
 * @property {(factor: number) => void} zoom
 * @property {() => void} fit
 * @property {() => void} grid
 * @property {(steps: number) => void} up
 * @property {() => void} figures
 * @property {() => void} open
 * @property {() => void} help
 */

const TURN = Math.PI / 24;
const PAN = 0.05;

/** @type {{ keys: string[], shown: string[], says: string, does: (commands: Commands, event: KeyboardEvent) => void }[]} */
const KEYS = [
  { keys: [' ', 'k'], shown: ['Space'], says: 'play or pause', does: (c) => c.toggle() },
  {
    keys: ['ArrowLeft', 'ArrowRight'],
    shown: ['\u2190', '\u2192'],
    says: 'a frame back, forward; ten with Shift',
    does: (c, e) => c.step((e.key === 'ArrowLeft' ? -1 : 1) * (e.shiftKey ? 10 : 1)),
  },
  { keys: ['Home'], shown: ['Home'], says: 'first frame', does: (c) => c.seek(0) },
  { keys: ['End'], shown: ['End'], says: 'last frame', does: (c) => c.seek(Infinity) },
  { keys: ['[', ']'], shown: ['[', ']'], says: 'slower, faster', does: (c, e) => c.faster(e.key === ']' ? 1 : -1) },
  { keys: ['l'], shown: ['L'], says: 'loop', does: (c) => c.loop() },
  { keys: ['m'], shown: ['M'], says: 'sound off, on', does: (c) => c.mute() },
  {
    keys: ['ArrowUp', 'ArrowDown'],
    shown: ['\u2191', '\u2193'],
    says: 'louder, softer',
    does: (c, e) => c.louder(e.key === 'ArrowUp' ? 1 : -1),
  },
  {
    keys: VIEWS.map((_, at) => String(at)),
    shown: VIEWS.map((_, at) => String(at)),
    says: VIEWS.map(({ title }) => title.toLowerCase()).join(', '),
    does: (c, e) => c.view(Number(e.key)),
  },
  {
    keys: ['a', 'd', 'w', 's'],
    shown: ['W', 'A', 'S', 'D'],
    says: 'turn the camera; move it with Shift',
    does: (c, e) => {
      const [right, up] = { a: [-1, 0], d: [1, 0], w: [0, 1], s: [0, -1] }[e.key.toLowerCase()] ?? [0, 0];
      if (e.shiftKey) c.pan(right * PAN, up * PAN);
      else c.turn(right * TURN, up * TURN);
    },
  },
  {
    keys: ['+', '=', '-'],
    shown: ['+', '\u2212'],
    says: 'nearer, farther',
    does: (c, e) => c.zoom(e.key === '-' ? 1.1 : 1 / 1.1),
  },
  { keys: ['f'], shown: ['F'], says: 'fit the camera to this frame', does: (c) => c.fit() },
  { keys: ['g'], shown: ['G'], says: 'ground grid', does: (c) => c.grid() },
  {
    keys: ['u'],
    shown: ['U'],
    says: 'another axis up: y, z, \u2212y, \u2212z, x, \u2212x; back with Shift',
    does: (c, e) => c.up(e.shiftKey ? -1 : 1),
  },
  { keys: ['i'], shown: ['I'], says: 'figures', does: (c) => c.figures() },
  { keys: ['o'], shown: ['O'], says: 'open files', does: (c) => c.open() },
  { keys: ['?'], shown: ['?'], says: 'this list', does: (c) => c.help() },
];

/** @param {Commands} commands */
export function listenToKeys(commands) {
  byId('keys').replaceChildren(
    ...KEYS.flatMap(({ shown, says }) => [
      make('dt', {}, ...shown.flatMap((key, at) => [...(at ? [document.createTextNode(' ')] : []), make('kbd', { text: key })])),
      make('dd', { text: says }),
    ]),
  );
  addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || takesKey(event)) return;
    const found = KEYS.find(({ keys }) => keys.includes(event.key.length === 1 ? event.key.toLowerCase() : event.key));
    if (!found) return;
    event.preventDefault();
    found.does(commands, event);
  });
}

/** Whether the focused element needs a key for itself. @param {KeyboardEvent} event */
function takesKey({ target, key }) {
  if (document.querySelector('dialog[open]')) return key !== '?';
  if (target instanceof HTMLButtonElement) return key === ' ' || key === 'Enter';
  if (target instanceof HTMLSelectElement) return true;
  if (!(target instanceof HTMLInputElement)) return false;
  if (target.type === 'radio') return key.startsWith('Arrow') || key === ' ';
  if (target.id === 'volume') return key.startsWith('Arrow') || key === 'Home' || key === 'End';
  return target.type === 'number';
}
