// The page: opens what its address names, or files that are dropped on it, and ties controls to players.
//
// `?src=A.isv` plays a file, an MP4 file or the playlist of a ladder, `&compare=B.isv` another beside it, `?live=/live` a live stream, `?list=streams.json` offers several.
// `&view=normals` and `&up=z` are where it begins, `&paused` stands still at first, `&max-memory=2GB` is what decoders may take.

import { Box3 } from 'three';
import { Clock } from '../clock.js';
import { facingOf } from '../facing.js';
import { IsvFailure, words } from '../failure.js';
import { IsvPlayer } from '../player.js';
import { nameOf } from '../ranges.js';
import { UPS, isUp } from '../axes.js';
import { IsvViews, VIEWS } from '../views.js';
import { Cards } from './cards.js';
import { decoding } from './early.js';
import { byId, make } from './element.js';
import { listenToKeys } from './keyboard.js';
import { showLegend } from './legend.js';
import { Messages } from './messages.js';
import { listenToFiles } from './opening.js';
import { ScrubBar } from './scrub-bar.js';
import { filesOf, memoryOf, shareOf } from './share.js';
import { Stage } from './stage.js';
import { Transport } from './transport.js';

/** @typedef {{ name: string, options: import('../player.js').PlayerOptions }} Take */

class Page {
  clock = new Clock();
  /** @type {IsvPlayer[]} */
  players = [];
  /** @type {IsvViews[]} */
  views = [];
  /** @type {import('../views.js').View} */
  view = 'colour';
  stage;
  /** When the first picture was drawn, in ms since the page was asked for; null before it. @type {number | null} */
  firstPictureMs = null;
  #cards = new Cards();
  #messages;
  #scrubBar;
  #transport;
  #framed = false;
  /** Whether the back of a surface can be seen. */
  #open = false;
  /** Volume and muting that the user has chosen. @type {{ volume?: number, muted?: boolean }} */
  #heard = {};
  /** What the page's address says of memory. @type {{ maxMemory?: number }} */
  #memory;

  /** @param {Messages} messages @param {{ maxMemory?: number }} memory */
  constructor(messages, memory) {
    this.#messages = messages;
    this.#memory = memory;
    this.stage = new Stage(byId('canvas', HTMLCanvasElement), byId('divider'));
    this.#scrubBar = new ScrubBar({
      scrub: (frame) => this.players.forEach((player) => player.scrub(frame)),
      seek: (frame) => this.seek(frame),
    });
    const ask = listenToFiles((files) => this.open(files.map((file) => ({ name: file.name, options: { source: file } }))));
    const commands = {
      toggle: () => this.toggle(),
      // The clock is shared: the others follow.
      step: (/** @type {number} */ frames) => this.players[0]?.step(frames),
      seek: (/** @type {number} */ frame) => this.seek(frame),
      faster: (/** @type {number} */ steps) => this.#transport.faster(steps),
      loop: () => (this.clock.loop = !this.clock.loop),
      mute: () => this.#hear({ muted: !this.players[0]?.muted }),
      louder: (/** @type {number} */ steps) => this.#hear({ volume: (this.players[0]?.volume ?? 1) + steps / 10, muted: false }),
      volume: (/** @type {number} */ volume) => this.#hear({ volume, muted: volume === 0 }),
      view: (/** @type {number} */ number) => this.look(VIEWS[number].name),
      turn: (/** @type {number} */ yaw, /** @type {number} */ pitch) => this.stage.turn(yaw, pitch),
      pan: (/** @type {number} */ right, /** @type {number} */ up) => this.stage.pan(right, up),
      zoom: (/** @type {number} */ factor) => this.stage.zoom(factor),
      fit: () => this.fit(),
      grid: () => (this.stage.grid = !this.stage.grid),
      up: (/** @type {number} */ steps) =>
        (this.stage.up = UPS[(UPS.indexOf(this.stage.up) + steps + UPS.length) % UPS.length]),
      figures: () => (this.#cards.brief = !this.#cards.brief),
      open: ask,
      help: () => toggleHelp(),
    };
    this.#transport = new Transport(this.clock, commands);
    listenToKeys(commands);
    this.#listViews();
    this.#cards.brief = innerWidth < 600;
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.#colour());
    requestAnimationFrame((now) => this.#turn(now));
  }

  /** Plays one take, or two side by side. @param {Take[]} takes @param {{ paused?: boolean }} [options] */
  open(takes, { paused = false } = {}) {
    this.#messages.clear();
    for (const views of this.views) views.dispose();
    for (const player of this.players) player.dispose();
    const share = { clock: this.clock, ...this.#memory, ...shareOf(takes.length) };
    this.clock.reset();
    this.clock.seek(0);
    this.#framed = false;
    this.#open = false;
    this.players = takes.map(({ options }, at) => new IsvPlayer({ ...options, ...share, ...this.#heard, sound: at === 0 }));
    this.views = this.players.map((player) => new IsvViews(player));
    this.players.forEach((player, at) => this.#listen(player, takes[at].name));
    this.stage.show(this.players);
    this.#cards.show(this.players.map((player, at) => ({ player, name: takes[at].name })));
    document.body.classList.toggle(
      'live',
      takes.some(({ options }) => options.live !== undefined),
    );
    document.body.classList.remove('empty');
    document.title = `${takes.map(({ name }) => name).join(' | ')} \u00b7 isv`;
    this.look(this.view);
    this.#colour();
    if (!paused) for (const player of this.players) player.play();
  }

  toggle() {
    const playing = this.players.some((player) => player.playing);
    for (const player of this.players) playing ? player.pause() : player.play();
  }

  /** @param {number} frame of the first player; too large is the last */
  seek(frame) {
    const first = this.players[0];
    if (!first || first.live) return;
    // The clock is shared, so that the first has the last word; each of the others may be dragged, which ends here.
    for (const player of [...this.players].reverse()) player.seek(Math.min(frame, first.frames - 1));
  }

  /** Sets volume or muting, also of what is opened later. @param {{ volume?: number, muted?: boolean }} how */
  #hear(how) {
    Object.assign(this.#heard, how);
    for (const player of this.players) Object.assign(player, how);
  }

  /** @param {import('../views.js').View} view */
  look(view) {
    this.view = view;
    for (const views of this.views) views.view = view;
    const colour = document.querySelector('#views input[value=colour]');
    if (colour?.parentElement) colour.parentElement.hidden = !this.#hasColour;
    const input = document.querySelector(`#views input[value=${this.#seenAs}]`);
    if (input instanceof HTMLInputElement) {
      input.checked = true;
      input.parentElement?.scrollIntoView({ block: 'nearest', inline: 'nearest' });
    }
    this.#explain();
    this.stage.stale = true;
  }

  /** Looks at all of the frame that is shown. */
  fit() {
    const box = new Box3();
    for (const { mesh, shown } of this.players)
      if (shown?.triangles && mesh.geometry.boundingBox) box.union(mesh.geometry.boundingBox);
    const first = this.players.find(({ shown }) => shown?.triangles)?.shown;
    const facing = first ? facingOf(first) : null;
    this.#open = facing !== null;
    this.stage.fit(box, facing);
    this.#explain();
  }

  /** Whether what is shown has colour. */
  get #hasColour() {
    return this.players.some(({ facts }) => facts?.colour);
  }

  /** The view that is seen: without colour, its view is the shaded one. */
  get #seenAs() {
    return this.view === 'colour' && !this.#hasColour ? 'shaded' : this.view;
  }

  #explain() {
    showLegend(this.#seenAs, this.players[0]?.facts ?? null, this.#open);
  }

  /** @param {IsvPlayer} player @param {string} name */
  #listen(player, name) {
    const of = this.players.length > 1 ? `${name}: ` : '';
    const on = (/** @type {string} */ type, /** @type {(detail: any) => void} */ then) =>
      player.addEventListener(type, (event) => then(/** @type {CustomEvent} */ (event).detail));
    on('open', () => {
      this.look(this.view);
      // The source has begun anew, with a stream that can be played.
      if (player.live) {
        this.#messages.release('failed');
        this.#messages.farewell();
      }
      const { title } = player.metadata;
      if (title && this.players.length === 1) document.title = `${title} \u00b7 isv`;
      if (player.facts?.colour) this.stage.compile();
      if (player.source && !player.source.indexed)
        this.#messages.say(`${of}the file has no index: it was cut, or is still being written`, 'warn');
    });
    on('error', ({ message }) => this.#fail(player, `${of}${message}`));
    on('stalled', ({ message }) => this.#messages.hold(name, `${message}; trying again`));
    on('recovered', () => this.#messages.release(name));
    on('gap', ({ begin, end, message }) =>
      this.#messages.say(`${of}sound is missing from ${begin.toFixed(1)} to ${end.toFixed(1)} s (${message})`, 'warn'),
    );
    on('silent', ({ message }) => this.#messages.say(`${of}${message}`, 'warn'));
    on('blocked', () =>
      this.#messages.propose('blocked', 'The sound is off.', 'Turn it on', () => this.#hear({ muted: false })),
    );
    on('volume', ({ muted }) => {
      if (!muted) this.#messages.release('blocked');
    });
    on('rung', () => this.#explain());
    let hasCard = false;
    on('refused', ({ message }) => {
      hasCard = !player.shown;
      if (hasCard) this.#messages.welcome(`${of}${message}`);
      else this.#messages.hold(`refused ${name}`, `${of}${message}`, 'bad');
    });
    on('held', ({ resumes, message }) => {
      const until = resumes < player.frames ? `up to frame ${resumes}` : 'to the end';
      this.#messages.hold(`held ${name}`, `${of}the picture stands still ${until} (${message})`);
    });
    on('frame', () => {
      this.#messages.release(`held ${name}`);
      this.#messages.release(`refused ${name}`);
      if (hasCard) this.#messages.farewell();
      hasCard = false;
    });
    on('lost', ({ frame, resumes, message, refused, missing }) => {
      if (refused) {
        // Of a file, the playhead stops there and says why.
        if (player.live) this.#messages.hold(`refused ${name}`, `${of}${message}`, 'bad');
        return;
      }
      const goesOn = player.live
        ? 'it goes on at the next keyframe'
        : resumes < player.frames
          ? `it goes on at frame ${resumes}`
          : 'nothing after it can be shown';
      this.#messages.say(`${of}frame ${frame} is ${missing ? 'missing' : 'damaged'} (${message}); ${goesOn}`, 'bad');
    });
    on('state', ({ state }) => {
      if (state === 'lost') this.#messages.hold('live', 'The server has gone away; trying again');
      else if (state === 'ended') this.#messages.hold('live', 'The source has ended; waiting for it to come again', '');
      else if (state === 'over') this.#messages.hold('live', 'The stream has ended', '');
      else if (state === 'waiting') this.#messages.hold('live', 'Connected; waiting for the source', '');
      else this.#messages.release('live');
    });
  }

  /** @param {IsvPlayer} player @param {string} message */
  #fail(player, message) {
    if (player.shown) this.#messages.hold('failed', message, 'bad');
    else {
      this.#messages.welcome(message);
      this.clock.pause();
    }
  }

  /** @param {number} now */
  #turn(now) {
    requestAnimationFrame((next) => this.#turn(next));
    for (const player of this.players) if (player.update(now)) this.stage.stale = true;
    if (!this.#framed && this.players.some(({ shown }) => shown?.triangles)) {
      this.#framed = true;
      this.stage.covered = innerHeight - byId('foot').getBoundingClientRect().top;
      this.fit();
    }
    if (this.stage.draw() && this.#framed) this.firstPictureMs ??= performance.now();
    this.#cards.update(now, this.stage);
    const first = this.players[0];
    const frames = first?.source ? first.source.times.frameAt(this.clock.duration - 1e-3) + 1 : 0;
    this.#scrubBar.update(first, frames);
    this.#transport.update(first, this.stage, this.#cards.brief, frames);
  }

  #colour() {
    for (const views of this.views)
      views.colours = this.stage.dark ? { form: 0x8d949c, edges: 0x9cc4ff } : { form: 0xc3c8ce, edges: 0x1b57b0 };
    this.stage.stale = true;
  }

  #listViews() {
    for (const { name, title, says } of VIEWS) {
      const input = /** @type {HTMLInputElement} */ (make('input'));
      Object.assign(input, { type: 'radio', name: 'view', value: name, checked: name === this.#seenAs });
      input.addEventListener('change', () => this.look(name));
      const label = make('label', {}, input, make('span', { text: title }));
      label.title = says;
      label.hidden = name === 'colour';
      byId('views').append(label);
    }
  }
}

function toggleHelp() {
  const help = byId('help', HTMLDialogElement);
  if (help.open) help.close();
  else help.showModal();
}

/** What the address names. @param {URLSearchParams} query @returns {Take[]} */
function takesOf(query) {
  const live = query.get('live');
  if (live !== null) return [{ name: 'Live', options: { live } }];
  return filesOf(query).map((url) => ({ name: nameOf(url), options: { url } }));
}

/** Streams that a server offers. @param {string} address of their list @returns {Promise<{ name: string, href: string }[]>} */
async function offered(address) {
  const response = await fetch(address);
  if (!response.ok) throw new IsvFailure('missing', `${address}: the server says ${response.status} ${response.statusText}`.trim());
  const list = await response.json();
  // Only what opens in this page.
  const opens = (/** @type {any} */ one) => typeof one?.name === 'string' && typeof one.href === 'string' && one.href.startsWith('?');
  return Array.isArray(list) ? list.filter(opens) : [];
}

const messages = new Messages();
await decoding;
try {
  const query = new URLSearchParams(location.search);
  const takes = takesOf(query);
  const page = new Page(messages, memoryOf(query));
  // For tests and for the curious.
  Object.assign(globalThis, { isv: page });
  const up = query.get('up');
  if (isUp(up)) page.stage.up = up;
  const view = VIEWS.find(({ name }) => name === query.get('view'));
  if (view) page.look(view.name);
  if (takes.length) page.open(takes, { paused: query.has('paused') });
  else {
    document.body.classList.add('empty');
    const list = query.get('list');
    if (list === null) messages.welcome();
    else messages.offer(await offered(list));
  }
} catch (error) {
  messages.welcome(words(error));
}
