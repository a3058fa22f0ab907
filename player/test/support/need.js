// Things outside the repository that some tests need. The command line's tests have the same in isv-testkit.

import { appendFileSync } from 'node:fs';

const REQUIRED = (process.env.ISV_REQUIRE ?? '').split(',').map((name) => name.trim());

/**
 * Why a test is skipped; false if what it needs is there. Throws if `ISV_REQUIRE` lists the need. Adds a line to the file that
 * `ISV_SKIPS` names.
 * @param {boolean} there
 * @param {'browser' | 'captures'} need
 * @param {string} why
 * @param {string} test
 */
export function skipUnless(there, need, why, test) {
  if (there) return false;
  if (REQUIRED.includes(need)) throw new Error(`ISV_REQUIRE lists ${need}: ${why}`);
  if (process.env.ISV_SKIPS) appendFileSync(process.env.ISV_SKIPS, `${need}\t${test}\n`);
  return why;
}
