import assert from 'node:assert/strict';
import { existsSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { skipUnless } from './support/need.js';
import { PLAYER } from './support/server.js';

const PACKAGE = `${PLAYER}node_modules/three`;

const FILES = {
  'three.module.min.js': 'build/three.module.min.js',
  'three.core.min.js': 'build/three.core.min.js',
  'OrbitControls.js': 'examples/jsm/controls/OrbitControls.js',
  LICENSE: 'LICENSE',
};

const skip = skipUnless(existsSync(PACKAGE), 'browser', 'three is not installed', 'the vendored three.js');

test('the vendored three.js is that of the package', { skip }, () => {
  for (const [vendored, packaged] of Object.entries(FILES)) {
    const [ours, theirs] = [`${PLAYER}vendor/three/${vendored}`, `${PACKAGE}/${packaged}`].map((path) => readFileSync(path));
    assert.ok(ours.equals(theirs), vendored);
  }
});

test('the lock file names no registry', () => {
  assert.doesNotMatch(readFileSync(`${PLAYER}package-lock.json`, 'utf8'), /"resolved"/);
});

test('the page loads nothing from elsewhere', () => {
  for (const file of ['index.html', 'style.css', 'src/page/main.js', 'src/player.js', 'src/spawn.js']) {
    const addresses = readFileSync(PLAYER + file, 'utf8').match(/https?:\/\/[^'"\s)]+/g) ?? [];
    assert.deepEqual(
      addresses.filter((address) => !address.startsWith('http://www.w3.org/')),
      [],
      file,
    );
  }
});

test('the page preloads every module that it needs', () => {
  const page = readFileSync(`${PLAYER}index.html`, 'utf8');
  const found = new Set(['src/page/main.js']);
  for (const file of found) {
    for (const [, path] of readFileSync(PLAYER + file, 'utf8').matchAll(/^(?:import|export) .*from '(\.[^']+)'/gm)) {
      found.add(new URL(path, `file:///${file}`).pathname.slice(1));
    }
  }
  assert.deepEqual(
    [...found].filter((file) => !page.includes(`"${file}"`)),
    [],
  );
});
