// What the page says in words: passing messages, and what keeps it from playing anything.

import { byId, make } from './element.js';

/** How long a passing message stays, in ms. */
const STAYS = 6000;
/** Most messages at a time. */
const MOST = 3;

export class Messages {
  #list = byId('messages');
  #welcome = byId('welcome');
  /** @type {Map<string, HTMLElement>} those that stay until they are taken back */
  #held = new Map();

  /** @param {string} text @param {'' | 'warn' | 'bad'} [tone] */
  say(text, tone = '') {
    const message = this.#add(text, tone);
    setTimeout(() => message.remove(), STAYS);
  }

  /** Says something until it is taken back. @param {string} key @param {string} text @param {'' | 'warn' | 'bad'} [tone] */
  hold(key, text, tone = 'warn') {
    const held = this.#held.get(key);
    if (held?.isConnected) held.textContent = text;
    else this.#held.set(key, this.#add(text, tone));
  }

  /** Offers to do something until it is done or taken back. @param {string} key @param {string} text @param {string} label @param {() => void} action */
  propose(key, text, label, action) {
    this.release(key);
    const message = this.#add(`${text} `, '');
    const button = make('button', { text: label });
    button.addEventListener('click', action);
    message.append(button);
    this.#held.set(key, message);
  }

  /** @param {string} key */
  release(key) {
    this.#held.get(key)?.remove();
    this.#held.delete(key);
  }

  /** There is a picture after all. */
  farewell() {
    this.#welcome.hidden = true;
  }

  /** Offers streams to open. @param {{ name: string, href: string }[]} streams */
  offer(streams) {
    this.welcome();
    byId('welcome-words').textContent = streams.length ? 'Choose a stream, or drop a file here.' : 'Nothing is served here. Drop an .isv or .mp4 file.';
    const items = streams.map(({ name, href }) => {
      const link = make('a', { text: name });
      link.setAttribute('href', href);
      return make('li', {}, link);
    });
    const list = byId('streams');
    list.replaceChildren(...items);
    list.hidden = items.length === 0;
  }

  /** Asks for a file, or says why there is no picture. @param {string} [why] */
  welcome(why) {
    this.#welcome.hidden = false;
    this.#welcome.classList.toggle('failed', why !== undefined);
    if (why === undefined) return;
    const title = /** @type {HTMLElement} */ (this.#welcome.querySelector('h1'));
    title.textContent = 'This cannot be played';
    byId('welcome-words').textContent = `${why}.`;
    this.#welcome.setAttribute('role', 'alert');
  }

  clear() {
    this.#welcome.hidden = true;
    this.#list.replaceChildren();
    this.#held.clear();
  }

  /** @param {string} text @param {string} tone */
  #add(text, tone) {
    for (const same of [...this.#list.children].filter((one) => one.textContent === text)) same.remove();
    const message = make('p', { text, class: tone });
    this.#list.append(message);
    while (this.#list.children.length > MOST) this.#list.firstElementChild?.remove();
    return message;
  }
}
