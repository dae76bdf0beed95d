// The hands of another session: where they were on the tibia, at that session's time.
import assert from "node:assert/strict";
import { test } from "node:test";
import { create } from "@bufbuild/protobuf";
import { Line, Vector3 } from "three";
import { MomentSchema } from "wire";
import { History } from "../src/history";
import { Overlay } from "../src/scene/overlay";

const half = Math.SQRT1_2;

// The tibia, turned a quarter about z, has gone 100 mm along x; the probe goes along z with time.
function past(from: number, seconds: number): History {
  const history = new History();
  for (let i = 0; i <= 10 * seconds; i++)
    history.append(create(MomentSchema, {
      timeNs: BigInt(Math.round((from + i / 10) * 1e9)),
      bodies: [{ body: 1, pose: { q: [half, 0, 0, half], t: [100, 0, 0] } }],
      instruments: [{ channel: 4, validity: 0, tip: { q: [1, 0, 0, 0], t: [0, 0, 0] }, warped: { q: [1, 0, 0, 0], t: [100, 7, i] } }],
    }));
  return history;
}

const tool = (overlay: Overlay): Vector3 => new Vector3().setFromMatrixPosition(overlay.root.children[0]!.matrix);
const near = (found: Vector3, x: number, y: number, z: number): void => assert.ok(found.distanceTo(new Vector3(x, y, z)) < 1e-4, found.toArray().join(" "));

test("another's hand is where it was on the tibia, as far ahead as it is told", () => {
  const overlay = new Overlay(past(0, 4));
  overlay.setTime(2, false);
  near(tool(overlay), 7, 0, 20);
  overlay.ahead = 1.5;
  overlay.setTime(2, false);
  near(tool(overlay), 7, 0, 35);
});

test("before another session begins its hands are not there", () => {
  const overlay = new Overlay(past(3, 1));
  overlay.setTime(2, false);
  assert.equal(overlay.root.visible, false);
  overlay.setTime(3, false);
  assert.equal(overlay.root.visible, true);
});

test("another's trail ends at its hand, and goes back in time", () => {
  const overlay = new Overlay(past(0, 4));
  overlay.setTime(1, true);
  const { geometry } = overlay.root.children.find((one) => one instanceof Line) as Line;
  const points = geometry.getAttribute("position");
  assert.equal(geometry.drawRange.count, 11);
  [10, 9].forEach((z, i) => near(new Vector3().fromBufferAttribute(points, i), 7, 0, z));
});
