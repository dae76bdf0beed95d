// When pictures are coarse, and when they are fine.
import assert from "node:assert/strict";
import { test } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { Fineness } from "../src/scene/view3d";

const LONG_MS = 600;

test("what stands is drawn finely, once", async () => {
  const fineness = new Fineness(1, true);
  let drawn = 0;
  const draw = (): void => {
    drawn++;
    fineness.rest(draw);
  };
  fineness.move();
  assert.ok(fineness.value < 1);
  fineness.rest(draw);
  await sleep(LONG_MS);
  assert.equal(fineness.value, 1);
  assert.equal(drawn, 1);
  fineness.move();
  assert.ok(fineness.value < 1);
});

test("what moves is not", async () => {
  const fineness = new Fineness(1, true);
  for (let i = 0; i < 8; i++) {
    fineness.move();
    fineness.rest(() => assert.fail("a fine picture of what moves"));
    await sleep(LONG_MS / 8);
  }
  assert.ok(fineness.value < 1);
  fineness.close();
  await sleep(LONG_MS);
});

test("where pictures are quick there is nothing to make finer", async () => {
  const fineness = new Fineness(2, false);
  fineness.rest(() => assert.fail("drawn again"));
  await sleep(LONG_MS);
  assert.equal(fineness.value, 2);
});
