// The meshes of a case's anatomy.glb. Of glTF it reads what cases have: triangles, morph targets and attributes of floats.
const MM_PER_M = 1000;
const MAGIC = 0x46546c67;

/** A node's mesh; groups consist of one or more. */
export interface GltfPart {
  group: string;
  name: string;
  physical: Float32Array; // mm, as the mock-up has it
  virtual: Float32Array; // as the patient has it
  otherShare: Float32Array; // of each vertex, 0 at its body to 1 at the one that it bridges to
  wear: Float32Array | undefined; // of each vertex the ICRS grade of its cartilage, 0 to 4; undefined: all is whole
  triangles: Uint32Array;
}

interface Accessor {
  bufferView?: number;
  byteOffset?: number;
  componentType: number;
  count: number;
  type: string;
  sparse?: { count: number; indices: { bufferView: number; byteOffset?: number; componentType: number }; values: { bufferView: number; byteOffset?: number } };
}

interface Gltf {
  nodes: { name?: string; mesh?: number }[];
  meshes: { primitives: { attributes: Record<string, number>; indices: number; targets?: { POSITION?: number }[] }[]; extras?: { targetNames?: string[] } }[];
  accessors: Accessor[];
  bufferViews: { byteOffset?: number; byteStride?: number }[];
}

const READ: Record<number, [bytes: number, read: "getFloat32" | "getUint32" | "getUint16" | "getUint8"]> = {
  5126: [4, "getFloat32"], 5125: [4, "getUint32"], 5123: [2, "getUint16"], 5121: [1, "getUint8"],
};

/** Throws where the bytes are no binary glTF, or have what is not read. */
export function readParts(glb: ArrayBuffer): GltfPart[] {
  const bytes = new DataView(glb);
  if (glb.byteLength < 20 || bytes.getUint32(0, true) !== MAGIC) throw new Error("no binary glTF");
  const jsonSize = bytes.getUint32(12, true);
  const gltf = JSON.parse(new TextDecoder().decode(new Uint8Array(glb, 20, jsonSize))) as Gltf;
  const read = reader(gltf, bytes, 20 + jsonSize + 8);
  return gltf.nodes.flatMap(({ name = "", mesh }) => (mesh === undefined ? [] : gltf.meshes[mesh]!.primitives.map(({ attributes, indices, targets }): GltfPart => {
    const physical = Float32Array.from(read(attributes.POSITION!), (m) => MM_PER_M * m);
    const warp = targets?.[gltf.meshes[mesh]!.extras?.targetNames?.indexOf("warp") ?? -1]?.POSITION;
    const offsets = warp === undefined ? undefined : read(warp);
    return {
      group: name.split("/")[0]!, name, physical,
      virtual: offsets ? physical.map((mm, i) => mm + MM_PER_M * offsets[i]!) : physical,
      otherShare: attributes._OTHER_SHARE === undefined ? new Float32Array(physical.length / 3) : Float32Array.from(read(attributes._OTHER_SHARE)),
      wear: attributes._WEAR === undefined ? undefined : Float32Array.from(read(attributes._WEAR)),
      triangles: Uint32Array.from(read(indices)),
    };
  })));
}

// The numbers of an accessor, one after the other. Where it is sparse, only some differ from its buffer, or from 0.
function reader(gltf: Gltf, bytes: DataView, data: number): (index: number) => Float64Array {
  const numbers = (view: number, offset: number, type: number, width: number, count: number): Float64Array => {
    const [size, get] = READ[type] ?? fail(`numbers of type ${type}`);
    const { byteOffset = 0, byteStride = size * width } = gltf.bufferViews[view]!;
    return Float64Array.from({ length: width * count }, (_, i) => bytes[get](data + byteOffset + offset + Math.floor(i / width) * byteStride + (i % width) * size, true));
  };
  return (index) => {
    const { bufferView, byteOffset = 0, componentType, count, type, sparse } = gltf.accessors[index]!;
    const width = type === "VEC3" ? 3 : type === "SCALAR" ? 1 : fail(type);
    const out = bufferView === undefined ? new Float64Array(width * count) : numbers(bufferView, byteOffset, componentType, width, count);
    if (!sparse) return out;
    const places = numbers(sparse.indices.bufferView, sparse.indices.byteOffset ?? 0, sparse.indices.componentType, 1, sparse.count);
    const values = numbers(sparse.values.bufferView, sparse.values.byteOffset ?? 0, componentType, width, sparse.count);
    places.forEach((place, i) => out.set(values.subarray(i * width, (i + 1) * width), place * width));
    return out;
  };
}

function fail(what: string): never {
  throw new Error(`glTF: ${what} is not read`);
}
