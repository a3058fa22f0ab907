// A browser for tests.

import { existsSync } from 'node:fs';
import { chromium } from 'playwright-core';

const CHROMIUM = process.env.CHROMIUM ?? '/usr/bin/chromium';

/** Whether there is a browser; tests that need one say that they are skipped without. */
export const hasBrowser = existsSync(CHROMIUM);

/** Chromium without a window, drawing in software. @param {...string} more of its options */
export function launch(...more) {
  const args = [
    '--no-sandbox',
    '--use-gl=angle',
    '--use-angle=swiftshader',
    '--enable-unsafe-swiftshader',
    '--disable-quic',
    '--no-first-run',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-sync',
    ...more,
  ];
  return chromium.launch({ executablePath: CHROMIUM, headless: true, args });
}
