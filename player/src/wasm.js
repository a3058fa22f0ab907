// The decoder: what `crates/apps/isv-wasm` exports, as a class. Works in a page, in a worker and in node.

/**
 * What the module exports: see `crates/apps/isv-wasm/src/exports.rs`.
 * @typedef {Record<string, (...values: number[]) => number> & { memory: WebAssembly.Memory }} Exports
 */

/**
 * What a stream's header says.
 * @typedef {object} StreamFacts
 * @property {number} voxelSize Edge of a voxel in metres.
 * @property {number} fps Frames a second.
 * @property {number} blockSide Voxels along an edge of a block.
 * @property {number} truncation Truncation in voxels.
 * @property {'paper' | 'main'} profile
 * @property {boolean} colour Whether the vertices of its frames have colours.
 */

/**
 * What a packet's header says.
 * @typedef {object} PacketFacts
 * @property {'frame' | 'keyframe' | 'index' | 'unknown'} kind `unknown`: to be skipped, as its type is not known.
 * @property {number} payloadBytes Bytes after the header.
 * @property {number} timestampNs When the frame is shown, in nanoseconds.
 */

/**
 * Where the frames of a stream are.
 * @typedef {object} StreamIndex
 * @property {Float64Array} offsets Byte offset of each frame's packet.
 * @property {Uint8Array} keyframes 1 for each keyframe, 0 for the others.
 */

/**
 * How the blocks of a frame are coded: those that it codes, and those that stay as they are, by number of the block.
 * @typedef {object} BlockDetails
 * @property {Int32Array} places Four a block: x, y, z in blocks, then 0 if it stays as it is, 1 if it is coded without the frame
 *   before, 2 if it is predicted from it.
 * @property {Float32Array} bits Bits that each takes.
 * @property {Float32Array} motion Three a block: x, y, z in metres from where it is predicted to where it is.
 */

/**
 * The parts of a surface that are others than in the last frame whose surface came in parts. The arrays of the frame are theirs, one
 * part after the other. A part's vertices are its own, and its indices count from the first of them.
 * @typedef {object} PartChanges
 * @property {Int32Array} changed Five a part: x, y, z of its lowest block, in blocks; its vertices; its triangles.
 * @property {Int32Array} removed Three a part that is gone: x, y, z of its lowest block.
 * @property {number} count Parts that there are now.
 * @property {boolean} fresh Whether there were none before: those of earlier frames are gone.
 */

/**
 * A decoded frame. The arrays are the caller's, and nothing else refers to their buffers: they can be transferred.
 * @typedef {object} DecodedFrame
 * @property {number} timestampNs When it is shown, in nanoseconds.
 * @property {boolean} keyframe Whether decoding could have begun here.
 * @property {number} inexactBlocks Blocks that are not what was encoded, after packets that are missing; 0 elsewhere.
 * @property {Float32Array} positions x, y, z of each vertex in metres; empty without a surface.
 * @property {Float32Array} normals x, y, z of each vertex's unit normal; empty where they were not wanted.
 * @property {Uint8Array} colours Red, green, blue of each vertex, 8-bit sRGB; empty in streams without colour, grey where a frame has none.
 * @property {Uint32Array} indices Three vertices a triangle, counter-clockwise seen from outside.
 * @property {BlockDetails} [blocks] Only if details were wanted.
 * @property {PartChanges | null} changes Which parts of the surface the arrays are; null if they are all of it.
 * @property {number} decodeMs How long decoding took, in milliseconds.
 * @property {number} surfaceMs How long the surface took after that.
 */

/**
 * What to do beside decoding.
 * @typedef {object} DecodeOptions
 * @property {number} [at] Where the packet begins in the stream, for the words of errors.
 * @property {boolean} [surface] Whether the surface is extracted; it is, unless this says otherwise.
 * @property {boolean} [normals] Whether vertices get normals.
 * @property {boolean} [details] Whether to tell how the blocks are coded.
 * @property {number} [parts] Blocks of a frame from which on its surface comes in parts, of which those that have changed, without
 *   colours. No frame's does, unless this says otherwise, and none's of which blocks are inexact.
 */

/**
 * `malformed`: bytes that break the format. `limit`: they ask for more memory than is allowed. `keyframe`: the frame predicts from
 * one that was not decoded. `order`: a call too early. `unsupported`: the stream needs a newer decoder.
 * @typedef {'malformed' | 'limit' | 'keyframe' | 'order' | 'unsupported'} ErrorKind
 */

/** @type {(ErrorKind | undefined)[]} By status. */
const ERROR_KINDS = [undefined, 'malformed', 'limit', 'keyframe', 'order', 'unsupported'];
/** @type {PacketFacts['kind'][]} By number. */
const PACKET_KINDS = ['frame', 'keyframe', 'index', 'unknown'];

/** What a decoder cannot do, in words for people. */
export class IsvError extends Error {
  /**
   * @param {ErrorKind} kind
   * @param {string} message
   * @param {number} [blocks]
   */
  constructor(kind, message, blocks = 0) {
    super(message);
    this.name = 'IsvError';
    this.kind = kind;
    /** Blocks of a frame that was refused because it has too many; 0 of any other error. */
    this.blocks = blocks;
  }
}

/**
 * Decodes the packets of one stream in order, from any keyframe on. After an error or a missing packet it goes on at the next keyframe, or
 * at the next resilient frame, of which some blocks are then inexact.
 */
export class Decoder {
  /** Bytes of a stream header, a packet header and a trailer. */
  static STREAM_HEADER_BYTES = 48;
  static PACKET_HEADER_BYTES = 24;
  static TRAILER_BYTES = 16;

  #module;
  /** @type {Exports} */
  #exports;
  /** @type {Uint8Array | undefined} The header of the stream, for a fresh instance. */
  #header;
  /** @type {[voxels: number, trusted: number] | undefined} */
  #limit;
  /** Whether colour is decoded, where there is any. */
  #keepsColour = true;
  /** Whether vertices have colours. */
  #hasColour = false;

  /**
   * @param {WebAssembly.Module} module
   * @param {Exports} exports
   */
  constructor(module, exports) {
    this.#module = module;
    this.#exports = exports;
  }

  /**
   * A decoder with an instance of its own.
   * @param {WebAssembly.Module | BufferSource | URL | string} [source] `isv.wasm`: compiled, its bytes, or where it is; without it,
   *   the file beside this one.
   * @returns {Promise<Decoder>}
   */
  static async create(source = new URL('isv.wasm', import.meta.url)) {
    const module = await compile(source);
    const instance = await WebAssembly.instantiate(module, {});
    return new Decoder(module, exportsOf(instance));
  }

  /** Bytes of memory that the instance has. It never becomes less. */
  get memoryBytes() {
    return this.#exports.memory.buffer.byteLength;
  }

  /**
   * Limits the voxels of a frame, blocks times voxels a block, from the next `open` on.
   * @param {number} voxels
   * @param {{ trusted?: boolean }} [options] whether a frame may take all of them, however few bytes its stream has
   */
  limit(voxels, { trusted = false } = {}) {
    this.#limit = [voxels, trusted ? 1 : 0];
    this.#exports.isv_limit(...this.#limit);
  }

  /**
   * Begins a stream.
   * @param {Uint8Array} header Its first 48 bytes.
   * @param {{ colour?: boolean }} [options] whether colour is decoded, where there is any; it is, unless this says otherwise
   * @returns {StreamFacts}
   * @throws {IsvError}
   */
  open(header, { colour = true } = {}) {
    this.#header = header.slice();
    this.#keepsColour = colour;
    return this.#run(() => {
      const exports = this.#exports;
      exports.isv_keep_colour(colour ? 1 : 0);
      this.#give(header);
      this.#check(exports.isv_open());
      this.#hasColour = exports.isv_has_colour() !== 0;
      return {
        voxelSize: exports.isv_voxel_size(),
        fps: exports.isv_fps(),
        blockSide: exports.isv_block_side(),
        truncation: exports.isv_truncation(),
        profile: exports.isv_profile() === 0 ? 'paper' : 'main',
        colour: this.#hasColour,
      };
    });
  }

  /**
   * Where the index packet begins.
   * @param {Uint8Array} bytes The last 16 bytes of a file.
   * @returns {number | undefined} Nothing if they are no trailer: the file was cut, or is still being written.
   * @throws {IsvError}
   */
  parseTrailer(bytes) {
    return this.#run(() => {
      this.#give(bytes);
      const at = this.#exports.isv_trailer();
      return at < 0 ? undefined : at;
    });
  }

  /**
   * @param {Uint8Array} bytes The whole index packet.
   * @param {number} at Where it begins in the stream.
   * @returns {StreamIndex}
   * @throws {IsvError}
   */
  parseIndex(bytes, at) {
    return this.#run(() => {
      const exports = this.#exports;
      this.#give(bytes);
      this.#check(exports.isv_index(at));
      const frames = exports.isv_index_frames();
      return {
        offsets: this.#copy(Float64Array, exports.isv_index_offsets(), frames),
        keyframes: this.#copy(Uint8Array, exports.isv_index_keyframes(), frames),
      };
    });
  }

  /**
   * @param {Uint8Array} bytes The first 24 bytes of a packet.
   * @param {number} at Where they begin in the stream.
   * @returns {PacketFacts}
   * @throws {IsvError}
   */
  parsePacketHeader(bytes, at) {
    return this.#run(() => {
      const exports = this.#exports;
      this.#give(bytes);
      const payloadBytes = exports.isv_packet(at);
      this.#check(Math.max(-payloadBytes, 0));
      const kind = PACKET_KINDS[exports.isv_packet_kind()];
      return { kind, payloadBytes, timestampNs: exports.isv_packet_timestamp() };
    });
  }

  /**
   * Decodes a frame.
   * @param {Uint8Array} packet Its packet, header and payload.
   * @param {DecodeOptions} [options]
   * @returns {DecodedFrame}
   * @throws {IsvError}
   */
  decode(packet, { at = 0, surface = true, normals = false, details = false, parts = Infinity } = {}) {
    return this.#run(() => {
      const exports = this.#exports;
      this.#give(packet);
      exports.isv_details(details ? 1 : 0);
      const begun = performance.now();
      this.#check(exports.isv_decode(at));
      const decoded = performance.now();
      const inParts = surface && exports.isv_inexact_blocks() === 0 && exports.isv_frame_blocks() >= parts;
      if (surface) {
        const extract = inParts ? exports.isv_surface_parts : exports.isv_surface;
        this.#check(extract(normals ? 1 : 0));
      }
      const surfaced = performance.now();
      const vertices = surface ? exports.isv_vertex_count() : 0;
      const triangles = surface ? exports.isv_triangle_count() : 0;
      const hasColours = this.#hasColour && !inParts;
      return {
        timestampNs: exports.isv_timestamp(),
        keyframe: exports.isv_keyframe() !== 0,
        inexactBlocks: exports.isv_inexact_blocks(),
        positions: this.#copy(Float32Array, exports.isv_vertices(), 3 * vertices),
        normals: this.#copy(Float32Array, exports.isv_normals(), normals ? 3 * vertices : 0),
        colours: this.#copy(Uint8Array, exports.isv_colours(), hasColours ? 3 * vertices : 0),
        indices: this.#copy(Uint32Array, exports.isv_triangles(), 3 * triangles),
        ...(details ? { blocks: this.#blocks() } : {}),
        changes: inParts ? this.#changes() : null,
        decodeMs: decoded - begun,
        surfaceMs: surfaced - decoded,
      };
    });
  }

  /**
   * The hash of the last frame's volume: XXH64, as 16 hexadecimal digits.
   * @returns {string}
   */
  hash() {
    return hexadecimal(this.#exports.isv_hash());
  }

  /**
   * The hash that the last frame's packet states for it.
   * @returns {string | undefined} Nothing if it states none.
   */
  statedHash() {
    const exports = this.#exports;
    return exports.isv_states_hash() === 0 ? undefined : hexadecimal(exports.isv_stated_hash());
  }

  /**
   * How the blocks of the last frame are coded.
   * @returns {BlockDetails}
   */
  #blocks() {
    const exports = this.#exports;
    const count = exports.isv_block_count();
    return {
      places: this.#copy(Int32Array, exports.isv_blocks(), 4 * count),
      bits: this.#copy(Float32Array, exports.isv_block_bits(), count),
      motion: this.#copy(Float32Array, exports.isv_block_motion(), 3 * count),
    };
  }

  /**
   * Which parts of the surface the last call has extracted.
   * @returns {PartChanges}
   */
  #changes() {
    const exports = this.#exports;
    return {
      changed: this.#copy(Int32Array, exports.isv_changed_parts(), 5 * exports.isv_changed_part_count()),
      removed: this.#copy(Int32Array, exports.isv_removed_parts(), 3 * exports.isv_removed_part_count()),
      count: exports.isv_part_count(),
      fresh: exports.isv_parts_are_fresh() !== 0,
    };
  }

  /**
   * Gives input to the next call.
   * @param {Uint8Array} bytes
   */
  #give(bytes) {
    const address = this.#exports.isv_input(bytes.length);
    this.#check(address === 0 ? 2 : 0);
    new Uint8Array(this.#exports.memory.buffer).set(bytes, address >>> 0);
  }

  /**
   * Throws what a status other than 0 stands for.
   * @param {number} status
   */
  #check(status) {
    const kind = ERROR_KINDS[status];
    if (kind === undefined) {
      return;
    }
    const { memory, isv_message, isv_message_bytes, isv_refused_blocks } = this.#exports;
    // Addresses are numbers without a sign.
    const words = new Uint8Array(memory.buffer, isv_message() >>> 0, isv_message_bytes());
    throw new IsvError(kind, new TextDecoder().decode(words), isv_refused_blocks());
  }

  /**
   * A copy of numbers in the instance's memory.
   * @template {Float64Array | Float32Array | Uint32Array | Int32Array | Uint8Array} T
   * @param {new (buffer: ArrayBufferLike, at: number, length: number) => T} type
   * @param {number} address
   * @param {number} length
   * @returns {T}
   */
  #copy(type, address, length) {
    return /** @type {T} */ (new type(this.#exports.memory.buffer, address >>> 0, length).slice());
  }

  /**
   * Makes calls. If the instance stops in one of them, for its memory can grow no further, a fresh one takes its place.
   * @template T
   * @param {() => T} calls
   * @returns {T}
   */
  #run(calls) {
    try {
      return calls();
    } catch (error) {
      // Without memory for the arrays that are given out, what was found is lost, too.
      if (!(error instanceof WebAssembly.RuntimeError || error instanceof RangeError)) {
        throw error;
      }
      this.#restart();
      throw new IsvError('limit', 'the frame takes more memory than there is');
    }
  }

  #restart() {
    this.#exports = exportsOf(new WebAssembly.Instance(this.#module, {}));
    if (this.#limit !== undefined) {
      this.#exports.isv_limit(...this.#limit);
    }
    if (this.#header !== undefined) {
      this.#exports.isv_keep_colour(this.#keepsColour ? 1 : 0);
      this.#give(this.#header);
      this.#exports.isv_open();
    }
  }
}

/**
 * @param {WebAssembly.Module | BufferSource | URL | string} source
 * @returns {Promise<WebAssembly.Module>}
 */
async function compile(source) {
  if (source instanceof WebAssembly.Module) {
    return source;
  }
  if (typeof source === 'string' || source instanceof URL) {
    return WebAssembly.compile(await read(source));
  }
  return WebAssembly.compile(source);
}

/**
 * @param {URL | string} url
 * @returns {Promise<BufferSource>}
 */
async function read(url) {
  // Node has no `fetch` of files.
  if (url instanceof URL && url.protocol === 'file:') {
    const { readFile } = await import('node:fs/promises');
    return readFile(url);
  }
  const response = await fetch(url);
  if (!response.ok) {
    throw new Error(`${url}: ${response.status} ${response.statusText}`);
  }
  return response.arrayBuffer();
}

/**
 * @param {WebAssembly.Instance} instance
 * @returns {Exports}
 */
function exportsOf(instance) {
  return /** @type {Exports} */ (/** @type {unknown} */ (instance.exports));
}

/**
 * @param {number} hash A 64-bit number: a BigInt, which may have come with a sign.
 * @returns {string}
 */
function hexadecimal(hash) {
  return BigInt.asUintN(64, BigInt(hash)).toString(16).padStart(16, '0');
}
