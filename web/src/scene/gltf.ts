// The meshes of a case's anatomy.glb, by three's reader.
import { Mesh, type BufferAttribute, type BufferGeometry, type InterleavedBufferAttribute } from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";

type Attribute = BufferAttribute | InterleavedBufferAttribute;

const MM_PER_M = 1000;

/** A node's mesh; groups consist of one or more. */
export interface GltfPart {
  group: string;
  name: string;
  physical: Float32Array; // mm, as the mock-up has it
  virtual: Float32Array; // as the patient has it
  otherShare: Float32Array; // of each vertex, 0 at its body to 1 at the one that it bridges to
  triangles: Uint32Array;
}

/** Rejects where the bytes are no binary glTF. */
export async function readParts(bytes: ArrayBuffer): Promise<GltfPart[]> {
  const { scene } = await new GLTFLoader().parseAsync(bytes, "");
  const parts: GltfPart[] = [];
  scene.traverse((node) => {
    if (!(node instanceof Mesh)) return;
    const name: string = node.userData.name ?? node.parent?.userData.name ?? ""; // node.name has lost its /
    parts.push(partOf(name, node.geometry as BufferGeometry, node.morphTargetDictionary?.warp));
  });
  return parts;
}

function partOf(name: string, geometry: BufferGeometry, target: number | undefined): GltfPart {
  const position = geometry.getAttribute("position");
  const warp = geometry.morphAttributes.position?.[target ?? -1] as Attribute | undefined;
  const other = geometry.getAttribute("_other_share") as Attribute | undefined;
  const [physical, virtual] = [new Float32Array(3 * position.count), new Float32Array(3 * position.count)];
  for (let i = 0; i < physical.length; i++) {
    const [vertex, k] = [Math.floor(i / 3), i % 3];
    physical[i] = MM_PER_M * position.getComponent(vertex, k);
    virtual[i] = physical[i]! + (warp ? MM_PER_M * warp.getComponent(vertex, k) : 0);
  }
  return {
    group: name.split("/")[0]!, name, physical, virtual,
    otherShare: Float32Array.from({ length: position.count }, (_, i) => other?.getX(i) ?? 0),
    triangles: Uint32Array.from(geometry.index?.array ?? []),
  };
}
