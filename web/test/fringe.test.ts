// Fibres at the seam of a cut.
import assert from "node:assert/strict";
import { test } from "node:test";
import { fibres } from "../src/scene/fringe";

const TWIN = 3;
const POSITIONS = Float32Array.from([0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 2, 0]);
const UP = [0, 0, 1];
const AHEAD = [0, 1, 0];
const NONE = [0, 0, 0];

test("a surface that is not cut has no fibres, and a vertex inside a cut has none", () => {
  assert.equal(fibres(POSITIONS, Float32Array.from([UP, UP, UP, NONE, NONE, NONE].flat()), TWIN).ends.length, 0);
  assert.equal(fibres(POSITIONS, Float32Array.from([UP, UP, NONE, NONE, NONE, AHEAD].flat()), TWIN).ends.length, 0);
});

test("each fibre begins on the seam, is shorter than a millimetre and leads out of both faces' solid", () => {
  const { ends } = fibres(POSITIONS, Float32Array.from([UP, UP, UP, NONE, AHEAD, NONE].flat()), TWIN);
  assert.ok(ends.length > 6 && ends.length % 6 === 0);
  for (let at = 0; at < ends.length; at += 6) {
    assert.deepEqual([...ends.subarray(at, at + 3)], [2, 0, 0]);
    const way = [0, 1, 2].map((k) => ends[at + 3 + k]! - ends[at + k]!);
    const length = Math.hypot(...way);
    assert.ok(length > 0.1 && length < 1, String(length));
    assert.ok(way[1]! + way[2]! > 0, "out, not in");
  }
});

test("the same mesh has the same fibres, and no two of a place are the same", () => {
  const normals = Float32Array.from([UP, UP, UP, NONE, AHEAD, NONE].flat());
  const [one, again] = [fibres(POSITIONS, normals, TWIN).ends, fibres(POSITIONS, normals, TWIN).ends];
  assert.deepEqual(one, again);
  const tips = Array.from({ length: one.length / 6 }, (_, i) => one.subarray(6 * i + 3, 6 * i + 6).join());
  assert.equal(new Set(tips).size, tips.length);
});
