// Distance in time of what is seen from what is heard, measured in the page.

/**
 * @typedef {object} Measured
 * @property {number} pictures how many were looked at while it played
 * @property {number} frames how many of them were different
 * @property {number} worst most seconds by which a picture was shown before or after its time, by the element's clock
 * @property {number} wrong pictures that were large where they should have been small, or the other way round
 * @property {number[]} clicks for each click that was heard, how far from a whole second the element's clock was then
 * @property {number} at where the element was when this was read
 */

/** Begins to measure the first player of a page, whose take is a clap. @param {import('playwright-core').Page} page @param {number} between the radii of its pictures */
export async function measure(page, between) {
  await page.waitForFunction(() => /** @type {any} */ (globalThis).isv?.players[0]?.sound && /** @type {any} */ (globalThis).isv.players[0].shown);
  await page.evaluate((between) => {
    const { isv } = /** @type {any} */ (globalThis);
    const player = isv.players[0];
    /** @type {HTMLVideoElement} */
    const element = player.sound.element;
    const measured = { pictures: 0, frames: new Set(), worst: 0, wrong: 0, clicks: /** @type {number[]} */ ([]) };
    Object.assign(globalThis, { measured });
    const update = player.update.bind(player);
    player.update = (/** @type {number} */ now) => {
      const changed = update(now);
      const { playing, held, waitingSince } = isv.clock;
      if (!playing || held || waitingSince !== null || element.paused || element.seeking) return changed;
      const time = element.currentTime;
      const { starts } = player.source.times;
      measured.pictures++;
      measured.frames.add(player.shownFrame);
      measured.worst = Math.max(measured.worst, starts[player.shownFrame] - time, time - starts[player.shownFrame + 1]);
      const phase = time % 1;
      const near = Math.min(phase, 1 - phase, Math.abs(phase - 0.1)) < 0.02;
      if (!near && player.shown.bounds[3] > between !== phase < 0.1) measured.wrong++;
      return changed;
    };
    const context = new AudioContext();
    const analyser = context.createAnalyser();
    analyser.fftSize = 8192;
    context.createMediaElementSource(element).connect(analyser).connect(context.destination);
    context.resume();
    const samples = new Float32Array(analyser.fftSize);
    let last = -1;
    setInterval(() => {
      const now = context.currentTime;
      analyser.getFloatTimeDomainData(samples);
      const time = element.currentTime;
      const first = samples.findIndex((sample) => Math.abs(sample) > 0.1);
      if (first < 0) return;
      const ago = (samples.length - first) / context.sampleRate;
      // The beginning of the click, not of the window over it.
      if (first > 64 && now - ago - last > 0.3) {
        const at = time - ago * element.playbackRate;
        measured.clicks.push(at - Math.round(at));
      }
      last = now - ago;
    }, 10);
  }, between);
}

/** What was measured since this was asked last. @param {import('playwright-core').Page} page @returns {Promise<Measured>} */
export function measured(page) {
  return page.evaluate(() => {
    const { measured, isv } = /** @type {any} */ (globalThis);
    const { pictures, frames, worst, wrong, clicks } = measured;
    Object.assign(measured, { pictures: 0, frames: new Set(), worst: 0, wrong: 0, clicks: [] });
    return { pictures, frames: frames.size, worst, wrong, clicks, at: isv.players[0].sound.element.currentTime };
  });
}
