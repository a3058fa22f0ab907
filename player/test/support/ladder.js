// Ladders as docs/spec/mp4.md has them, made for tests.

import { made } from '../../src/mp4/boxes.js';
import { geometryMoof, geometryTrak, mvhd, trex } from './mp4.js';
import { packetsOf } from './stream.js';

const TIMESCALE = 30_000;
const FRAME = TIMESCALE / 30;

/**
 * Files of a ladder, by name.
 * @param {Uint8Array[]} streams with keyframes at the same frames, 30 a second, the best first
 * @param {{ sound?: import('./mp4.js').Sound, padding?: number }} [options] padding: bytes of nothing in each segment for each byte of frames
 * @returns {Record<string, Uint8Array>}
 */
export function laddered(streams, { sound, padding = 0 } = {}) {
  /** @type {Record<string, Uint8Array>} */
  const files = {};
  const ftyp = made('ftyp', Buffer.from('iso6\0\0\0\0iso6cmfc', 'latin1'));
  const styp = made('styp', Buffer.from('msdh\0\0\0\0msdhmsix', 'latin1'));
  const master = ['#EXTM3U', '#EXT-X-VERSION:7'];
  if (sound) {
    master.push('#EXT-X-MEDIA:TYPE=AUDIO,GROUP-ID="sound",NAME="sound",DEFAULT=YES,URI="sound/stream.m3u8"');
    files['sound/init.mp4'] = Buffer.concat([ftyp, made('moov', mvhd(), sound.trak, made('mvex', sound.trex))]);
    const lines = sound.fragments.map(({ time, moof, mdat }, at) => {
      files[`sound/${at}.m4s`] = Buffer.concat([styp, moof, mdat]);
      const end = sound.fragments[at + 1]?.time ?? time + sound.timescale;
      return `#EXTINF:${((end - time) / sound.timescale).toFixed(6)},\n${at}.m4s`;
    });
    files['sound/stream.m3u8'] = playlist(lines);
  }
  streams.forEach((stream, rung) => {
    const packets = packetsOf(stream);
    const folder = `rung-${rung}`;
    files[`${folder}/init.mp4`] = Buffer.concat([ftyp, made('moov', mvhd(), geometryTrak(TIMESCALE, stream.subarray(0, 48)), made('mvex', trex(1)))]);
    const lines = [];
    let most = 0;
    for (let first = 0, segment = 0; first < packets.length; segment++) {
      let end = first + 1;
      while (end < packets.length && !(packets[end][5] & 1)) end++;
      const of = packets.slice(first, end);
      const moof = geometryMoof(of, Array.from({ length: of.length + 1 }, (_, frame) => (first + frame) * FRAME), segment);
      const mdat = made('mdat', ...of);
      const file = Buffer.concat([styp, moof, mdat, ...(padding ? [made('free', new Uint8Array(padding * mdat.length))] : [])]);
      files[`${folder}/${segment}.m4s`] = file;
      most = Math.max(most, (8 * file.length * 30) / of.length);
      lines.push(`#EXT-X-ISV-FRAMES:${of.length}\n#EXTINF:${(of.length / 30).toFixed(6)},\n${segment}.m4s`);
      first = end;
    }
    files[`${folder}/stream.m3u8`] = playlist(lines);
    const audio = sound ? ',AUDIO="sound"' : '';
    master.push(`#EXT-X-STREAM-INF:BANDWIDTH=${Math.ceil(most)},CODECS="isv1.1.2${sound ? ',opus' : ''}"${audio}`, `${folder}/stream.m3u8`);
  });
  files['master.m3u8'] = Buffer.from(`${master.join('\n')}\n`);
  return files;
}

/** @param {string[]} lines */
function playlist(lines) {
  return Buffer.from(['#EXTM3U', '#EXT-X-VERSION:7', '#EXT-X-TARGETDURATION:2', '#EXT-X-PLAYLIST-TYPE:VOD', '#EXT-X-MAP:URI="init.mp4"', ...lines, '#EXT-X-ENDLIST', ''].join('\n'));
}
