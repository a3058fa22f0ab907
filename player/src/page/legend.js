// What the colours of a view mean.

import { BACK_COLOUR, FRONT_COLOUR } from '../surface-material.js';
import { BLOCK_COLOURS, MOTION_SCALE, MOTION_VOXELS } from '../block-overlays.js';
import { HEAT_BITS, heatGradient } from '../heat.js';
import { byId, make } from './element.js';
import { asLength } from './numbers.js';

/**
 * @param {import('../views.js').View} view
 * @param {{ voxelSize: number } | null} facts
 * @param {boolean} open whether the back of the surface can be seen
 */
export function showLegend(view, facts, open) {
  const legend = byId('legend');
  const content = contentOf(view, facts?.voxelSize ?? 0, open);
  legend.hidden = content.length === 0;
  legend.replaceChildren(...content);
}

/** @param {import('../views.js').View} view @param {number} voxelSize @param {boolean} open @returns {Node[]} */
function contentOf(view, voxelSize, open) {
  if (view === 'shaded' && open) {
    const sides = /** @type {const} */ ([
      ['front', FRONT_COLOUR],
      ['back of the surface', BACK_COLOUR],
    ]);
    return [list(sides.map(([text, colour]) => ({ text, colour: `#${colour.toString(16)}` })))];
  }
  if (view === 'normals') {
    const axes = /** @type {const} */ ([
      ['x', '#d9534a'],
      ['y', '#3fa35b'],
      ['z', '#4a7bd9'],
      ['back of the surface', '#d61860'],
    ]);
    return [list(axes.map(([text, colour]) => ({ text, colour })))];
  }
  if (view === 'blocks') {
    const texts = ['stands still', 'coded by itself', 'predicted'];
    return [list(texts.map((text, kind) => ({ text, colour: `#${BLOCK_COLOURS[kind].toString(16)}` })))];
  }
  if (view === 'bits') return [make('p', { text: 'Bits of each block' }), ...scale(heatGradient(), '0', `${HEAT_BITS} or more`)];
  if (view === 'motion') {
    const words = `Motion since the frame before, ${MOTION_SCALE} times as long`;
    const colours = 'linear-gradient(to right, rgb(41 107 217), rgb(26 168 122), rgb(242 115 26))';
    return [make('p', { text: words }), ...scale(colours, '0', `${asLength(MOTION_VOXELS * voxelSize)} or more`)];
  }
  return [];
}

/** @param {{ text: string, colour: string }[]} entries */
function list(entries) {
  const items = entries.map(({ text, colour }) => {
    const swatch = make('i');
    swatch.style.background = colour;
    return make('li', {}, swatch, document.createTextNode(text));
  });
  return make('ul', {}, ...items);
}

/** @param {string} colours @param {string} low @param {string} high */
function scale(colours, low, high) {
  const bar = make('div', { class: 'scale' });
  bar.style.background = colours;
  return [bar, make('div', { class: 'ends dim' }, make('span', { text: low }), make('span', { text: high }))];
}
