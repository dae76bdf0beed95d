// The moments of a session in typed arrays: one moment is a row of floats (700 bytes with the usual instruments). Times are seconds
// since the session's start.
import type { InstrumentMoment, Moment, ShortPose, View } from "wire";
import { FIRST_INSTRUMENT, INSTRUMENTS, isOptic, USUAL, type Instruments } from "./instruments";

export { INSTRUMENTS } from "./instruments";
export const BODIES = 3;
const POSE = 7; // w, x, y, z; x, y, z

// Places in a row.
export const STATE = 0;
export const JOINT_VALIDITY = 1;
export const FLEXION = 2;
export const VARUS = 3;
export const INTERNAL = 4;
const SHIFT = 5;
const DRAWER = 6;
const DISTRACTION = 7;
export const WORKING = 8; // the instrument that is worked with, from 0; -1: none
const FIRST_BODY = 9;
const FIRST_TOOL = FIRST_BODY + 2 * POSE * BODIES;

// Places in an instrument's part of it.
export const SEEN = 0; // 1 + Validity; 0: never seen
export const LOST = 2; // SEEN is 1 above it
export const TIP = 1;
export const WARPED = TIP + POSE;
export const NEAREST = WARPED + POSE;
export const PENETRATION = NEAREST + 1;
export const WARP = NEAREST + 2;
export const GAIN = NEAREST + 3;
export const GAIN_LEAST = NEAREST + 4;
export const SPEED = NEAREST + 5;
export const OPENING = NEAREST + 6;
export const BUTTONS = NEAREST + 7;
export const HAS_WARPED = NEAREST + 8;
export const FORCE = NEAREST + 9; // N; NaN: it has no gauge, or the gauge is lost
const TOOL_WIDTH = NEAREST + 10;

export const LOOSE = 8; // bodies that a case may have
const FIRST_LOOSE = FIRST_TOOL + TOOL_WIDTH * INSTRUMENTS;

// Places in a loose body's part of it.
export const LOOSE_STATE = 0; // 1 + LooseMoment.State; 0: there is none
export const LOOSE_ON = 1; // as of LooseMoment
export const LOOSE_POSE = 2;
const LOOSE_WIDTH = LOOSE_POSE + POSE;

export const WIDTH = FIRST_LOOSE + LOOSE_WIDTH * LOOSE;

function widthOf(instruments: Instruments, loose: boolean): number {
  return loose ? WIDTH : FIRST_TOOL + TOOL_WIDTH * instruments.length;
}

export type Row = Float32Array;

/** T_mockup_body at a place of a row; `virtual`: T_mockup_virtual. */
export function bodyAt(body: number, virtual: boolean): number {
  return FIRST_BODY + POSE * (2 * body + (virtual ? 1 : 0));
}

/** Where an instrument's part of a row begins; `instrument` from 0, the probe. */
export function toolAt(instrument: number): number {
  return FIRST_TOOL + TOOL_WIDTH * instrument;
}

/** Where a loose body's part of a row begins. */
export function looseAt(body: number): number {
  return FIRST_LOOSE + LOOSE_WIDTH * body;
}

export function newRow(): Row {
  const row = new Float32Array(WIDTH);
  row[WORKING] = -1;
  for (let tool = 0; tool < INSTRUMENTS; tool++) row[toolAt(tool) + FORCE] = NaN;
  for (let body = 0; body < BODIES; body++) row[bodyAt(body, false)] = row[bodyAt(body, true)] = 1;
  return row;
}

/** To the bit; what neither knows (NaN) is the same, too. */
export function sameRow(a: Row, b: Row): boolean {
  for (let i = 0; i < WIDTH; i++) if (!Object.is(a[i], b[i])) return false;
  return true;
}

function putPose(row: Row, at: number, pose: ShortPose | undefined): boolean {
  if (pose?.q.length !== 4 || pose.t.length !== 3) return false;
  for (let k = 0; k < 4; k++) row[at + k] = pose.q[k]!;
  for (let k = 0; k < 3; k++) row[at + 4 + k] = pose.t[k]!;
  return true;
}

function putTool(row: Row, tool: InstrumentMoment): void {
  const at = toolAt(tool.channel - FIRST_INSTRUMENT);
  if (!putPose(row, at + TIP, tool.tip)) return;
  row[at + SEEN] = 1 + tool.validity;
  row[at + HAS_WARPED] = putPose(row, at + WARPED, tool.warped) ? 1 : 0;
  row[at + NEAREST] = tool.nearestMm;
  row[at + PENETRATION] = tool.penetrationMm;
  row[at + WARP] = tool.warpMm;
  row[at + GAIN] = tool.gain;
  row[at + GAIN_LEAST] = tool.gainLeast;
  row[at + SPEED] = tool.speedMmS;
  row[at + OPENING] = tool.opening;
  row[at + BUTTONS] = tool.buttons;
  row[at + FORCE] = tool.forceN ?? NaN;
}

/** A moment as a row. Bodies and instruments that it does not name stay as the row has them. */
export function pack(moment: Moment, row: Row): void {
  row[STATE] = moment.state;
  row[JOINT_VALIDITY] = moment.jointValidity;
  const joint = moment.joint;
  row[FLEXION] = joint?.flexionDeg ?? NaN;
  row[VARUS] = joint?.varusDeg ?? NaN;
  row[INTERNAL] = joint?.internalDeg ?? NaN;
  row[SHIFT] = joint?.shiftMm ?? NaN;
  row[DRAWER] = joint?.drawerMm ?? NaN;
  row[DISTRACTION] = joint?.distractionMm ?? NaN;
  for (const { body, pose, virtualPose } of moment.bodies) {
    if (body < BODIES && putPose(row, bodyAt(body, false), pose)) putPose(row, bodyAt(body, true), virtualPose ?? pose);
  }
  for (const tool of moment.instruments) {
    const instrument = tool.channel - FIRST_INSTRUMENT;
    if (instrument >= 0 && instrument < INSTRUMENTS) putTool(row, tool);
  }
  moment.loose.slice(0, LOOSE).forEach(({ state, on, pose }, body) => {
    const at = looseAt(body);
    if (!putPose(row, at + LOOSE_POSE, pose)) return;
    row[at + LOOSE_STATE] = 1 + state;
    row[at + LOOSE_ON] = on;
  });
}

const PARKED_MM = 40; // from all surfaces

// The one that moves; another takes its place where that moves clearly more. One that lies on the table does no work.
function working(row: Row, instruments: Instruments): number {
  const parked = (at: number): boolean => row[at + NEAREST]! < 0 || row[at + NEAREST]! > PARKED_MM;
  const speedOf = (instrument: number): number => {
    const at = toolAt(instrument);
    return row[at + SEEN]! < 1 || row[at + SEEN]! - 1 === LOST || parked(at) ? -1 : row[at + SPEED]!;
  };
  let best = row[WORKING]!;
  if (best >= 0 && parked(toolAt(best))) best = -1;
  for (let instrument = 0; instrument < instruments.length; instrument++) {
    if (isOptic(instruments[instrument])) continue;
    const speed = speedOf(instrument);
    if (best < 0 ? speed >= 0 : speed > 3 + 2 * speedOf(best)) best = instrument;
  }
  return best;
}

/** What a station shows on its own PC, as a row: only poses and handles change. */
export function packView(view: View, row: Row): void {
  row[STATE] = view.state;
  const put = (at: number, p: { qw: number; qx: number; qy: number; qz: number; x: number; y: number; z: number } | undefined): boolean => {
    if (!p) return false;
    row.set([p.qw, p.qx, p.qy, p.qz, p.x, p.y, p.z], at);
    return true;
  };
  for (const { body, pose, virtualPose } of view.bodies)
    if (body < BODIES && put(bodyAt(body, false), pose)) put(bodyAt(body, true), virtualPose ?? pose);
  for (const tool of view.instruments) {
    const instrument = tool.channel - FIRST_INSTRUMENT;
    if (instrument < 0 || instrument >= INSTRUMENTS) continue;
    const at = toolAt(instrument);
    const shown = tool.warpValidity !== LOST && put(at + WARPED, tool.warped);
    row[at + HAS_WARPED] = shown ? 1 : 0;
    if (tool.validity === LOST || !put(at + TIP, tool.tip)) row[at + SEEN] = Math.min(row[at + SEEN]!, 1) * (1 + LOST);
    else row[at + SEEN] = 1 + tool.validity;
    row[at + OPENING] = tool.handle?.opening ?? row[at + OPENING]!;
    row[at + BUTTONS] = tool.handle?.buttons ?? row[at + BUTTONS]!;
  }
}

const CHUNK_ROWS = 512;

/** How many moments are kept, in multiples of 512. Both bounds hold for a session of any length. */
export interface Limits {
  recent: number; // the newest ones, all of them
  older: number; // of those before: one for each `spacing` seconds, which doubles as the session grows
}

/** For a live page whose time can be moved back: at 30 moments/s the last 10 minutes in full. 16 MB. */
export const LIVE_LIMITS: Limits = { recent: 36 * CHUNK_ROWS, older: 8 * CHUNK_ROWS };
/** For a page that shows only the newest moment. */
export const NEWEST_LIMITS: Limits = { recent: 2 * CHUNK_ROWS, older: 0 };

const LEAST_SPACING_S = 0.125;

// Rows with their times, in chunks. Places behind `width` are not kept: instruments and loose bodies that the session has not.
class Rows {
  count = 0;
  private width = widthOf(USUAL, false);
  private times = new Float64Array(CHUNK_ROWS);
  private readonly chunks: Float32Array[] = [];

  clear(width: number): void {
    this.count = 0;
    this.chunks.length = 0;
    this.width = width;
  }

  push(time: number, row: Row): void {
    if (this.count === this.times.length) {
      const larger = new Float64Array(2 * this.count);
      larger.set(this.times);
      this.times = larger;
    }
    if (this.count === this.chunks.length * CHUNK_ROWS) this.chunks.push(new Float32Array(CHUNK_ROWS * this.width));
    this.times[this.count] = time;
    this.put(this.count++, row);
  }

  put(index: number, row: Row): void {
    this.chunks[Math.floor(index / CHUNK_ROWS)]!.set(row.subarray(0, this.width), (index % CHUNK_ROWS) * this.width);
  }

  row(index: number): Row {
    const at = (index % CHUNK_ROWS) * this.width;
    return this.chunks[Math.floor(index / CHUNK_ROWS)]!.subarray(at, at + this.width);
  }

  time(index: number): number {
    return this.times[index]!;
  }

  value(index: number, place: number): number {
    return this.chunks[Math.floor(index / CHUNK_ROWS)]![(index % CHUNK_ROWS) * this.width + place]!;
  }

  /** Removes the oldest chunk, whose memory the next one takes. */
  dropChunk(): void {
    const [oldest] = this.chunks.splice(0, 1);
    this.chunks.push(oldest!);
    this.times.copyWithin(0, CHUNK_ROWS, this.count);
    this.count -= CHUNK_ROWS;
  }

  /** Keeps the first row, and of the others those that are `spacing` s after the one kept before. */
  thin(spacing: number): void {
    let kept = 0;
    for (let i = 0; i < this.count; i++) {
      if (kept && this.times[i]! - this.times[kept - 1]! < spacing) continue;
      this.times[kept] = this.times[i]!;
      this.put(kept++, this.row(i));
    }
    this.count = kept;
  }
}

export class History {
  instruments: Instruments = USUAL; // of the session; what is kept of another goes with clear
  loose = false; // whether its case has loose bodies
  /** Whether a force of an instrument has come. */
  hasForce = false;
  /** Seconds between the older moments of a limited history; 0: none has been left out. */
  spacing = 0;
  private readonly older = new Rows();
  private readonly recent = new Rows();
  private readonly last = newRow();

  /** Without limits all moments are kept. With them, indices change when older moments are left out. */
  constructor(private readonly limits: Limits = { recent: Infinity, older: 0 }) {}

  get count(): number {
    return this.older.count + this.recent.count;
  }

  clear(): void {
    this.older.clear(widthOf(this.instruments, this.loose));
    this.recent.clear(widthOf(this.instruments, this.loose));
    this.spacing = 0;
    this.hasForce = false;
    this.last.set(newRow());
  }

  /** False where the moment is before the last one. One of the same time takes its place. */
  append(moment: Moment): boolean {
    const time = Number(moment.timeNs) * 1e-9;
    if (time < this.end && this.count) return false;
    pack(moment, this.last);
    this.hasForce ||= moment.instruments.some(({ forceN }) => forceN !== undefined);
    this.last[WORKING] = working(this.last, this.instruments);
    if (this.count && time === this.end) {
      this.recent.put(this.recent.count - 1, this.last);
      return true;
    }
    if (this.recent.count === this.limits.recent) this.dropOldest();
    this.recent.push(time, this.last);
    return true;
  }

  private dropOldest(): void {
    for (let i = 0; this.limits.older > 0 && i < CHUNK_ROWS; i++) this.keepOlder(this.recent.time(i), this.recent.row(i));
    this.recent.dropChunk();
  }

  private keepOlder(time: number, row: Row): void {
    const { older } = this;
    this.spacing ||= LEAST_SPACING_S;
    if (older.count && time - older.time(older.count - 1) < this.spacing) return;
    while (older.count === this.limits.older) {
      this.spacing *= 2;
      older.thin(this.spacing);
    }
    older.push(time, row);
  }

  time(index: number): number {
    if (!(index >= 0 && index < this.count)) return NaN;
    const recent = index - this.older.count;
    return recent < 0 ? this.older.time(index) : this.recent.time(recent);
  }

  get start(): number {
    return this.count ? this.time(0) : 0;
  }

  get end(): number {
    return this.count ? this.time(this.count - 1) : 0;
  }

  /** The last moment at or before that time; -1: there is none. */
  indexAt(time: number): number {
    let low = 0;
    let high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time(middle) <= time) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  value(index: number, place: number): number {
    if (!(index >= 0 && index < this.count)) return NaN;
    const recent = index - this.older.count;
    return recent < 0 ? this.older.value(index, place) : this.recent.value(recent, place);
  }

  /** Copies a row; `index` must be one. */
  read(index: number, row: Row): void {
    const recent = index - this.older.count;
    const kept = recent < 0 ? this.older.row(index) : this.recent.row(recent);
    row.set(kept);
    row.fill(0, kept.length);
  }
}
