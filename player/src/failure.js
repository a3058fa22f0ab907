/**
 * What can go wrong outside the decoder, by what the user can do about it.
 * - `missing`: there is no such file, or no network
 * - `not-isv`: the bytes are not an .isv stream
 * - `damaged`: part of the stream is broken
 * - `limit`: more than was allowed
 * - `unsupported`: this browser, server or player cannot
 * @typedef {'missing' | 'not-isv' | 'damaged' | 'limit' | 'unsupported'} FailureKind
 */

/** An error with a message that can be shown to people as it is. */
export class IsvFailure extends Error {
  /**
   * @param {FailureKind} kind
   * @param {string} message a sentence without a full stop
   * @param {{ cause?: unknown }} [options]
   */
  constructor(kind, message, options) {
    super(message, options);
    this.name = 'IsvFailure';
    this.kind = kind;
  }
}

/** A part of a take that cannot be had, though its server answers: what comes after it can be played. */
export class LostPart extends IsvFailure {}

/** @param {unknown} error @returns {string} its words */
export function words(error) {
  return error instanceof Error ? error.message : String(error);
}

/** Whether something was only called off. @param {unknown} error */
export function isAbort(error) {
  return error instanceof Error && error.name === 'AbortError';
}
