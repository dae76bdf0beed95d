// What comes off a mesh is seen where it came off, for a moment, and not where nobody saw it come.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Box3, Mesh, Vector3 } from "three";
import { CaseGroup_Kind } from "wire";
import { told } from "./told";
import { withNormals, type Knee } from "../src/scene/anatomy";
import { newRow, bodyAt } from "../src/history";
import { Joint } from "../src/scene/joint";
import { GONE_MS } from "../src/scene/pieces";
import { Tissue } from "../src/mesh";
import { steps } from "./meshes";

const TIBIA = 1;

function knee(): Knee {
  const positions = Float32Array.of(0, 0, 0, 10, 0, 0, 0, 10, 0, 0, 0, 10);
  const triangles = Uint32Array.of(0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3);
  const surface = withNormals(positions, triangles);
  return {
    name: "x", title: "x", left: false, portals: [],
    groups: [{
      name: "meniscus_medial", about: told("meniscus_medial", CaseGroup_Kind.MENISCUS), bone: false, body: TIBIA, other: -1, cuttable: true, triangles, physical: surface, virtual: surface, otherShare: undefined, wear: undefined,
      cartilage: new Uint8Array(4), plan: [],
    }],
  };
}

function pieces(joint: Joint): Mesh[] {
  const found: Mesh[] = [];
  joint.root.updateMatrixWorld(true);
  joint.root.traverse((node) => node.name === "pieces" && found.push(node as Mesh));
  return found;
}

test("a part that came off is where it was, and gone after a while", () => {
  const joint = new Joint(knee(), true);
  const row = newRow();
  row.set([1, 0, 0, 0, 100, 0, 0], bodyAt(TIBIA, true));
  joint.setRow(row, 0);
  const tissue = new Tissue();
  let came = 0;
  for (const { payload } of steps().slice(0, 5)) {
    tissue.apply(payload);
    joint.setTissue("meniscus_medial", tissue);
    if (tissue.before) came += tissue.pieces.length;
  }
  assert.ok(came > 0, "nothing came off");
  assert.equal(pieces(joint).length, came);
  assert.equal(joint.paint(0), true);
  const [piece] = tissue.pieces;
  const seen = new Box3().setFromObject(pieces(joint)[0]!);
  const wanted = new Box3().setFromArray(piece!.positions as unknown as number[]).translate(new Vector3(100, 0, 0));
  assert.ok(seen.min.distanceTo(wanted.min) < 1e-4 && seen.max.distanceTo(wanted.max) < 1e-4, `it is at ${JSON.stringify(seen)}`);
  joint.paint(GONE_MS / 2);
  assert.ok(new Box3().setFromObject(pieces(joint)[0]!).min.distanceTo(wanted.min) > 0.5, "it stays");
  assert.equal(joint.paint(GONE_MS + 1), false);
  assert.equal(pieces(joint).length, 0);
});

test("what came off on the way that was not seen is not shown", () => {
  const joint = new Joint(knee());
  const all = steps();
  const tissue = new Tissue();
  tissue.apply(all[0]!.payload);
  assert.ok(tissue.pieces.length && !tissue.before, "the first is whole, with parts that came off before");
  joint.setTissue("meniscus_medial", tissue);
  assert.equal(pieces(joint).length, 0);
  for (const { payload } of all.slice(1)) tissue.apply(payload);
  assert.ok(tissue.pieces.length && tissue.before, "the last one has some");
  joint.setTissue("meniscus_medial", tissue);
  assert.equal(pieces(joint).length, 0);
});
