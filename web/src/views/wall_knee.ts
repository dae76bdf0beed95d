// A case's bones, menisci and ligaments as fewer triangles, for small pictures: no DOM.
import type { GltfPart } from "../scene/gltf";

type Kind = "bone" | "meniscus" | "ligament";

/** What one body of the knee carries: femur, tibia, patella as in arthron.proto. */
export interface Part {
  body: number;
  kind: Kind; // what else can be cut is as a meniscus
  colour: number | undefined; // 0xRRGGBB where the case has one of its own
  positions: Float32Array; // x, y, z in mm, in the frame of the body, as the patient has them
  normals: Float32Array;
  triangles: Uint32Array;
}

/** As the server tells it. */
export interface Case {
  groups: { name: string; body: string; tissue: string; cuttable: boolean; colour: string; own_colour: boolean }[];
}

const KINDS: Record<string, Kind> = { bone: "bone", cartilage: "bone", meniscus: "meniscus" };
const BODIES = ["femur", "tibia", "patella"];

/** As coarse as `cell` mm. Throws where a group of the case has no mesh. */
export function kneeParts({ groups }: Case, meshes: readonly GltfPart[], cell: number): Part[] {
  return groups.flatMap(({ name, body: bodyName, tissue, cuttable, colour, own_colour }) => {
    const body = BODIES.indexOf(bodyName);
    if (body < 0 || tissue === "skin") return [];
    const of = meshes.filter(({ group }) => group === name);
    if (!of.length) throw new Error(`${name} has no mesh`);
    return of.map((mesh): Part => {
      const { positions, triangles } = thin(mesh.virtual, mesh.triangles, cell);
      return {
        body, kind: KINDS[tissue] ?? (cuttable ? "meniscus" : "ligament"), colour: own_colour ? parseInt(colour.slice(1), 16) : undefined,
        positions, triangles, normals: normalsOf(positions, triangles),
      };
    });
  });
}

/** One vertex for each cell that has some, at their mean; triangles with three different ones stay. */
export function thin(positions: Float32Array, triangles: Uint32Array, cell: number): { positions: Float32Array; triangles: Uint32Array } {
  const cells = new Map<number, number>();
  const sums: number[][] = [];
  const of = new Uint32Array(positions.length / 3);
  for (let i = 0; i < of.length; i++) {
    const [x, y, z] = [positions[3 * i]!, positions[3 * i + 1]!, positions[3 * i + 2]!];
    const key = (Math.floor(x / cell) + 512) * 1048576 + (Math.floor(y / cell) + 512) * 1024 + Math.floor(z / cell) + 512;
    let at = cells.get(key);
    if (at === undefined) {
      at = sums.push([0, 0, 0, 0]) - 1;
      cells.set(key, at);
    }
    const sum = sums[at]!;
    sum[0]! += x;
    sum[1]! += y;
    sum[2]! += z;
    sum[3]! += 1;
    of[i] = at;
  }
  const kept: number[] = [];
  const seen = new Set<string>();
  for (let i = 0; i < triangles.length; i += 3) {
    const corners = [of[triangles[i]!]!, of[triangles[i + 1]!]!, of[triangles[i + 2]!]!];
    if (new Set(corners).size < 3) continue;
    const key = [...corners].sort((a, b) => a - b).join();
    if (seen.has(key)) continue;
    seen.add(key);
    kept.push(...corners);
  }
  return { positions: Float32Array.from(sums.flatMap(([x, y, z, n]) => [x! / n!, y! / n!, z! / n!])), triangles: Uint32Array.from(kept) };
}

/** Of the vertices: those of the triangles around, the larger counting more. */
export function normalsOf(positions: Float32Array, triangles: Uint32Array): Float32Array {
  const out = new Float32Array(positions.length);
  for (let i = 0; i < triangles.length; i += 3) {
    const [a, b, c] = [3 * triangles[i]!, 3 * triangles[i + 1]!, 3 * triangles[i + 2]!];
    const edge = (to: number): number[] => [0, 1, 2].map((k) => positions[to + k]! - positions[a + k]!);
    const [[ux, uy, uz], [vx, vy, vz]] = [edge(b), edge(c)] as [number[], number[]] as [[number, number, number], [number, number, number]];
    const normal = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    for (const at of [a, b, c]) for (let k = 0; k < 3; k++) out[at + k]! += normal[k]!;
  }
  for (let i = 0; i < out.length; i += 3) {
    const length = Math.hypot(out[i]!, out[i + 1]!, out[i + 2]!) || 1;
    for (let k = 0; k < 3; k++) out[i + k]! /= length;
  }
  return out;
}
