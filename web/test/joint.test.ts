// The joint's picture, without a screen.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Vector3 } from "three";
import { CaseGroup_Kind } from "wire";
import { told } from "./told";
import { newRow } from "../src/history";
import { addNormals, type Group } from "../src/scene/anatomy";
import { Joint, USUAL_SHOW } from "../src/scene/joint";

// A triangle of 2 mm at a height.
function group(name: string, body: number, z: number, kind = CaseGroup_Kind.BONE): Group {
  const positions = Float32Array.from([0, 0, z, 2, 0, z, 0, 2, z]);
  const triangles = Uint32Array.from([0, 1, 2]);
  const normals = new Float32Array(9);
  addNormals(positions, triangles, 3, normals);
  const surface = { positions, normals };
  return {
    name, about: told(name, kind), bone: ["femur", "tibia", "patella"][body] === name, body, other: -1, cuttable: false, triangles, physical: surface, virtual: surface, otherShare: undefined, wear: undefined,
    cartilage: new Uint8Array(3), plan: [],
  };
}

test("a marker at the tip is put on a surface that is shown, however near a hidden one is", () => {
  const joint = new Joint({ name: "x", title: "x", left: false, portals: [], groups: [group("femur", 0, 1), group("tibia", 1, -5)] });
  joint.setRow(newRow(), 0);
  const tip = new Vector3(0, 0, 0);
  assert.equal(joint.markerAt(tip)?.body, 0);
  joint.setShow({ ...USUAL_SHOW, femur: false });
  assert.equal(joint.markerAt(tip)?.body, 1);
  assert.deepEqual(joint.targets().map(({ userData }) => userData.body as number), [1]);
});

test("bones that get translucent, or solid again, are compiled anew, and only those", () => {
  const joint = new Joint({ name: "x", title: "x", left: false, portals: [], groups: [group("femur", 0, 1), group("mcl", 1, -5)] });
  const versions = (): number[] => joint.surfaces.map(({ shown }) => shown.material.version);
  const [bone, soft] = versions();
  joint.setShow({ ...USUAL_SHOW, seeThrough: false });
  assert.deepEqual(versions(), [bone! + 1, soft]);
  joint.setShow({ ...USUAL_SHOW, seeThrough: false, skin: true });
  assert.deepEqual(versions(), [bone! + 1, soft]);
  joint.setShow(USUAL_SHOW);
  assert.deepEqual(versions(), [bone! + 2, soft]);
});
