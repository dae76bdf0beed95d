// A case's bones and menisci as few triangles, for pictures of a thumb's size: no DOM.

/** One body of the knee: femur, tibia, patella as in arthron.proto. */
export interface Part {
  body: number;
  soft: boolean; // meniscus, no bone
  positions: Float32Array; // x, y, z in mm, in the frame of the body
  triangles: Uint16Array;
}

interface Gltf {
  nodes: { name?: string; mesh?: number }[];
  meshes: { primitives: { attributes: { POSITION: number }; indices: number }[] }[];
  accessors: { bufferView: number; byteOffset?: number; componentType: number; count: number }[];
  bufferViews: { byteOffset?: number; byteStride?: number }[];
}

export interface CaseFile {
  groups: { name: string; body: string }[];
}

const BODIES = ["femur", "tibia", "patella"];
const MM_PER_M = 1000;
const MAGIC = 0x46546c67;

/** As coarse as `cell` mm. Throws where the bytes are no binary glTF with the case's groups. */
export function kneeParts(file: CaseFile, glb: ArrayBuffer, cell: number): Part[] {
  const bytes = new DataView(glb);
  if (glb.byteLength < 20 || bytes.getUint32(0, true) !== MAGIC) throw new Error("no binary glTF");
  const jsonSize = bytes.getUint32(12, true);
  const gltf = JSON.parse(new TextDecoder().decode(new Uint8Array(glb, 20, jsonSize))) as Gltf;
  const data = 20 + jsonSize + 8;
  const parts: Part[] = [];
  for (const group of file.groups) {
    const body = BODIES.indexOf(group.body);
    const soft = group.name.startsWith("meniscus");
    if (body < 0 || (!soft && group.name !== group.body)) continue;
    const mesh = gltf.nodes.find((node) => node.name === group.name)?.mesh;
    const primitive = mesh === undefined ? undefined : gltf.meshes[mesh]?.primitives[0];
    if (!primitive) throw new Error(`${group.name} has no mesh`);
    parts.push({ body, soft, ...thin(vectors(gltf, glb, data, primitive.attributes.POSITION), indices(gltf, glb, data, primitive.indices), cell) });
  }
  return parts;
}

function vectors(gltf: Gltf, glb: ArrayBuffer, data: number, index: number): Float32Array {
  const accessor = gltf.accessors[index]!;
  const view = gltf.bufferViews[accessor.bufferView]!;
  const stride = view.byteStride ?? 12;
  const bytes = new DataView(glb, data + (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0));
  const out = new Float32Array(3 * accessor.count);
  for (let i = 0; i < out.length; i++) out[i] = MM_PER_M * bytes.getFloat32(Math.floor(i / 3) * stride + (i % 3) * 4, true);
  return out;
}

function indices(gltf: Gltf, glb: ArrayBuffer, data: number, index: number): Uint32Array {
  const accessor = gltf.accessors[index]!;
  const view = gltf.bufferViews[accessor.bufferView]!;
  const bytes = new DataView(glb, data + (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0));
  const wide = accessor.componentType === 5125;
  return Uint32Array.from({ length: accessor.count }, (_, i) => (wide ? bytes.getUint32(4 * i, true) : bytes.getUint16(2 * i, true)));
}

/** One vertex for each cell that has some, at their mean; triangles with three different ones stay. */
export function thin(positions: Float32Array, triangles: Uint32Array, cell: number): { positions: Float32Array; triangles: Uint16Array } {
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
  return { positions: Float32Array.from(sums.flatMap(([x, y, z, n]) => [x! / n!, y! / n!, z! / n!])), triangles: Uint16Array.from(kept) };
}
