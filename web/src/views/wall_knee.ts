// A case's bones, menisci and ligaments as fewer triangles, for small pictures: no DOM.

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

interface Primitive {
  attributes: { POSITION: number };
  indices: number;
  targets?: { POSITION?: number }[];
}

interface Gltf {
  nodes: { name?: string; mesh?: number }[];
  meshes: { primitives: Primitive[]; extras?: { targetNames?: string[] } }[];
  accessors: { bufferView?: number; byteOffset?: number; componentType: number; count: number }[];
  bufferViews: { byteOffset?: number; byteStride?: number }[];
}

/** As the server tells it. */
export interface Case {
  groups: { name: string; body: string; tissue: string; cuttable: boolean; colour: string; own_colour: boolean }[];
}

const KINDS: Record<string, Kind> = { bone: "bone", cartilage: "bone", meniscus: "meniscus" };
const BODIES = ["femur", "tibia", "patella"];
const MM_PER_M = 1000;
const MAGIC = 0x46546c67;

/** As coarse as `cell` mm. Throws where the bytes are no binary glTF with the case's groups. */
export function kneeParts({ groups }: Case, glb: ArrayBuffer, cell: number): Part[] {
  const bytes = new DataView(glb);
  if (glb.byteLength < 20 || bytes.getUint32(0, true) !== MAGIC) throw new Error("no binary glTF");
  const jsonSize = bytes.getUint32(12, true);
  const gltf = JSON.parse(new TextDecoder().decode(new Uint8Array(glb, 20, jsonSize))) as Gltf;
  const read = new Reader(gltf, glb, 20 + jsonSize + 8);
  const parts: Part[] = [];
  for (const { name, body: bodyName, tissue, cuttable, colour, own_colour } of groups) {
    const body = BODIES.indexOf(bodyName);
    if (body < 0 || tissue === "skin") continue;
    const kind = KINDS[tissue] ?? (cuttable ? "meniscus" : "ligament");
    const nodes = gltf.nodes.filter((node) => node.name?.split("/")[0] === name && node.mesh !== undefined);
    if (!nodes.length) throw new Error(`${name} has no mesh`);
    for (const { mesh } of nodes)
      for (const primitive of gltf.meshes[mesh!]!.primitives) {
        const warp = primitive.targets?.[gltf.meshes[mesh!]!.extras?.targetNames?.indexOf("warp") ?? -1]?.POSITION;
        const { positions, triangles } = thin(read.virtual(primitive.attributes.POSITION, warp), read.indices(primitive.indices), cell);
        parts.push({ body, kind, colour: own_colour ? parseInt(colour.slice(1), 16) : undefined, positions, triangles, normals: normalsOf(positions, triangles) });
      }
  }
  return parts;
}

class Reader {
  constructor(private readonly gltf: Gltf, private readonly glb: ArrayBuffer, private readonly data: number) {}

  /** The physical surface and how far the patient's is from it. */
  virtual(physical: number, warp: number | undefined): Float32Array {
    const out = this.vectors(physical);
    if (warp === undefined || this.gltf.accessors[warp]!.bufferView === undefined) return out;
    this.vectors(warp).forEach((offset, i) => (out[i]! += offset));
    return out;
  }

  private view(index: number): { at: number; stride: number | undefined; count: number; wide: boolean } {
    const { bufferView, byteOffset = 0, componentType, count } = this.gltf.accessors[index]!;
    const { byteOffset: start = 0, byteStride } = this.gltf.bufferViews[bufferView!]!;
    return { at: this.data + start + byteOffset, stride: byteStride, count, wide: componentType === 5125 };
  }

  private vectors(index: number): Float32Array {
    const { at, stride = 12, count } = this.view(index);
    const bytes = new DataView(this.glb, at);
    const out = new Float32Array(3 * count);
    for (let i = 0; i < out.length; i++) out[i] = MM_PER_M * bytes.getFloat32(Math.floor(i / 3) * stride + (i % 3) * 4, true);
    return out;
  }

  indices(index: number): Uint32Array {
    const { at, count, wide } = this.view(index);
    const bytes = new DataView(this.glb, at);
    return Uint32Array.from({ length: count }, (_, i) => (wide ? bytes.getUint32(4 * i, true) : bytes.getUint16(2 * i, true)));
  }
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
