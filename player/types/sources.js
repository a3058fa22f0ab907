// The promised types against the sources, for `npm run types`: what the sources have must be what `index.d.ts` says. Not published.

/**
 * @typedef {typeof import('../src/index.js')} Sources
 * @typedef {typeof import('./index.d.ts')} Promised
 */

/** Listeners get a `CustomEvent`, which the sources leave to `EventTarget`. @typedef {'addEventListener' | 'ready'} Narrower */

/** @type {(player: InstanceType<Sources['IsvPlayer']>) => Omit<InstanceType<Promised['IsvPlayer']>, Narrower>} */
export const player = (player) => player;
/** @type {(options: import('./index.d.ts').PlayerOptions) => Omit<import('../src/player.js').PlayerOptions, 'clock'>} */
export const options = (options) => options;
/** @type {(frame: import('../src/worker.js').Frame) => import('./index.d.ts').Frame} */
export const frame = (frame) => frame;
/** @type {(views: InstanceType<Sources['IsvViews']>) => InstanceType<Promised['IsvViews']>} */
export const views = (views) => views;
/** @type {(views: Sources['VIEWS']) => Promised['VIEWS']} */
export const list = (views) => views;
/** @type {(error: InstanceType<Sources['IsvFailure']>) => InstanceType<Promised['IsvFailure']>} */
export const failure = (error) => error;
/** @type {(error: InstanceType<Sources['IsvError']>) => InstanceType<Promised['IsvError']>} */
export const decoderError = (error) => error;
