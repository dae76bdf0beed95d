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
  measured: Float32Array; // of each vertex what was measured there; NaN: nothing
  mismatch: Float32Array | undefined; // of each vertex how far the touched surface lies from it, mm
}

const scratch: Colour = [0, 0, 0];

// `raw`: the scope is to see a cut there.
function put(colours: Uint8Array, vertex: number, colour: Colour, raw = false): void {
  for (let k = 0; k < 3; k++) colours[4 * vertex + k] = LINEAR[Math.round(colour[k]!)]!;
  colours[4 * vertex + 3] = raw ? 0 : 255;
}

export function paintTissue({ group: { about, cartilage }, inside, count, colours, cut }: Canvas): void {
  for (let i = 0; i < count; i++) put(colours, i, tissueOf(about, inside, cut(i), cartilage[i] === 1), inside && cut(i));
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
