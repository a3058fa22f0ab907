// The page in a browser, as tests use it.

/**
 * @typedef {import('playwright-core').Page} BrowserPage
 * @typedef {{ width?: number, height?: number, dark?: boolean, touch?: boolean }} Screen touch: a phone
 */

/**
 * Opens the page, and closes those that were open before: they would go on drawing. What it says on the console as an error, or throws, is collected.
 * @param {import('playwright-core').Browser} browser
 * @param {string} url
 * @param {Screen} [screen]
 * @returns {Promise<{ page: BrowserPage, errors: string[] }>}
 */
export async function opened(browser, url, { width = 800, height = 600, dark = false, touch = false } = {}) {
  const context = await browser.newContext({
    viewport: { width, height },
    colorScheme: dark ? 'dark' : 'light',
    hasTouch: touch,
    isMobile: touch,
    screen: { width, height },
  });
  const page = await context.newPage();
  await Promise.all(browser.contexts().map((other) => other !== context && other.close()));
  /** @type {string[]} */
  const errors = [];
  page.on('pageerror', (error) => errors.push(String(error.stack)));
  page.on('console', (message) => {
    if (message.type() === 'error') errors.push(message.text());
  });
  await page.goto(url);
  await page.waitForFunction(isReady, undefined, { timeout: 60_000, polling: 20 });
  return { page, errors };
}

/** Whether the page has opened what it was asked for, or says why not. */
function isReady() {
  const { isv, document } = /** @type {any} */ (globalThis);
  return isv?.players.every((/** @type {any} */ player) => player.frames > 0) || !document.getElementById('welcome').hidden;
}

/** Waits until a player shows a frame. @param {BrowserPage} page @param {number} frame @param {number} [player] */
export async function shows(page, frame, player = 0) {
  const shown = (/** @type {{ frame: number, player: number }} */ wanted) =>
    /** @type {any} */ (globalThis).isv?.players[wanted.player]?.shownFrame === wanted.frame;
  await page.waitForFunction(shown, { frame, player }, { timeout: 60_000, polling: 20 });
}

/** What is shown. @param {BrowserPage} page @param {number} [player] */
export function state(page, player = 0) {
  return page.evaluate((player) => {
    const { shown, shownFrame, frame, frames, playing, mesh } = /** @type {any} */ (globalThis).isv.players[player];
    return {
      shownFrame,
      frame,
      frames,
      playing,
      vertices: shown ? shown.positions.length / 3 : 0,
      triangles: shown ? shown.triangles : 0,
      drawn: mesh.geometry.drawRange.count / 3,
      positions: shown ? Array.from(shown.positions.subarray(0, 300)) : [],
    };
  }, player);
}
