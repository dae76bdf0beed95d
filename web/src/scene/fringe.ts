// Fibres that hang out where a cut meets a meniscus's surface. The same mesh has the same ones.
import { BufferAttribute, BufferGeometry, LineSegments } from "three";
import { tissueMaterial } from "./materials";
import type { Dent } from "./touch";

const COLOUR = 0xf2dcc0;
const EACH = 5; // at a vertex of the seam
const SHORTEST_MM = 0.15;
const LONGEST_MM = 0.6;
const ASTRAY = 1.6; // how far a fibre leans from the way out, in lengths of that

/** 0 to 1, by whole numbers alone. */
function chance(a: number, b: number): number {
  let n = Math.imul(a + 1, 0x9e3779b1) ^ Math.imul(b + 1, 0x85ebca6b);
  n = Math.imul(n ^ (n >>> 15), 0x2c1b3c6d);
  return ((n ^ (n >>> 13)) >>> 0) / 2 ** 32;
}

/** Both ends of each fibre, one after the other, and the way out there. `normals`: of the surface, and from vertex `twin` on of its cuts; 0 where there is none. */
export function fibres(positions: Float32Array, normals: Float32Array, twin: number): { ends: Float32Array; ways: Float32Array } {
  const is = (vertex: number): boolean => normals[3 * vertex] !== 0 || normals[3 * vertex + 1] !== 0 || normals[3 * vertex + 2] !== 0;
  const seam = Array.from({ length: twin }, (_, i) => i).filter((i) => is(i) && is(i + twin));
  const [ends, ways] = [new Float32Array(6 * EACH * seam.length), new Float32Array(6 * EACH * seam.length)];
  let at = 0;
  for (const vertex of seam)
    for (let fibre = 0; fibre < EACH; fibre++, at += 6) {
      const out = [0, 1, 2].map((k) => normals[3 * vertex + k]! + normals[3 * (vertex + twin) + k]!);
      const way = out.map((value, k) => value + ASTRAY * (chance(vertex, 4 * fibre + k) - 0.5));
      const length = (SHORTEST_MM + (LONGEST_MM - SHORTEST_MM) * chance(vertex, 4 * fibre + 3)) / (Math.hypot(...way) || 1);
      for (let k = 0; k < 3; k++) {
        const root = positions[3 * vertex + k]!;
        ends[at + k] = root;
        ends[at + 3 + k] = root + length * way[k]!;
        ways[at + k] = ways[at + 3 + k] = out[k]!;
      }
    }
  return { ends, ways };
}

export class Fringe {
  readonly lines: LineSegments;

  constructor(dent: Dent | undefined) {
    this.lines = new LineSegments(new BufferGeometry(), tissueMaterial({ colour: COLOUR, dent, thread: true }));
    this.lines.frustumCulled = false;
    this.lines.visible = false;
  }

  set(positions: Float32Array, normals: Float32Array, twin: number): void {
    const { ends, ways } = fibres(positions, normals, twin);
    this.lines.visible = ends.length > 0;
    this.lines.geometry.dispose();
    this.lines.geometry = new BufferGeometry();
    this.lines.geometry.setAttribute("position", new BufferAttribute(ends, 3)).setAttribute("normal", new BufferAttribute(ways, 3));
  }

  dispose(): void {
    this.lines.geometry.dispose();
    (this.lines.material as ReturnType<typeof tissueMaterial>).dispose();
  }
}
