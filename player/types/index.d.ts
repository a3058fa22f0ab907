// Types of isv-player.

import type { Group, Material, Mesh } from 'three';

/** What a stream's header says. */
export interface StreamFacts {
  /** Edge of a voxel in metres. */
  voxelSize: number;
  /** Frames a second. */
  fps: number;
  /** Voxels along an edge of a block. */
  blockSide: number;
  /** Truncation in voxels. */
  truncation: number;
  profile: 'paper' | 'main';
  /** Whether it has colour: then vertices of frames have colours. */
  colour: boolean;
}

/** What is known of the blocks of a frame. */
export interface BlockDetails {
  /** Four numbers a block: x, y, z in blocks, and 0 for one that stands still, 1 coded without a reference, 2 predicted. */
  places: Int32Array;
  /** What each block took in the file. */
  bits: Float32Array;
  /** x, y, z in metres for each block: from where it is predicted to where it is. */
  motion: Float32Array;
  /** For each vertex, the bits of the block around it. */
  vertexBits: Float32Array;
}

/** A part of a scene's surface. Its mesh stands alone: vertices at its border are in the parts beside it, too. */
export interface SurfacePart {
  /** x, y, z of each vertex in metres. */
  positions: Float32Array;
  /** Unit normal of each vertex. */
  normals: Float32Array;
  /** Three vertices a triangle, counted from the part's first. */
  indices: Uint32Array;
  /** Smallest x, y, z and largest. */
  bounds: Float32Array;
}

/** A decoded frame. */
export interface Frame {
  /** Triangles that it has. */
  triangles: number;
  /**
   * The parts of its surface, by place, of a large scene without colour: 16,384 blocks or more. A part that stands still is the same
   * object in the next frame. `positions`, `normals` and `indices` are empty then. Null of other frames, of frames that mostly
   * move, and where `details` are wanted.
   */
  parts: Map<string, SurfacePart> | null;
  /** x, y, z of each vertex in metres. */
  positions: Float32Array;
  /** Unit normal of each vertex. */
  normals: Float32Array;
  /** Red, green and blue of each vertex, 8-bit sRGB; empty in streams without colour, grey in a frame that has none of it. */
  colours: Uint8Array;
  /** Three vertices a triangle, counter-clockwise seen from outside. */
  indices: Uint32Array;
  /** Smallest x, y, z and largest. */
  bounds: [number, number, number, number, number, number];
  timestampNs: number;
  keyframe: boolean;
  /** Size in the file. */
  packetBytes: number;
  /** The rung of a ladder that it comes from; 0 of other takes. */
  stream: number;
  /** Size in memory. */
  bytes: number;
  decodeMs: number;
  surfaceMs: number;
  /** Only while the player's `details` are asked for. */
  details: BlockDetails | null;
}

/** An axis of coordinates. */
export type Up = 'y' | 'z' | 'x' | '-y' | '-z' | '-x';

export interface PlayerOptions {
  /** A stream, an MP4 file or the playlist of a ladder, by HTTP; with ranges where the server has them. */
  url?: string;
  /** A file that is already here. */
  source?: Blob | ArrayBuffer | Uint8Array;
  /** Address of a live stream. */
  live?: string;
  /** The decoder, if it is not beside the modules: bundlers move it. */
  wasm?: string | URL | WebAssembly.Module;
  /** How many workers decode; as many as there are cores, up to 4. */
  workers?: number;
  /** Most bytes of decoded frames; 256 MiB. Two frames are held, whatever they take. Of a scene of which one frame takes most of that, half as much again. */
  memory?: number;
  /** Most bytes that decoders may take; half of the machine's memory. A frame that needs more is refused before it takes any. */
  maxMemory?: number;
  /** Most voxels of a frame; as many as that memory has room for. */
  voxels?: number;
  /** The axis of the capture that points up; what the take says, or `y`. The object is turned so that it is Y. */
  up?: Up;
  /** Of the mesh; without it, the stream's colour, unlit, or grey in light where it has none. Colours are in the attribute `srgb`. */
  material?: Material;
  /** Shared with other players that go in step. */
  clock?: Clock;
  autoplay?: boolean;
  loop?: boolean;
  speed?: number;
  /** `false`: its sound is not played, as beside another take. */
  sound?: boolean;
  /** Volume of sound, 0 to 1. */
  volume?: number;
  muted?: boolean;
}

/** What a take says of itself. All of it may be missing, and there may be more. */
export interface Metadata {
  title?: string;
  /** The axis of the stream's coordinates that points up. */
  up?: Up;
  /** Unit of the stream's coordinates. */
  unit?: string;
  device?: string;
  colour_space?: string;
  /** Origin of the stream in the coordinates of the capture, in metres. */
  origin?: [number, number, number];
  encoder?: string;
  /** Unit and axis of the capture. */
  source?: object;
  /** What was decided on the capture's surface. */
  surface?: object;
  settings?: object;
}

/** A rung of a ladder: the take at one rate. */
export interface Rung {
  /** Bits a second at most. */
  bandwidth: number;
  codecs: string;
}

/** Events of a player and what their `detail` is. */
export interface PlayerEvents {
  /** The stream is open: `facts`, `frames` and `duration` are known. */
  open: undefined;
  /** Another frame is shown. */
  frame: { frame: number; decoded: Frame };
  /** The playhead waits for a frame; it goes on. */
  waiting: undefined;
  resumed: undefined;
  /** It went round; it came to the end. */
  wrapped: undefined;
  ended: undefined;
  /**
   * Frames `frame` to before `resumes` cannot be decoded: they are damaged, `missing` from the server, or, `refused`, need more memory
   * than the decoder may have.
   */
  lost: { frame: number; resumes: number; message: string; refused: boolean; missing: boolean };
  /** The playhead has come to frames that are lost: the picture before stays up to frame `resumes`. */
  held: { frame: number; resumes: number; message: string };
  /** The playhead has come to a frame that needs more memory than the decoder may have, and stops. */
  refused: { frame: number; message: string };
  /** Bytes cannot be read, which is tried again; they can. */
  stalled: { message: string };
  recovered: undefined;
  /** What a live stream says of itself has come: `metadata` has it. */
  described: undefined;
  /** Sound is there, and leads the clock. */
  sound: { codec: string };
  /** The browser cannot play the take's sound, or the server does not have it: it plays without. */
  silent: { message: string };
  /** Sound from `begin` to `end` (s) cannot be had: the take plays on without it. */
  gap: { begin: number; end: number; message: string };
  /** The browser plays no sound before the user has touched the page: the take plays muted. */
  blocked: undefined;
  /** Volume or muting has changed. */
  volume: { volume: number; muted: boolean };
  /** Frames of another rung of the ladder are shown: `rung` 0 is the best. */
  rung: { rung: number; rungs: Rung[] };
  /** Of a live stream. */
  state: { state: LiveState };
  /** It cannot be played. */
  error: { error: Error; message: string };
}

/** `ended`: the source ended, and may come again. `over`: the stream has ended for good. */
export type LiveState = 'connecting' | 'waiting' | 'live' | 'ended' | 'over' | 'lost';

/** A live stream, as a player has it. */
export interface LiveSource {
  readonly state: LiveState;
  /** From capture, or from the server, to the picture shown last, in ms; null before it. */
  readonly latencyMs: number | null;
  /** Bits a second over the last seconds. */
  readonly bitrate: number;
  /** Decoded frames that wait to be shown. */
  readonly buffered: number;
  /** Packets dropped to keep up. */
  readonly dropped: number;
}

/** Plays a stream as a three.js object. Call `update` for every picture drawn. */
export class IsvPlayer extends EventTarget {
  constructor(options: PlayerOptions);
  /** To be added to a scene. Metres, in the axes of the capture, turned so that `up` is Y. */
  readonly object: Group;
  /** The axis of the capture that points up. Setting it turns `object`. */
  up: Up;
  readonly mesh: Mesh;
  readonly clock: Clock;
  /** Settles with the first decoded frame; rejects if the stream cannot be played, and with an `AbortError` after `dispose`. */
  readonly ready: Promise<this>;
  /** What the header of the stream says that is shown. Null until it is open. */
  readonly facts: StreamFacts | null;
  /** Number of frames; 0 until the file is open, Infinity of a live stream. */
  readonly frames: number;
  readonly fps: number;
  /** Seconds. */
  readonly duration: number;
  /** What the take says of itself; empty until it is open. */
  readonly metadata: Metadata;
  /** The frame under the playhead. */
  readonly frame: number;
  /** The frame that is shown, and its number; null and -1 before the first. */
  readonly shown: Frame | null;
  readonly shownFrame: number;
  readonly playing: boolean;
  /** Whether the playhead waits for a frame. */
  readonly waiting: boolean;
  readonly live: LiveSource | null;
  /** What ended it; null while it plays. */
  readonly error: Error | null;
  speed: number;
  loop: boolean;
  /** Volume of sound, 0 to 1. */
  volume: number;
  muted: boolean;
  /** Sound, with the element that plays it; null without. */
  readonly sound: { readonly element: HTMLVideoElement; readonly codec: string } | null;
  /** Whether frames come with what each block is and took. Changing it decodes frames anew. */
  details: boolean;
  play(): void;
  pause(): void;
  /** Moves the playhead; the frame is shown as soon as it is decoded. */
  seek(frame: number): void;
  /** Moves by frames and pauses; below 0 goes back. */
  step(frames: number): void;
  /** Moves the playhead while it is being dragged: shows what is near at once. End the drag with `seek`. */
  scrub(frame: number): void;
  /** Moves the clock, and the mesh with it. Returns whether the mesh has changed. */
  update(now?: number): boolean;
  dispose(): void;
  addEventListener<Type extends keyof PlayerEvents>(
    type: Type,
    listener: (event: CustomEvent<PlayerEvents[Type]>) => void,
    options?: boolean | AddEventListenerOptions,
  ): void;
  addEventListener(
    type: string,
    listener: EventListenerOrEventListenerObject | null,
    options?: boolean | AddEventListenerOptions,
  ): void;
}

export type View = 'colour' | 'shaded' | 'normals' | 'wireframe' | 'blocks' | 'motion' | 'bits';

export const VIEWS: readonly { name: View; title: string; says: string; details: boolean }[];

/** Switches a player between views. */
export class IsvViews {
  constructor(player: IsvPlayer);
  /** `colour` at first, unless the player has a material of the user's. A stream without colour is `shaded` instead. */
  view: View;
  /** Colours, as numbers, of the surface under overlays and of triangles' edges. */
  set colours(colours: { form: number; edges: number });
  dispose(): void;
}

/** Playback time, for players that share it. */
export class Clock {
  constructor(facts?: { duration?: number; last?: number });
  /** Seconds from the first frame. */
  seconds: number;
  playing: boolean;
  loop: boolean;
  speed: number;
  /** Seconds; 0 until a take is open. */
  readonly duration: number;
  play(): void;
  pause(): void;
  seek(seconds: number): void;
}

/** An error outside the decoder, with a message that can be shown as it is. */
export class IsvFailure extends Error {
  readonly kind: 'missing' | 'not-isv' | 'damaged' | 'limit' | 'unsupported';
}

/** An error of the decoder. */
export class IsvError extends Error {
  readonly kind: 'malformed' | 'limit' | 'keyframe' | 'order' | 'unsupported';
  /** Blocks of a frame that was refused because it has too many; 0 of any other error. */
  readonly blocks: number;
}
