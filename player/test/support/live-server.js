// A small server of a live stream, in the protocol of `isv serve --live`: enough of WebSocket (RFC 6455) for one page.

import { createHash } from 'node:crypto';
import { createServer } from 'node:http';
import { packetsOf } from './stream.js';

/** What the handshake's key is joined with. */
const GUID = '258EAFA5-E914-47DA-95CA-C5AB0DC85B11';

/**
 * Sends a stream's frames at its rate, over and over, stamped with the time.
 * @param {Uint8Array} stream
 * @param {number} [port] 0 for a free one
 * @returns {Promise<{ port: number, restart: () => void, kill: () => Promise<void> }>} `restart`: the source ends and begins again
 */
export async function serveLive(stream, port = 0) {
  const packets = packetsOf(stream);
  const header = message(0, stream.subarray(0, 48));
  /** @type {Map<import('node:stream').Duplex, boolean>} viewers, and whether each has had a keyframe */
  const viewers = new Map();
  let number = 0;
  const server = createServer();
  server.on('upgrade', (request, socket) => {
    const key = createHash('sha1').update(`${request.headers['sec-websocket-key']}${GUID}`).digest('base64');
    socket.write(
      `HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: ${key}\r\n\r\n`,
    );
    socket.on('data', (data) => answer(socket, data));
    socket.on('error', () => viewers.delete(socket));
    socket.on('close', () => viewers.delete(socket));
    socket.write(header);
    viewers.set(socket, false);
  });
  const timer = setInterval(() => {
    const packet = packets[number++ % packets.length];
    const keyframe = (packet[5] & 1) === 1;
    const sent = message(keyframe ? 4 : 1, f64(Date.now()), packet);
    for (const [viewer, begun] of viewers) {
      if (!begun && !keyframe) continue;
      viewers.set(viewer, true);
      viewer.write(sent);
    }
  }, 1000 / 15);
  await new Promise((listening) => server.listen(port, '127.0.0.1', () => listening(undefined)));
  const address = /** @type {import('node:net').AddressInfo} */ (server.address());
  const restart = () => {
    number = 0;
    for (const viewer of viewers.keys()) {
      viewer.write(message(2));
      viewer.write(header);
      viewers.set(viewer, false);
    }
  };
  const kill = async () => {
    clearInterval(timer);
    for (const viewer of viewers.keys()) viewer.destroy();
    await new Promise((closed) => server.close(closed));
  };
  return { port: address.port, restart, kill };
}

/** Answers the question for the clock. @param {import('node:stream').Duplex} socket @param {Buffer} data one masked frame of 8 bytes */
function answer(socket, data) {
  if (data[0] !== 0x82 || data[1] !== 0x88) return;
  const asked = data.subarray(6, 14).map((byte, at) => byte ^ data[2 + (at % 4)]);
  socket.write(message(3, f64(Date.now()), asked));
}

/** A binary message. @param {number} kind @param {...Uint8Array} parts */
function message(kind, ...parts) {
  const payload = Buffer.concat([Buffer.of(kind), ...parts]);
  if (payload.length < 126) return Buffer.concat([Buffer.of(0x82, payload.length), payload]);
  const short = payload.length < 1 << 16;
  const head = Buffer.alloc(short ? 4 : 10);
  head[0] = 0x82;
  if (short) {
    head[1] = 126;
    head.writeUInt16BE(payload.length, 2);
    return Buffer.concat([head, payload]);
  }
  head[1] = 127;
  head.writeBigUInt64BE(BigInt(payload.length), 2);
  return Buffer.concat([head, payload]);
}

/** @param {number} value */
function f64(value) {
  return Buffer.from(Float64Array.of(value).buffer);
}
