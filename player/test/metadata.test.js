import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { test } from 'node:test';
import { metadataOf } from '../src/metadata.js';
import { BlobBytes } from '../src/ranges.js';
import { FileSource } from '../src/source.js';
import { Decoder } from '../src/wasm.js';
import { metadataPacket, packetsOf, withMetadata } from './support/stream.js';

const stream = await readFile(new URL('../../conformance/version_2_skipped.isv', import.meta.url));

test('a stream says what it is before its first frame', async () => {
  const parser = await Decoder.create();
  const said = { title: 'Dancer', novelty: [1], up: '-y', unit: 'mm', device: 'rig 2', origin: [0, 1.5, -2], settings: { voxel: '5mm' } };
  for (const indexed of [true, false]) {
    const bytes = withMetadata(stream, metadataPacket(said), { indexed });
    const source = await FileSource.open(new BlobBytes(new Blob([new Uint8Array(bytes)]), 'take.isv'), parser);
    assert.deepEqual([source.indexed, source.frames], [indexed, packetsOf(bytes).length]);
    assert.deepEqual(source.metadata, said);
  }
});

test('what is of another type is left out', () => {
  for (const [said, kept] of /** @type {[unknown, object][]} */ ([
    [{ title: 5, up: 'north', origin: [1, 2], unit: '', settings: [], source: 'mm' }, {}],
    [{ title: 'x'.repeat(1001), up: 'z', origin: [1, 2, '3'] }, { up: 'z' }],
    [{ origin: [1, 2, 1e999] }, {}],
    [[], {}],
    [null, {}],
    ['title', {}],
    [{ surface: null, encoder: 'isv 1', colour_space: 'sRGB' }, { encoder: 'isv 1', colour_space: 'sRGB' }],
    [{ title: 'x', more: 'x'.repeat(65_536) }, {}],
  ]))
    assert.deepEqual(metadataOf(metadataPacket(said)), kept, JSON.stringify(said));
});

test('what cannot be read says nothing', () => {
  const packet = metadataPacket({ title: 'x' });
  const other = Buffer.from(packet);
  other[4] = 0x81;
  const long = Buffer.from(packet);
  long.writeUInt32LE(0xffffffff, 8);
  const broken = Buffer.from(packet);
  broken[26] = 0xff;
  for (const bytes of [new Uint8Array(), packet.subarray(0, 20), packet.subarray(0, 30), other, long, broken, Buffer.alloc(100)])
    assert.deepEqual(metadataOf(bytes), {});
  assert.deepEqual(metadataOf(Buffer.concat([other, packet])), { title: 'x' }, 'packets of other types are passed over');
});
