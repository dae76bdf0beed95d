// Where a meniscus is red: the outer third of a C, in any direction from its middle.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Rim } from "../src/scene/paint";

// Open towards x; its margins 8 and 18 mm from its middle, at (-20, 3).
function meniscus(): Float32Array {
  const places: number[] = [];
  for (let degrees = 40; degrees <= 320; degrees += 2)
    for (const r of [8, 13, 18]) places.push(-20 + r * Math.cos((degrees * Math.PI) / 180), 3 + r * Math.sin((degrees * Math.PI) / 180), r);
  return Float32Array.from(places);
}

test("a meniscus is red at its rim and not at its inner margin", () => {
  const rim = new Rim(meniscus());
  for (const degrees of [60, 120, 180, 240, 300]) {
    const at = (r: number): number => rim.outer(-20 + r * Math.cos((degrees * Math.PI) / 180), 3 + r * Math.sin((degrees * Math.PI) / 180));
    assert.ok(at(18) > 0.95 && at(12) < 0.05 && at(8) === 0, `${degrees}°: ${[18, 12, 8].map(at).join(" ")}`);
  }
});

test("where there is no meniscus nothing is red", () => {
  assert.equal(new Rim(meniscus()).outer(0, 3), 0);
});
