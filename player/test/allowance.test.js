import assert from 'node:assert/strict';
import { test } from 'node:test';
import { COLOUR_BYTES, MOST_VOXELS, VOXEL_BYTES, allowanceFor, allowanceOf, parseMemory, refusal } from '../src/allowance.js';

const GIB = 2 ** 30;
/** Blocks of 8 that an allowance has room for. @param {import('../src/allowance.js').Allowance} allowance */
const blocks = ({ voxels }) => Math.floor(voxels / 512);

test('a decoder may take what the machine has room for', () => {
  const on = (/** @type {number | undefined} */ deviceMemory) => allowanceOf({}, { deviceMemory });
  assert.equal(on(8).bytes, 4 * GIB);
  assert.ok(blocks(on(8)) > 340_000 && blocks(on(4)) > 340_000);
  assert.deepEqual(on(undefined), on(4), 'not every browser tells');
  assert.equal(blocks(on(0.25)), 131_072, 'what was always played still is');
  assert.equal(on(8).trusted, false);
  for (const memory of [1, 2, 4, 8]) assert.ok(on(memory).voxels * VOXEL_BYTES <= Math.max(on(memory).bytes, 805_306_368));
});

test('the user may give it more or less', () => {
  const given = (/** @type {number} */ maxMemory) => allowanceOf({ maxMemory }, { deviceMemory: 2 });
  assert.deepEqual(given(120 * 512), { bytes: 120 * 512, voxels: 10 * 512, trusted: true });
  assert.equal(given(6 * GIB).voxels, MOST_VOXELS, 'WebAssembly has 4 GiB of addresses');
  assert.equal(allowanceOf({ voxels: 4096 }, {}).voxels, 4096);
});

test('amounts of memory are read as the command line has them', () => {
  for (const [text, bytes] of /** @type {[string, number][]} */ ([
    ['6442450944', 6 * GIB],
    ['6GiB', 6 * GIB],
    ['500MB', 5e8],
    ['1.5 gb', 1.5e9],
  ]))
    assert.equal(parseMemory(text), bytes, text);
  for (const text of ['', 'GB', '-1GB', '0', '2TB', '1e999', '2GB or so'])
    assert.throws(() => parseMemory(text), /max-memory=.* write 500MB or 2GiB/, text);
});

test('a refusal says how much is needed, how much there is, and what to do', () => {
  const allowance = allowanceOf({ maxMemory: 512e6 }, {});
  assert.equal(
    refusal(3, 200_000, 8, allowance),
    "frame 3 needs 200,000 blocks, about 1.2 GB, and the player was given 512 MB: isv view --max-memory 1.3GB, or max-memory=1.3GB in the page's address, allows it",
  );
  const enough = allowanceOf({ maxMemory: parseMemory('1.3GB') }, {});
  assert.ok(enough.voxels >= 200_000 * 512, 'what it advises is enough');
  assert.match(refusal(0, 600_000, 8, allowance), /a decoder in a browser can have 3\.2 GB: larger voxels/);
  assert.match(refusal(null, 100_000, 8, allowanceOf({}, { deviceMemory: 8 })), /^the live stream needs .* if you trust it/);
  assert.match(refusal(7, 0, 8, allowance), /^frame 7 needs more memory than this browser gives/);
});

test('colour takes memory of its own', () => {
  const given = allowanceOf({ maxMemory: 512e6 }, {});
  assert.equal(allowanceFor(given, { colour: false }), given);
  const coloured = allowanceFor(given, { colour: true });
  assert.ok(coloured.voxels * (VOXEL_BYTES + COLOUR_BYTES) <= 512e6 && coloured.voxels < given.voxels);
  assert.equal(
    refusal(3, 100_000, 8, coloured),
    "frame 3 needs 100,000 blocks, about 1.2 GB, and the player was given 512 MB: isv view --max-memory 1.3GB, or max-memory=1.3GB in the page's address, allows it",
  );
  const most = allowanceFor(allowanceOf({ maxMemory: 64 * GIB }, {}), { colour: true });
  assert.ok(most.voxels * (VOXEL_BYTES + COLOUR_BYTES) <= MOST_VOXELS * VOXEL_BYTES, 'WebAssembly has 4 GiB of addresses');
  assert.match(refusal(0, 300_000, 8, coloured), /a decoder in a browser can have 3\.2 GB/);
  assert.equal(allowanceFor(allowanceOf({ voxels: 4096 }, {}), { colour: true }).voxels, 4096);
});
