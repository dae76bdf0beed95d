// Colours of surfaces: what tissue looks like, or what a map says of each vertex.
import { Vector3, type Matrix4 } from "three";
import type { CaseGroup } from "wire";
import { outsidePlan, type Group } from "./anatomy";
import { MAPS, sample, share, type Colour, type ColourMap, type MapName } from "./colours";
import { tissueOf } from "./materials";

const LINEAR = Uint8Array.from({ length: 256 }, (_, i) => {
  const c = i / 255;
  return Math.round(255 * (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
});
const PLAIN: Colour = [186, 186, 182]; // of what a map says nothing about

/** Vertices in a grid of cubes, to find those near a point. */
export class Grid {
  private readonly cells = new Map<number, number[]>();

  constructor(private readonly positions: Float32Array, count: number, private readonly size: number, used?: (vertex: number) => boolean) {
    for (let i = 0; i < count; i++) {
      if (used && !used(i)) continue;
      const key = this.key(this.cell(positions[3 * i]!), this.cell(positions[3 * i + 1]!), this.cell(positions[3 * i + 2]!));
      const cell = this.cells.get(key);
      if (cell) cell.push(i);
      else this.cells.set(key, [i]);
    }
  }

  /** Calls for each vertex within `reach`, which is at most the size of a cell. */
  near(x: number, y: number, z: number, reach: number, found: (vertex: number, distance: number) => void): void {
    const [cx, cy, cz] = [this.cell(x), this.cell(y), this.cell(z)];
    for (let i = cx - 1; i <= cx + 1; i++)
      for (let j = cy - 1; j <= cy + 1; j++)
        for (let k = cz - 1; k <= cz + 1; k++)
          for (const vertex of this.cells.get(this.key(i, j, k)) ?? []) {
            const at = 3 * vertex;
            const distance = Math.hypot(this.positions[at]! - x, this.positions[at + 1]! - y, this.positions[at + 2]! - z);
            if (distance <= reach) found(vertex, distance);
          }
  }

  private cell(coordinate: number): number {
    return Math.floor(coordinate / this.size);
  }

  private key(i: number, j: number, k: number): number {
    return ((i + 2048) * 4096 + (j + 2048)) * 4096 + k + 2048;
  }
}

export const GRID_MM = 3;
export const REACH: Partial<Record<MapName, number>> = { gain: 3, contact: 1.5 };

/** The surface to be painted: `cut` tells whether a vertex is of a cut surface. */
export interface Canvas {
  group: Group;
  inside: boolean; // it is looked at from inside the joint
  count: number; // of vertices
  positions: Float32Array; // S', mm
  colours: Uint8Array; // four of each vertex, linear
  cut: (vertex: number) => boolean;
  rim: Rim | undefined; // of a meniscus
  measured: Float32Array; // of each vertex what was measured there; NaN: nothing
  mismatch: Float32Array | undefined; // of each vertex how far the touched surface lies from it, mm
}

const RAYS = 72;
const WEAR_MOST = 4; // the ICRS grade of bare bone
const OUTER = { from: 0.55, to: 0.9 }; // between inner margin and rim: where a meniscus gets red, and is red

/** A meniscus seen from above, a C: its inner margin and its rim in each direction from the middle of its box. */
export class Rim {
  private readonly middle: [x: number, y: number];
  private readonly least = new Float32Array(RAYS).fill(Infinity);
  private readonly most = new Float32Array(RAYS);

  constructor(positions: Float32Array) {
    const [low, high] = [[Infinity, Infinity], [-Infinity, -Infinity]];
    for (let i = 0; i < positions.length; i++) {
      if (i % 3 === 2) continue;
      low[i % 3] = Math.min(low[i % 3]!, positions[i]!);
      high[i % 3] = Math.max(high[i % 3]!, positions[i]!);
    }
    this.middle = [(low[0]! + high[0]!) / 2, (low[1]! + high[1]!) / 2];
    for (let i = 0; i < positions.length; i += 3) {
      const [ray, r] = this.polar(positions[i]!, positions[i + 1]!);
      const at = Math.round(ray) % RAYS;
      this.least[at] = Math.min(this.least[at]!, r);
      this.most[at] = Math.max(this.most[at]!, r);
    }
  }

  /** How much of the outer third a place is: 0 to 1. */
  outer(x: number, y: number): number {
    const [ray, r] = this.polar(x, y);
    const low = Math.floor(ray) % RAYS;
    const high = (low + 1) % RAYS;
    const share = ray - Math.floor(ray);
    const mix = (of: Float32Array): number => of[low]! + share * (of[high]! - of[low]!);
    const t = ((r - mix(this.least)) / Math.max(mix(this.most) - mix(this.least), 1e-3) - OUTER.from) / (OUTER.to - OUTER.from);
    return Math.min(1, Math.max(0, t)) || 0; // NaN: there is no meniscus in that direction
  }

  private polar(x: number, y: number): [ray: number, r: number] {
    const [a, b] = [x - this.middle[0], y - this.middle[1]];
    return [(Math.atan2(b, a) / (2 * Math.PI) + 1) * RAYS, Math.hypot(a, b)];
  }
}

const scratch: Colour = [0, 0, 0];

// `raw`, 0 to 1: how much the scope is to see of a cut, or of wear, there.
function put(colours: Uint8Array, vertex: number, colour: Colour, raw = 0): void {
  for (let k = 0; k < 3; k++) colours[4 * vertex + k] = LINEAR[Math.round(colour[k]!)]!;
  colours[4 * vertex + 3] = Math.round(255 * (1 - raw));
}

export function paintTissue({ group: { about, cartilage, wear }, inside, count, positions, colours, cut, rim }: Canvas): void {
  for (let i = 0; i < count; i++) {
    const outer = inside && rim ? rim.outer(positions[3 * i]!, positions[3 * i + 1]!) : 0;
    const raw = cut(i) ? 1 : wear ? wear[i]! / WEAR_MOST : 0;
    put(colours, i, tissueOf(about, inside, cut(i), cartilage[i] === 1, outer), inside ? raw : 0);
  }
}

/** Of a part that came off, of which nobody says where it was cut: half raw all over. */
export function cutColours(group: CaseGroup, inside: boolean, count: number): Uint8Array {
  const colours = new Uint8Array(4 * count);
  for (let i = 0; i < count; i++) {
    put(colours, i, tissueOf(group, inside, false, false));
    if (inside) colours[4 * i + 3] = 128;
  }
  return colours;
}

export function paintMeasured(canvas: Canvas, map: ColourMap): void {
  for (let i = 0; i < canvas.count; i++) {
    const value = canvas.measured[i]!;
    put(canvas.colours, i, Number.isNaN(value) ? PLAIN : sample(map.table, share(map, value), scratch));
  }
}

/** By how far the touched surface lies from this one. In the scope what nobody tells it of looks as it is. */
export function paintMismatch(canvas: Canvas): void {
  const { mismatch, inside, count, colours } = canvas;
  if (!mismatch && inside) {
    paintTissue(canvas);
    return;
  }
  for (let i = 0; i < count; i++) put(colours, i, mismatch ? sample(MAPS.mismatch.table, share(MAPS.mismatch, mismatch[i]!), scratch) : PLAIN);
}

/** Cut surfaces by how far they lie beyond the plan; what is planned and still there by how deep it is. */
export function paintPlan(canvas: Canvas): void {
  const { plan } = canvas.group;
  const { positions } = canvas;
  for (let i = 0; i < canvas.count; i++) {
    const outside = plan.length ? outsidePlan(plan, positions[3 * i]!, positions[3 * i + 1]!, positions[3 * i + 2]!) : NaN;
    const told = outside < 0 || (canvas.cut(i) && !Number.isNaN(outside));
    put(canvas.colours, i, told ? sample(MAPS.plan.table, share(MAPS.plan, outside), scratch) : PLAIN);
  }
}

const before = new Vector3();
const after = new Vector3();

/**
 * How far each vertex is shown from where the mock-up has it; the greatest, mm. `origin`: the vertex of the
 * case's surface whose displacement it has.
 */
export function displacements(canvas: Canvas, origin: (vertex: number) => number, body: Matrix4, shown: Matrix4): number {
  const { positions, measured } = canvas;
  const physical = canvas.group.physical.positions;
  const virtual = canvas.group.virtual.positions;
  let most = 0;
  for (let i = 0; i < canvas.count; i++) {
    const from = 3 * origin(i);
    after.fromArray(positions, 3 * i);
    before.set(physical[from]! - virtual[from]!, physical[from + 1]! - virtual[from + 1]!, physical[from + 2]! - virtual[from + 2]!);
    before.add(after).applyMatrix4(body);
    after.applyMatrix4(shown);
    measured[i] = before.distanceTo(after);
    most = Math.max(most, measured[i]!);
  }
  return most;
}
