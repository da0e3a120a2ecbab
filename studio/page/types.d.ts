/**
 * What parts of the page share: the server's state, the header of a bank, what an AudioWorklet knows.
 * Only types: nothing of this is loaded.
 */

export interface ModeOfClip {
  hertz: number;
  damping_per_second: number;
  amplitude: number;
}

export interface Clip {
  clip: string;
  name: string;
  phase: "waiting" | "listening" | "ready" | "failed" | "stopped";
  /** What is done while it is listened to, or why that failed. */
  message: string | null;
  /** Between 0 and 1: the share of that which is done. */
  progress: number | null;
  seconds: number;
  rate_hz: number;
  /** Between 0 and 1: the share of its energy that is in its modes. */
  explained: number;
  says: string[];
  modes: ModeOfClip[];
}

export interface Target {
  name: string;
  vertex: number;
  position_m: [number, number, number];
  clip: string | null;
  modes: number | null;
  allow_clipped: boolean;
  /** Frequencies [Hz] of the clip's modes that are left out. */
  without: number[];
}

export type Vector = [number, number, number];

/** A material by its name, as `/materials.json` lists it. */
export interface NamedMaterial {
  name: string;
  about: string;
  /** [Pa], [1], [kg/m^3]; those of a wood are along its grain. */
  young: number;
  poisson: number;
  density: number;
  /** At 1 kHz. */
  loss_factor: number;
  colour: Vector;
  wood: boolean;
  grain_young: Vector | null;
}

/** What regions and supports have in common. */
export interface Placed {
  where?: string;
  /** How many places are painted; null if it is not placed by paint. */
  dabs: number | null;
  /** What is wrong with it. */
  fault: string | null;
}

/** A region of the solid: keys that it has in a project, but paint. */
export interface Region extends Placed {
  name: string;
  material?: string;
  young?: number;
  poisson?: number;
  density?: number;
  loss_factor?: number;
  grain_young?: Vector;
  grain?: Vector;
  radial?: Vector;
  pith?: Vector;
  box?: [Vector, Vector];
  mesh?: string;
  part?: string;
  labels?: string;
  label?: string;
  unit?: number;
  depth?: number;
}

/** What holds the solid somewhere: keys that it has in a project, but paint. */
export interface Support extends Placed {
  at?: Vector;
  radius?: number;
  along?: string;
  spring?: number;
  pad?: string;
  thickness?: number;
  mass?: number;
}

export type RowKind = "regions" | "supports";

export interface SolidState {
  mesh: string;
  name: string;
  phase: "reading" | "preparing" | "ready" | "failed";
  /** Between 0 and 1. */
  progress: number | null;
  message: string | null;
  /** Number of the surface at `/surface/N`. */
  surface: number | null;
  vertices: number;
  triangles: number;
  voxels: number;
  unknowns: number;
  longest_side_m: number;
  extents_m: [number, number, number] | null;
  /** Other units that the mesh may be in, the likeliest first. */
  units: { name: string; metres: number; longest_m: number }[];
  /** Axis of the mesh that seems to point up; null if z does. */
  up: string | null;
  /** Thickness that a shell of the mesh might have, if that is open and filled. */
  shell_m: number | null;
}

export interface Wanted {
  hertz: number[];
  dampings_per_second: number[];
  /** A row for each target, in the order of the targets. */
  amplitudes: number[][];
}

interface AnyHeads {
  /** Folders of the workspace that have measured heads. */
  folders: { name: string; heads: number }[];
  message: string | null;
  /** Between 0 and 1. */
  progress: number | null;
  blend: { file: string; comparisons: number } | null;
}

export interface ReadHeads extends AnyHeads {
  phase: "ready";
  folder: string;
  /** The calibration of the folder. */
  file: string;
  heads: number;
  comparisons: number;
  direction: Vector;
}

/** Measured heads and how far their comparison is. */
export type HeadsState =
  | ReadHeads
  | (AnyHeads & {
      phase: "none" | "reading" | "failed";
      folder: string | null;
      file: string | null;
      heads: null;
      comparisons: null;
      direction: null;
    });

/** The event `state` of the server. */
export interface State {
  event: "state";
  revision: number;
  name: string;
  saved: boolean;
  workspace: string;
  undo: string | null;
  redo: string | null;
  solid: SolidState | null;
  targets: Target[];
  clips: Clip[];
  wanted: Wanted | null;
  settings: { [key: string]: any };
  /** Number of what `/composition/N` tells of regions and supports. */
  composition: number | null;
  regions: Region[];
  supports: Support[];
  search: { phase: "idle" | "starting" | "running"; message: string | null };
  fine: { on: boolean; phase: "none" | "working" | "ready"; message: string | null };
  /** Which of two materials the present one is; `null` while there is no other one to swap with. */
  heard: "A" | "B" | null;
  heads: HeadsState;
  builtins: string[];
  examples: { project: string; name: string; says: string }[];
  projects: { project: string; name: string }[];
}

/** The event `progress`, and a row of `history`. */
export interface Progress {
  seconds: number;
  evaluations: number;
  cost: number;
  frequency_cost: number;
  amplitude_cost: number;
  regulariser: number;
}

/** What was found on the fine solid after so many seconds of a search. */
export interface FineCheck {
  seconds: number;
  cost: number;
  coarse_rms_cents: number;
  fine_rms_cents: number;
}

export interface ArrayHeader {
  name: string;
  type: "f4" | "f8" | "u4" | "u2";
  shape: number[];
}

/** Header of the binary event `bank`. */
export interface BankHeader {
  event: "bank";
  number: number;
  surface: number;
  fine: boolean;
  cost: number | null;
  rms_cents: number | null;
  /** Motions of the solid as a whole that nothing resists: 6 of a free one. */
  rigid_motions?: number;
  targets: string[];
  /** Of modes that shall stay silent, null. */
  wanted_hertz: (number | null)[] | null;
  cents: (number | null)[] | null;
  bark: (number | null)[] | null;
  /** Partials of the clips that no mode of the solid can have. */
  left_out_hz?: number[];
  /** Whether a design sounds like its clips, in words; of other materials, nothing. */
  verdict?: string | null;
  /** What ended the search for a design: its budget, an interrupt, or that its frequencies are met. */
  ended_by?: string | null;
  arrays?: ArrayHeader[];
}

/** Arrays of the binary event `bank`: V vertices, N modes, T targets. */
export interface BankArrays {
  /** (N) [Hz] */
  hertz: Float64Array;
  /** (N) [1/s] */
  dampings: Float64Array;
  /** (V, N) [full scale per N s] */
  gains: Float32Array;
  /** (V) [Pa] */
  young: Float32Array;
  /** (T, N) [full scale per N s] */
  struck: Float64Array;
}

/** Arrays of the binary answer to `/composition/N`: V vertices of the surface, 65535 of no row. */
export interface CompositionArrays {
  /** (V) number of the region */
  region: Uint16Array;
  /** (V) number of the support, of those that are not at a point alone */
  support: Uint16Array;
}

/** Header of the binary answer to `/surface/N`. */
export interface SurfaceHeader {
  event: "surface";
  number: number;
  unit: number;
  arrays?: ArrayHeader[];
}

/** Arrays of a surface: V vertices, F triangles. */
export interface SurfaceArrays {
  /** (V, 3) [m] */
  positions: Float32Array;
  /** (V, 3) unit vectors into the solid */
  inward: Float32Array;
  /** (F, 3) */
  triangles: Uint32Array;
}

/** A strike for the processor of `bank-processor.js`. */
export interface StrikeMessage {
  do: "strike";
  /** (N) what each mode sounds with [full scale]. */
  gains: ArrayLike<number>;
  /** Duration of the force, half a sine; 0 is an impulse. */
  contact_seconds?: number;
  /** Time of the context; without it at once. */
  at_seconds?: number;
}

/** What the processor of `bank-processor.js` is told. */
export type BankMessage =
  | { do: "bank"; hertz: ArrayLike<number>; dampings: ArrayLike<number> }
  | StrikeMessage
  | { do: "heard"; solo: number[] | null; muted: number[] }
  | { do: "volume"; volume: number }
  | { do: "silence" };

/** What it tells, some thirty times a second while anything sounds. */
export interface BankReport {
  /** Largest magnitude since the last report, before the limiter. */
  peak: number;
  /** Modes that ring, those of former materials with them. */
  ringing: number;
  /** Whether the limiter has held anything back since. */
  limited: boolean;
}

// An AudioWorklet has a scope of its own, of which TypeScript's library of the page says nothing.
declare global {
  const sampleRate: number;
  const currentFrame: number;
  const currentTime: number;
  abstract class AudioWorkletProcessor {
    readonly port: MessagePort;
    constructor(options?: any);
    abstract process(
      inputs: Float32Array[][],
      outputs: Float32Array[][],
      parameters: Record<string, Float32Array>,
    ): boolean;
  }
  function registerProcessor(
    name: string,
    processor: new (options?: any) => AudioWorkletProcessor,
  ): void;
}
