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
}

export interface Have {
  group: string;
  number: number;
  hash: bigint;
}

export type Answer = { ack: Have } | { ask: Have[] };

interface Coming {
  base: number;
  number: number;
  hash: bigint;
  bytes: Uint8Array;
  index: number; // of the chunk that is next
  used: number;
}

interface Followed {
  tissue: Tissue;
  coming: Coming | null;
  failures: number; // one behind the other
}

const FAILURES_MAX = 4;

// The meshes of one session. `onPayload` gets each payload that was made, as it came.
export class Meshes {
  private readonly groups = new Map<string, Followed>();
  onPayload: (group: string, tissue: Tissue, payload: Uint8Array) => void = () => {};

  // Of another case: all meshes are void.
  clear(): void {
    this.groups.clear();
  }

  tissue(group: string): Tissue | undefined {
    const followed = this.groups.get(group);
    return followed?.tissue.number ? followed.tissue : undefined;
  }

  ask(): { ask: Have[] } {
    const ask: Have[] = [];
    for (const [group, { tissue }] of this.groups) if (tissue.number) ask.push(have(group, tissue));
    return { ask };
  }

  // The session opens: groups that were given up are followed again.
  open(): { ask: Have[] } {
    for (const followed of this.groups.values()) {
      followed.failures = 0;
      followed.coming = null;
    }
    return this.ask();
  }

  // What to answer; null: nothing yet.
  chunk(chunk: Chunk): Answer | null {
    const followed = this.followed(chunk.group);
    if (followed.failures >= FAILURES_MAX) return null;
    if (chunk.index === 0) this.begin(followed, chunk);
    const coming = followed.coming;
    if (!coming) return null;
    if (!fits(coming, chunk)) return this.failed(followed);
    coming.bytes.set(chunk.data, coming.used);
    coming.used += chunk.data.length;
    coming.index++;
    if (coming.used < coming.bytes.length) return null;
    followed.coming = null;
    return this.made(chunk.group, followed, coming);
  }

  private begin(followed: Followed, chunk: Chunk): void {
    const size = chunk.size <= PAYLOAD_MAX ? chunk.size : 0;
    followed.coming = {
      base: chunk.base,
      number: chunk.number,
      hash: chunk.hash,
      bytes: new Uint8Array(size),
      index: 0,
      used: 0,
    };
  }

  private made(group: string, followed: Followed, coming: Coming): Answer | null {
    const { tissue } = followed;
    if (coming.number <= tissue.number && coming.base) return { ack: have(group, tissue) };
    try {
      tissue.apply(coming.bytes);
    } catch (error) {
      if (!(error instanceof MeshError)) throw error;
      return this.failed(followed);
    }
    followed.failures = 0;
    this.onPayload(group, tissue, coming.bytes);
    return { ack: have(group, tissue) };
  }

  private failed(followed: Followed): Answer | null {
    followed.coming = null;
    return ++followed.failures < FAILURES_MAX ? this.ask() : null;
  }

  private followed(group: string): Followed {
    let followed = this.groups.get(group);
    if (!followed) this.groups.set(group, (followed = { tissue: new Tissue(), coming: null, failures: 0 }));
    return followed;
  }
}

function have(group: string, tissue: Tissue): Have {
  return { group, number: tissue.number, hash: tissue.hash };
}

function fits(coming: Coming, chunk: Chunk): boolean {
  const wanted = Math.min(CHUNK, coming.bytes.length - coming.used);
  return chunk.index === coming.index && chunk.number === coming.number && chunk.hash === coming.hash &&
    chunk.size === coming.bytes.length && chunk.data.length === wanted && wanted > 0;
}

// ---- a group's mesh at any time of a session ----------------------------------------------------------

const KEPT_EVERY = 16;
const LEAST_SPACING_S = 1;
/** Of one group of a live session: enough for some hundred cuts one by one. */
export const LIVE_MESH_BYTES = 16 << 20;

interface Landing {
  time: number; // s
  payload: Uint8Array; // empty: only `after` is left
  after: Tissue | undefined; // the whole mesh, of every 16th
}

const bytesOf = ({ payload, after }: Landing): number => payload.length + (after?.bytes ?? 0);

export class MeshHistory {
  private landings: Landing[] = [];
  bytes = 0; // that are kept
  private spacing = LEAST_SPACING_S; // between the older meshes that are kept, s
  private untilWhole = 0; // landings until the next whole mesh is kept
  private made = 0; // landings that `shown` has had
  private shown = new Tissue();

  /** `most` bytes are kept: the newest half cut by cut, of what is older a whole mesh now and then. */
  constructor(private readonly most = Infinity) {}

  // `tissue` is the mesh with that payload. A time of Infinity is not known yet.
  push(time: number, tissue: Tissue, payload: Uint8Array): void {
    const whole = this.untilWhole === 0;
    this.untilWhole = whole ? KEPT_EVERY - 1 : this.untilWhole - 1;
    const landing = { time, payload, after: whole ? tissue.clone() : undefined };
    this.landings.push(landing);
    this.bytes += bytesOf(landing);
    if (this.bytes > this.most) this.thin();
  }

  // Those of which it was not known came then.
  settle(time: number): void {
    for (let i = this.landings.length; i-- > 0 && this.landings[i]!.time === Infinity; ) this.landings[i]!.time = time;
  }

  // The mesh as it was then, good until the next call; undefined before the first.
  at(time: number): Tissue | undefined {
    let wanted = this.made;
    while (wanted < this.landings.length && this.landings[wanted]!.time <= time) wanted++;
    while (wanted > 0 && this.landings[wanted - 1]!.time > time) wanted--;
    if (wanted === 0) return undefined;
    this.start(wanted);
    while (this.made < wanted) this.shown.applyAgain(this.landings[this.made++]!.payload);
    return this.shown;
  }

  // From what is shown, or from the last that was kept: whichever is nearer.
  private start(wanted: number): void {
    let kept = wanted;
    while (!this.landings[kept - 1]!.after) kept--;
    if (this.made >= kept && this.made <= wanted) return;
    this.made = kept;
    this.shown = this.landings[kept - 1]!.after!.clone();
  }

  private thin(): void {
    const first = this.firstOfNewest(this.most / 2);
    let older = this.landings.slice(0, first).flatMap((landing) => (landing.after ? [{ ...landing, payload: new Uint8Array(0) }] : []));
    const newest = this.landings.slice(first);
    const size = (landings: Landing[]): number => landings.reduce((sum, landing) => sum + bytesOf(landing), 0);
    while (older.length > 1 && size(older) > this.most / 4) {
      older = spaced(older, this.spacing);
      this.spacing *= 2;
    }
    this.landings = [...older, ...newest];
    this.bytes = size(this.landings);
    this.made = 0;
    this.shown = new Tissue();
  }

  // The first of the newest that take no more than so many bytes; a whole mesh, without which those after it are nothing.
  private firstOfNewest(bytes: number): number {
    let first = this.landings.length;
    for (let i = first - 1, sum = 0; i >= 0; i--) {
      sum += bytesOf(this.landings[i]!);
      if (sum > bytes && first < this.landings.length) break;
      if (this.landings[i]!.after) first = i;
    }
    return first;
  }
}

// The first, and those that are as many seconds after the one kept before.
function spaced(landings: Landing[], seconds: number): Landing[] {
  let last = -Infinity;
  return landings.filter(({ time }) => {
    if (time - last < seconds) return false;
    last = time;
    return true;
  });
}
