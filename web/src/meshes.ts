// The meshes of one session: chunks put together, what to answer to the server, and the mesh at any time.
import { MeshError, Tissue } from "./mesh";

const PAYLOAD_MAX = 64 << 20;
const CHUNK = 32768;

export interface Chunk {
  group: string;
  base: number;
  number: number;
  size: number;
  hash: bigint;
  index: number;
  data: Uint8Array;
  mismatchSize: number;
}

export interface Have {
  group: string;
  number: number;
  hash: bigint;
}

export type Answer = { ack: Have } | { ask: Have[] };

interface Transfer {
  base: number;
  number: number;
  hash: bigint;
  bytes: Uint8Array;
  mismatchSize: number; // of the bytes, at their end
  index: number; // of the chunk that is next
  used: number;
}

interface GroupState {
  tissue: Tissue;
  transfer: Transfer | null;
  failures: number; // one behind the other
}

const FAILURES_MAX = 4;

// The meshes of one session. `onPayload` gets each payload that was made, as it came.
export class Meshes {
  private readonly groups = new Map<string, GroupState>();
  onPayload: (group: string, tissue: Tissue, payload: Uint8Array, mismatchSize: number) => void = () => {};

  // Of another case: all meshes are void.
  clear(): void {
    this.groups.clear();
  }

  tissue(group: string): Tissue | undefined {
    const state = this.groups.get(group);
    return state?.tissue.number ? state.tissue : undefined;
  }

  ask(): { ask: Have[] } {
    const ask: Have[] = [];
    for (const [group, { tissue }] of this.groups) if (tissue.number) ask.push(have(group, tissue));
    return { ask };
  }

  // The session opens: groups that were given up are followed again.
  open(): { ask: Have[] } {
    for (const state of this.groups.values()) {
      state.failures = 0;
      state.transfer = null;
    }
    return this.ask();
  }

  // What to answer; null: nothing yet.
  chunk(chunk: Chunk): Answer | null {
    const state = this.state(chunk.group);
    if (state.failures >= FAILURES_MAX) return null;
    if (chunk.index === 0) this.begin(state, chunk);
    const transfer = state.transfer;
    if (!transfer) return null;
    if (!fits(transfer, chunk)) return this.failed(state);
    transfer.bytes.set(chunk.data, transfer.used);
    transfer.used += chunk.data.length;
    transfer.index++;
    if (transfer.used < transfer.bytes.length) return null;
    state.transfer = null;
    return this.made(chunk.group, state, transfer);
  }

  private begin(state: GroupState, chunk: Chunk): void {
    const size = chunk.size <= PAYLOAD_MAX ? chunk.size : 0;
    state.transfer = {
      base: chunk.base,
      number: chunk.number,
      hash: chunk.hash,
      bytes: new Uint8Array(size),
      mismatchSize: Math.min(chunk.mismatchSize, size),
      index: 0,
      used: 0,
    };
  }

  private made(group: string, state: GroupState, transfer: Transfer): Answer | null {
    const { tissue } = state;
    if (transfer.number <= tissue.number && transfer.base) return { ack: have(group, tissue) };
    try {
      tissue.apply(transfer.bytes, transfer.mismatchSize);
    } catch (error) {
      if (!(error instanceof MeshError)) throw error;
      return this.failed(state);
    }
    state.failures = 0;
    this.onPayload(group, tissue, transfer.bytes, transfer.mismatchSize);
    return { ack: have(group, tissue) };
  }

  private failed(state: GroupState): Answer | null {
    state.transfer = null;
    return ++state.failures < FAILURES_MAX ? this.ask() : null;
  }

  private state(group: string): GroupState {
    let state = this.groups.get(group);
    if (!state) this.groups.set(group, (state = { tissue: new Tissue(), transfer: null, failures: 0 }));
    return state;
  }
}

function have(group: string, tissue: Tissue): Have {
  return { group, number: tissue.number, hash: tissue.hash };
}

function fits(transfer: Transfer, chunk: Chunk): boolean {
  const wanted = Math.min(CHUNK, transfer.bytes.length - transfer.used);
  return chunk.index === transfer.index && chunk.number === transfer.number && chunk.hash === transfer.hash &&
    chunk.size === transfer.bytes.length && chunk.data.length === wanted && wanted > 0;
}

// ---- a group's mesh at any time of a session ----------------------------------------------------------

const KEPT_EVERY = 16;
const LEAST_SPACING_S = 1;
/** Of one group of a live session: enough for some hundred cuts one by one. */
export const LIVE_MESH_BYTES = 16 << 20;

interface MeshVersion {
  time: number; // s
  payload: Uint8Array; // empty: only `after` is left
  mismatchSize: number; // of its bytes, at their end
  after: Tissue | undefined; // the whole mesh, of every 16th
}

const bytesOf = ({ payload, after }: MeshVersion): number => payload.length + (after?.bytes ?? 0);

export class MeshHistory {
  private versions: MeshVersion[] = [];
  bytes = 0; // that are kept
  private spacing = LEAST_SPACING_S; // between the older meshes that are kept, s
  private untilWhole = 0; // versions until the next whole mesh is kept
  private made = 0; // versions that `shown` has had
  private shown = new Tissue();

  /** `most` bytes are kept: the newest half cut by cut, of what is older a whole mesh now and then. */
  constructor(private readonly most = Infinity) {}

  // `tissue` is the mesh with that payload. A time of Infinity is not known yet.
  push(time: number, tissue: Tissue, payload: Uint8Array, mismatchSize = 0): void {
    const whole = this.untilWhole === 0;
    this.untilWhole = whole ? KEPT_EVERY - 1 : this.untilWhole - 1;
    const landing = { time, payload, mismatchSize, after: whole ? tissue.clone() : undefined };
    this.versions.push(landing);
    this.bytes += bytesOf(landing);
    if (this.bytes > this.most) this.thin();
  }

  // Those of which it was not known came then.
  settle(time: number): void {
    for (let i = this.versions.length; i-- > 0 && this.versions[i]!.time === Infinity; ) this.versions[i]!.time = time;
  }

  // The mesh as it was then, good until the next call; undefined before the first.
  at(time: number): Tissue | undefined {
    let wanted = this.made;
    while (wanted < this.versions.length && this.versions[wanted]!.time <= time) wanted++;
    while (wanted > 0 && this.versions[wanted - 1]!.time > time) wanted--;
    if (wanted === 0) return undefined;
    this.start(wanted);
    for (; this.made < wanted; this.made++) {
      const { payload, mismatchSize } = this.versions[this.made]!;
      this.shown.applyAgain(payload, mismatchSize);
    }
    return this.shown;
  }

  // From what is shown, or from the last that was kept: whichever is nearer.
  private start(wanted: number): void {
    let kept = wanted;
    while (!this.versions[kept - 1]!.after) kept--;
    if (this.made >= kept && this.made <= wanted) return;
    this.made = kept;
    this.shown = this.versions[kept - 1]!.after!.clone();
  }

  private thin(): void {
    const first = this.firstOfNewest(this.most / 2);
    let older = this.versions.slice(0, first).flatMap((landing) => (landing.after ? [{ ...landing, payload: new Uint8Array(0) }] : []));
    const newest = this.versions.slice(first);
    const size = (versions: MeshVersion[]): number => versions.reduce((sum, landing) => sum + bytesOf(landing), 0);
    while (older.length > 1 && size(older) > this.most / 4) {
      older = spaced(older, this.spacing);
      this.spacing *= 2;
    }
    this.versions = [...older, ...newest];
    this.bytes = size(this.versions);
    this.made = 0;
    this.shown = new Tissue();
  }

  // The first of the newest that take no more than so many bytes; a whole mesh, without which those after it are nothing.
  private firstOfNewest(bytes: number): number {
    let first = this.versions.length;
    for (let i = first - 1, sum = 0; i >= 0; i--) {
      sum += bytesOf(this.versions[i]!);
      if (sum > bytes && first < this.versions.length) break;
      if (this.versions[i]!.after) first = i;
    }
    return first;
  }
}

// The first, and those that are as many seconds after the one kept before.
function spaced(versions: MeshVersion[], seconds: number): MeshVersion[] {
  let last = -Infinity;
  return versions.filter(({ time }) => {
    if (time - last < seconds) return false;
    last = time;
    return true;
  });
}
