// A live stream's messages over a WebSocket. Connects again when the server goes away, and learns how the server's clock differs
// from ours.

/** Kinds of messages from the server: their first byte. `ENDED` has another, 1, where the source does not come again. */
const HEADER = 0;
const PACKET = 1;
const ENDED = 2;
const CLOCK = 3;
/** What the stream says of itself. */
const METADATA = 5;
/** A packet at which decoding can begin, or begin to recover. */
const ENTRY = 4;

/** Waits in ms before connecting again, the last one over and over. */
const BACKOFF = [250, 500, 1000, 2000, 4000];
/** How often the server's clock is asked for, in ms. */
const CLOCK_PERIOD = 3000;
/** How long a server may be silent after a question, in ms: a network that is gone does not always say so. */
const SILENCE = 10_000;
/** Answers about the clock that the best is taken of. */
const CLOCK_ANSWERS = 8;

/**
 * `connecting`: for the first time. `waiting`: connected, no stream yet. `live`. `ended`: the source ended, it may come again.
 * `over`: the stream has ended for good. `lost`: the server went away; it is tried again.
 * @typedef {'connecting' | 'waiting' | 'live' | 'ended' | 'over' | 'lost'} LiveState
 * @typedef {object} LiveEvents
 * @property {(state: LiveState) => void} state
 * @property {(header: Uint8Array) => void} header a stream begins; what came before is over
 * @property {(packet: Uint8Array) => void} metadata what the stream that began says of itself
 * @property {(packet: Uint8Array, serverMs: number, entry: boolean) => void} packet when the server had it, in unix ms by its
 *   clock, and whether decoding can begin there
 *
 * @typedef {Pick<WebSocket, 'send' | 'close' | 'readyState'> & { binaryType: string, onopen: unknown, onmessage: unknown, onclose: unknown }} Socket
 */

/**
 * @typedef {object} ClockAnswer
 * @property {number} tripMs from question to answer
 * @property {number} offsetMs how far the server's clock is ahead of ours, give or take half of that
 * @property {number} leastOffsetMs how far it is at least, as packets stamped by it had arrived since this answer
 */

export class LiveConnection {
  /** @type {LiveState} */
  state = 'connecting';
  /** What to add to our clock to have the server's, in ms. */
  offsetMs = 0;
  #connect;
  #on;
  #failures = 0;
  /** @type {Socket | null} */
  #socket = null;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #retry;
  /** @type {ReturnType<typeof setInterval> | undefined} */
  #asking;
  /** When the first question was asked that nothing was heard after. @type {number | null} */
  #unanswered = null;
  /** The last answers about the server's clock, of this connection. @type {ClockAnswer[]} */
  #answers = [];
  #closed = false;

  /** @param {{ connect: () => Socket, on: LiveEvents }} options */
  constructor({ connect, on }) {
    this.#connect = connect;
    this.#on = on;
    this.#open();
  }

  /** The server's clock now, in unix ms. */
  get serverNow() {
    return unixNow() + this.offsetMs;
  }

  close() {
    this.#closed = true;
    clearTimeout(this.#retry);
    clearInterval(this.#asking);
    this.#socket?.close();
  }

  #open() {
    const socket = this.#connect();
    this.#socket = socket;
    // What is behind the address may be another server now: what was learnt before, at first that there is no difference, holds
    // with no certainty at all.
    this.#answers = [{ tripMs: Infinity, offsetMs: this.offsetMs, leastOffsetMs: -Infinity }];
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.#become('waiting');
      this.#askClock();
      this.#asking = setInterval(() => this.#attend(), CLOCK_PERIOD);
    };
    socket.onmessage = (/** @type {MessageEvent} */ { data }) => {
      this.#unanswered = null;
      this.#take(data);
    };
    socket.onclose = () => this.#lost();
  }

  /** Asks for the clock again, if the server is still there. */
  #attend() {
    if (this.#unanswered === null || unixNow() - this.#unanswered < SILENCE) return this.#askClock();
    const socket = /** @type {Socket} */ (this.#socket);
    // It may take minutes to close, and is none of ours any more.
    socket.onmessage = null;
    socket.onclose = null;
    socket.close();
    this.#lost();
  }

  #lost() {
    this.#unanswered = null;
    clearInterval(this.#asking);
    if (this.#closed) return;
    this.#become('lost');
    const wait = BACKOFF[Math.min(this.#failures++, BACKOFF.length - 1)];
    this.#retry = setTimeout(() => this.#open(), wait);
  }

  /** @param {unknown} message */
  #take(message) {
    if (!(message instanceof ArrayBuffer) || message.byteLength < 1) return;
    const bytes = new Uint8Array(message);
    const view = new DataView(message);
    if (bytes[0] === HEADER && bytes.length === 49) {
      this.#failures = 0;
      this.#on.header(bytes.slice(1));
      this.#become('live');
    } else if ((bytes[0] === PACKET || bytes[0] === ENTRY) && bytes.length > 9) {
      const serverMs = view.getFloat64(1, true);
      const latest = this.#answers[this.#answers.length - 1];
      latest.leastOffsetMs = Math.max(latest.leastOffsetMs, serverMs - unixNow());
      this.#estimateOffset();
      this.#on.packet(bytes.slice(9), serverMs, bytes[0] === ENTRY);
    } else if (bytes[0] === METADATA) {
      this.#on.metadata(bytes.slice(1));
    } else if (bytes[0] === ENDED) {
      this.#become(bytes[1] === 1 ? 'over' : 'ended');
      if (this.state === 'over') this.close();
    } else if (bytes[0] === CLOCK && bytes.length === 17) {
      this.#learn(view.getFloat64(1, true), view.getFloat64(9, true));
    }
  }

  #askClock() {
    if (this.#socket?.readyState !== 1) return;
    const question = new DataView(new ArrayBuffer(8));
    question.setFloat64(0, unixNow(), true);
    this.#socket.send(question.buffer);
    this.#unanswered ??= unixNow();
  }

  /** @param {number} serverMs @param {number} askedMs */
  #learn(serverMs, askedMs) {
    const now = unixNow();
    const tripMs = now - askedMs;
    if (!(tripMs >= 0)) return;
    this.#answers.push({ tripMs, offsetMs: serverMs - (askedMs + now) / 2, leastOffsetMs: -Infinity });
    if (this.#answers.length > CLOCK_ANSWERS) this.#answers.shift();
    this.#estimateOffset();
  }

  /** The answer that took the least time says most exactly what the server's clock was; but nothing arrives before it was sent. */
  #estimateOffset() {
    const best = this.#answers.reduce((best, answer) => (answer.tripMs < best.tripMs ? answer : best));
    this.offsetMs = Math.max(best.offsetMs, ...this.#answers.map((answer) => answer.leastOffsetMs));
  }

  /** @param {LiveState} state */
  #become(state) {
    if (state === this.state) return;
    this.state = state;
    this.#on.state(state);
  }
}

/** Our clock in unix ms, with fractions. */
function unixNow() {
  return performance.timeOrigin + performance.now();
}
