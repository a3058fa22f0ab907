// Figures of what is played, a card a player.

import { byId, make } from './element.js';
import { asBitrate, asBytes, asCount, asLength, asMs } from './numbers.js';

/** @typedef {import('../player.js').IsvPlayer} IsvPlayer */

/** How often figures change, in ms: faster than that they cannot be read. */
const PERIOD = 200;
/** What is said of a live stream. @type {Record<import('../live-connection.js').LiveState, string>} */
const STATES = {
  connecting: 'connecting',
  waiting: 'waiting for the source',
  live: 'live',
  ended: 'the source has ended',
  over: 'the stream has ended',
  lost: 'server lost, trying again',
};

export class Cards {
  #cards = byId('cards');
  /** @type {{ player: IsvPlayer, name: HTMLElement, facts: HTMLElement, list: HTMLElement, figures: Map<string, HTMLElement> }[]} */
  #shown = [];
  #last = 0;

  /** @param {{ player: IsvPlayer, name: string }[]} players */
  show(players) {
    this.#shown = players.map(({ player, name }) => {
      const title = make('h2', { text: name });
      title.title = name;
      return { player, name: title, facts: make('p', { class: 'dim' }), list: make('dl'), figures: new Map() };
    });
    this.#cards.replaceChildren(...this.#shown.map(({ name, facts, list }) => make('article', {}, name, facts, list)));
    this.#cards.classList.toggle('two', players.length > 1);
    this.#last = 0;
  }

  get brief() {
    return this.#cards.classList.contains('brief');
  }

  set brief(brief) {
    this.#cards.classList.toggle('brief', brief);
  }

  /** @param {number} now ms @param {import('./stage.js').Stage} stage */
  update(now, stage) {
    if (now - this.#last < PERIOD) return;
    this.#last = now;
    for (const { player, name, facts, list, figures } of this.#shown) {
      facts.textContent = factsOf(player);
      name.textContent = player.metadata.title ?? name.title;
      for (const [title, value] of Object.entries({ ...streamFigures(player), ...timeFigures(player, stage) })) {
        let figure = figures.get(title);
        if (!figure) {
          figure = make('dd');
          figures.set(title, figure);
          list.append(make('dt', { text: title }), figure);
        }
        figure.textContent = value;
      }
    }
  }
}

/** @param {IsvPlayer} player */
function factsOf({ facts, live, error }) {
  if (error) return 'cannot be played';
  if (!facts) return live ? STATES[live.state] : 'loading';
  const fps = `${Number(facts.fps.toFixed(3))} fps`;
  return `${facts.profile}, ${asLength(facts.voxelSize)} voxels, ${fps}`;
}

/** @param {IsvPlayer} player @returns {Record<string, string>} */
function streamFigures(player) {
  const { shown, source, live, ahead } = player;
  const triangles = shown ? asCount(shown.triangles) : '';
  const frame = shown ? `${asBytes(shown.packetBytes)}${shown.keyframe ? ' key' : ''}` : '';
  if (live) {
    return {
      State: STATES[live.state],
      Latency: live.latencyMs === null ? '' : `${Math.round(live.latencyMs)} ms`,
      Bitrate: asBitrate(live.bitrate),
      Frame: frame,
      Triangles: triangles,
      Buffer: `${live.buffered} frames`,
      Dropped: String(live.dropped),
    };
  }
  if (!source || !ahead) return {};
  const second = Math.max(1, Math.round(player.fps));
  const from = Math.max(0, Math.min(player.frame - Math.floor(second / 2), source.frames - second));
  const frames = Math.min(second, source.frames);
  const whole = source.bytesBetween(0, source.frames);
  const { starts, duration } = source.times;
  return {
    ...(source.rungs ? rungFigures(source.rungs) : {}),
    Size: `${asBytes(whole)}, ${asBitrate((8 * whole) / duration)}`,
    'This second': asBitrate((8 * source.bytesBetween(from, from + frames)) / (starts[from + frames] - starts[from])),
    Frame: frame,
    Triangles: triangles,
    Buffer: `${ahead.held} frames, ${asBytes(ahead.bytes)}`,
  };
}

/** Which rung of a ladder is shown, and what the network gives. @param {import('../ladder/source.js').Rungs} rungs */
function rungFigures({ shown, all, throughput }) {
  return {
    Rung: shown < 0 ? '' : `${shown + 1} of ${all.length}`,
    Network: throughput ? asBitrate(throughput) : '',
  };
}

/** @param {IsvPlayer} player @param {import('./stage.js').Stage} stage @returns {Record<string, string>} */
function timeFigures({ shown, uploadMs }, stage) {
  if (!shown) return {};
  const draw = asMs(uploadMs + stage.drawMs);
  return {
    Decode: asMs(shown.decodeMs),
    Surface: asMs(shown.surfaceMs),
    Draw: draw,
    Ground: `lines ${asLength(stage.spacing)} apart`,
  };
}
