// When pictures are coarse, and when they are fine.
import assert from "node:assert/strict";
import { test } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { AdaptiveResolution } from "../src/scene/view3d";

const LONG_MS = 600;

test("what stands is drawn finely, once", async () => {
  const resolution = new AdaptiveResolution(1, true);
  let drawn = 0;
  const draw = (): void => {
    drawn++;
    resolution.rest(draw);
  };
  resolution.move();
  assert.ok(resolution.value < 1);
  resolution.rest(draw);
  await sleep(LONG_MS);
  assert.equal(resolution.value, 1);
  assert.equal(drawn, 1);
  resolution.move();
  assert.ok(resolution.value < 1);
});

test("what moves is not", async () => {
  const resolution = new AdaptiveResolution(1, true);
  for (let i = 0; i < 8; i++) {
    resolution.move();
    resolution.rest(() => assert.fail("a fine picture of what moves"));
    await sleep(LONG_MS / 8);
  }
  assert.ok(resolution.value < 1);
  resolution.close();
  await sleep(LONG_MS);
});

test("where pictures are quick there is nothing to make finer", async () => {
  const resolution = new AdaptiveResolution(2, false);
  resolution.rest(() => assert.fail("drawn again"));
  await sleep(LONG_MS);
  assert.equal(resolution.value, 2);
});
