// Servers that fall silent: what is waited for too long is given up.

/** Longest silence of a server in ms: a request that goes on no more is given up. */
export const SILENCE = 10_000;

/** Silence of a server that is waited for: a signal, if it becomes too long. */
export class Silence {
  #longest;
  #quiet = new AbortController();
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #timer;

  /** Begins. @param {number} longest ms */
  constructor(longest) {
    this.#longest = longest;
    this.begin();
  }

  get signal() {
    return this.#quiet.signal;
  }

  get isTooLong() {
    return this.#quiet.signal.aborted;
  }

  /** Begins anew: something has come. */
  begin() {
    this.end();
    this.#timer = setTimeout(() => this.#quiet.abort(), this.#longest);
  }

  /** Nothing is waited for any more. */
  end() {
    clearTimeout(this.#timer);
  }
}
