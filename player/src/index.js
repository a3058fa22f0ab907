// What the package gives.

export { IsvPlayer } from './player.js';
export { IsvViews, VIEWS } from './views.js';
export { Clock } from './clock.js';
export { Decoder, IsvError } from './wasm.js';
export { IsvFailure } from './failure.js';
