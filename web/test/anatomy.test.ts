// Cases as files: what is in them comes out in millimetres, part by part.
import assert from "node:assert/strict";
import { test } from "node:test";
import { CaseGroup_Kind } from "wire";
import { told } from "./told";
import { paintTissue } from "../src/scene/paint";
import { addNormals, outsidePlan, readKnee, type Plane } from "../src/scene/anatomy";

interface Node {
  name: string;
  positions: number[]; // m
  triangles: number[];
  warp?: number[];
  share?: number[];
  wear?: number[];
}

// A binary glTF as server/case/gltf_write.cpp makes them.
function glb(nodes: Node[]): ArrayBuffer {
  const data: Buffer[] = [];
  const views: object[] = [];
  const accessors: object[] = [];
  const add = (bytes: Buffer, componentType: number, type: string, count: number): number => {
    views.push({ buffer: 0, byteOffset: data.reduce((sum, { length }) => sum + length, 0), byteLength: bytes.length });
    data.push(bytes);
    return accessors.push({ bufferView: views.length - 1, componentType, type, count }) - 1;
  };
  const floats = (values: number[], type: string, size: number): number => add(Buffer.from(Float32Array.from(values).buffer), 5126, type, values.length / size);
  const meshes = nodes.map(({ name, positions, triangles, warp, share, wear }) => ({
    name,
    primitives: [{
      mode: 4,
      attributes: {
        POSITION: floats(positions, "VEC3", 3), ...(share ? { _OTHER_SHARE: floats(share, "SCALAR", 1) } : {}), ...(wear ? { _WEAR: floats(wear, "SCALAR", 1) } : {}),
      },
      indices: add(Buffer.from(Uint32Array.from(triangles).buffer), 5125, "SCALAR", triangles.length),
      ...(warp ? { targets: [{ POSITION: floats(warp.map(() => 9), "VEC3", 3) }, { POSITION: floats(warp, "VEC3", 3) }] } : {}),
    }],
    ...(warp ? { weights: [0, 0], extras: { targetNames: ["maxcut", "warp"] } } : {}),
  }));
  const bin = Buffer.concat(data);
  const json = JSON.stringify({
    asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: nodes.map((_, i) => i) }], nodes: nodes.map(({ name }, mesh) => ({ name, mesh })),
    meshes, accessors, bufferViews: views, buffers: [{ byteLength: bin.length }],
  });
  const text = Buffer.from(json.padEnd(Math.ceil(json.length / 4) * 4));
  const head = (length: number, kind: string): Buffer => {
    const bytes = Buffer.alloc(8);
    bytes.writeUInt32LE(length);
    bytes.write(kind, 4, "latin1");
    return bytes;
  };
  const start = Buffer.alloc(12);
  start.write("glTF");
  start.writeUInt32LE(2, 4);
  start.writeUInt32LE(28 + text.length + bin.length, 8);
  const all = Buffer.concat([start, head(text.length, "JSON"), text, head(bin.length, "BIN\0"), bin]);
  return all.buffer.slice(all.byteOffset, all.byteOffset + all.length) as ArrayBuffer;
}

const corner = [0, 0, 0, 0.01, 0, 0, 0, 0.02, 0];

test("a group is its parts one behind the other, S and S' in millimetres", async () => {
  const knee = await readKnee({
    name: "x", side: "left",
    groups: [
      { name: "tibia", body: "tibia", cuttable: false },
      { name: "acl", body: "tibia", bridges: "femur", cuttable: false },
    ],
  }, glb([
    { name: "tibia/bone_tibia", positions: corner, triangles: [0, 1, 2] },
    { name: "acl", positions: corner, triangles: [0, 1, 2], share: [0, 0.5, 1] },
    { name: "tibia/cartilage_tibia", positions: [0, 0, 0.03, 0, 0, 0.03, 0, 0, 0.04], triangles: [2, 1, 0], warp: [0, 0, -0.003, 0, 0, 0, 0, 0, 0], wear: [4, 2.5, 0] },
  ]), [told("tibia", CaseGroup_Kind.BONE)]);
  const [tibia, acl] = knee.groups;
  assert.equal(knee.left, true);
  assert.deepEqual([tibia!.body, tibia!.other, acl!.body, acl!.other], [1, -1, 1, 0]);
  assert.deepEqual([...tibia!.triangles], [0, 1, 2, 5, 4, 3]);
  const z = (positions: Float32Array): number[] => [...positions].filter((_, i) => i % 3 === 2).map((value) => Math.round(1000 * value) / 1000);
  assert.deepEqual(z(tibia!.physical.positions), [0, 0, 0, 30, 30, 40]);
  assert.deepEqual(z(tibia!.virtual.positions), [0, 0, 0, 27, 30, 40]);
  assert.deepEqual([...tibia!.cartilage], [0, 0, 0, 1, 1, 1]);
  assert.deepEqual([...acl!.otherShare!], [0, 0.5, 1]);
  assert.deepEqual([...tibia!.wear!], [0, 0, 0, 4, 2.5, 0]);
  assert.equal(acl!.wear, undefined);
  assert.equal(acl!.virtual, acl!.physical);
  assert.deepEqual([...acl!.physical.normals.slice(0, 3)], [0, 0, 1]);
});

test("only in the scope worn cartilage differs from whole one", async () => {
  const { groups: [tibia] } = await readKnee({ name: "x", side: "right", groups: [{ name: "tibia", body: "tibia", cuttable: false }] }, glb([
    { name: "tibia", positions: corner, triangles: [0, 1, 2], wear: [4, 2, 0] },
  ]), [told("tibia", CaseGroup_Kind.BONE)]);
  const worn = (inside: boolean): number[] => {
    const colours = new Uint8Array(12);
    paintTissue({
      group: tibia!, inside, count: 3, positions: tibia!.virtual.positions, colours, cut: () => false, rim: undefined, measured: new Float32Array(3), mismatch: undefined,
    });
    return [3, 7, 11].map((at) => colours[at]!);
  };
  assert.deepEqual(worn(true), [0, 128, 255]);
  assert.deepEqual(worn(false), [255, 255, 255]);
});

test("a case without the mesh of a group is refused", async () => {
  const manifest = { name: "x", side: "right", groups: [{ name: "femur", body: "femur", cuttable: false }] };
  await assert.rejects(readKnee(manifest, glb([{ name: "tibia", positions: corner, triangles: [0, 1, 2] }]), []), /no femur/);
});

test("a vertex's normal is the mean of its triangles by their areas", () => {
  const positions = Float32Array.from([0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 1]);
  const normals = new Float32Array(12);
  addNormals(positions, Uint32Array.from([0, 1, 2, 0, 2, 3]), 6, normals);
  const [x, y, z] = normals;
  assert.ok(Math.abs(x! / z! - 0.5) < 1e-6 && y === 0); // areas 1 along x, 2 along z
});

test("the distance from a plan is that from the union of its parts", () => {
  const box = (x: number): Plane[] => [[1, 0, 0, x + 1], [-1, 0, 0, 1 - x], [0, 1, 0, 1], [0, -1, 0, 1], [0, 0, 1, 1], [0, 0, -1, 1]];
  const plan = [box(0), box(5)];
  assert.equal(outsidePlan(plan, 0, 0, 0), -1);
  assert.equal(outsidePlan(plan, 2.5, 0, 0), 1.5);
  assert.equal(outsidePlan(plan, 5, 0.75, 0), -0.25);
  assert.equal(outsidePlan(plan, 7, 0, 0), 1);
});
