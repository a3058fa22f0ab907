// The published types against the sources: whatever the sources are is what the types promise. `npm run types` checks it.

/** @type {typeof import('../types/index.d.ts').IsvPlayer} */
export let Player;
/** @type {() => typeof Player} */
export const player = () => /** @type {typeof import('../src/index.js')} */ (/** @type {unknown} */ (null)).IsvPlayer;
