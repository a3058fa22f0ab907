import assert from 'node:assert/strict';
import { test } from 'node:test';

class Slider extends EventTarget {
  valueAsNumber = 0;
}

class Canvas {}

const slider = new Slider();
const page = new EventTarget();
Object.assign(globalThis, {
  HTMLInputElement: Slider,
  HTMLCanvasElement: Canvas,
  document: { getElementById: (/** @type {string} */ id) => (id === 'position' ? slider : new Canvas()) },
  addEventListener: page.addEventListener.bind(page),
});
const { ScrubBar } = await import('../src/page/scrub-bar.js');

/** @type {string[]} */
const asked = [];
new ScrubBar({ scrub: (frame) => asked.push(`scrub ${frame}`), seek: (frame) => asked.push(`seek ${frame}`) });

/** What was asked for while the slider had events, as `input 5`. @param {...string} events */
function after(...events) {
  asked.length = 0;
  for (const event of events) {
    const [type, value] = event.split(' ');
    if (value !== undefined) slider.valueAsNumber = Number(value);
    (type === 'pointerup' || type === 'pointercancel' ? page : slider).dispatchEvent(new Event(type));
  }
  return asked;
}

test('every drag ends with one seek, whatever tells of its end', () => {
  for (const ends of [['pointerup'], ['change'], ['pointerup', 'change'], ['change', 'pointerup'], ['pointercancel']]) {
    slider.valueAsNumber = 3;
    assert.deepEqual(after('pointerdown', 'input 4', 'input 3', ...ends), ['scrub 4', 'scrub 3', 'seek 3'], ends.join());
  }
});

test('what is no drag seeks at once, and a touch of the thumb does nothing', () => {
  assert.deepEqual(after('input 8', 'change'), ['seek 8']);
  assert.deepEqual(after('pointerdown', 'pointerup'), []);
  assert.deepEqual(after('pointerdown', 'input 2', 'pointercancel', 'input 5', 'change'), ['scrub 2', 'seek 2', 'seek 5']);
});
