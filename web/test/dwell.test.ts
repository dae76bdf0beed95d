// A probe that points at keys: where its cursor goes, and what it presses.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Dwell, DWELL_MS, Pointer, PX_PER_MM } from "../src/teach/dwell";

const [WIDTH, HEIGHT] = [800, 400];

test("a cursor begins in the middle and goes where the hand goes, as seen from before the knee", () => {
  const pointer = new Pointer();
  pointer.move({ x: 70, z: -30 }, WIDTH, HEIGHT);
  assert.deepEqual([pointer.x, pointer.y], [400, 200]);
  pointer.move({ x: 60, z: -25 }, WIDTH, HEIGHT); // to the patient's left, and up
  assert.deepEqual([pointer.x, pointer.y], [400 + 10 * PX_PER_MM, 200 - 5 * PX_PER_MM]);
});

test("a cursor stays within its area, and turns back as soon as the hand does", () => {
  const pointer = new Pointer();
  for (const x of [0, -500, -499]) pointer.move({ x, z: 0 }, WIDTH, HEIGHT);
  assert.equal(pointer.x, WIDTH - PX_PER_MM);
  for (const z of [1000, 999]) pointer.move({ x: -499, z }, WIDTH, HEIGHT);
  assert.equal(pointer.y, PX_PER_MM);
});

test("a probe that was out of sight moves the cursor by its whole way", () => {
  const pointer = new Pointer();
  pointer.move({ x: 0, z: 0 }, WIDTH, HEIGHT);
  pointer.move({ x: -10, z: 0 }, WIDTH, HEIGHT);
  pointer.move(undefined, WIDTH, HEIGHT);
  pointer.move({ x: -40, z: 20 }, WIDTH, HEIGHT);
  assert.deepEqual([pointer.x, pointer.y], [400 + 40 * PX_PER_MM, 200 - 20 * PX_PER_MM]);
});

// What is pressed when, of keys that the cursor is on at 50 ms a time.
function pressed(keys: readonly (string | undefined | null)[]): [string, number][] {
  const dwell = new Dwell<string>();
  return keys.flatMap((key, i): [string, number][] => {
    const press = dwell.stay(key !== null, key ?? undefined, i * 50);
    return press === undefined ? [] : [[press, i * 50]];
  });
}

const on = (key: string | undefined | null, ms: number): (string | undefined | null)[] => Array(ms / 50).fill(key);

test("a key is pressed once it was stayed on for the time, and once", () => {
  assert.deepEqual(pressed([undefined, ...on("A", 3000)]), [["A", 50 + DWELL_MS]]);
  assert.deepEqual(pressed([undefined, ...on("A", DWELL_MS - 100), ...on("B", DWELL_MS - 100), ...on("A", DWELL_MS - 100)]), []);
});

test("a key is pressed again after it was left", () => {
  const [first, second] = pressed([undefined, ...on("A", 1500), ...on("B", 100), ...on("A", 1500)]);
  assert.deepEqual([first?.[0], second?.[0]], ["A", "A"]);
});

test("a probe that lies still where it came into sight presses nothing", () => {
  assert.deepEqual(pressed(on("A", 5000)), []);
  assert.deepEqual(pressed([undefined, ...on("A", 500), ...on(null, 2000), ...on("A", 5000)]), []);
});

test("a probe that is lost for a moment goes on with its key", () => {
  assert.deepEqual(pressed([undefined, ...on("A", 500), ...on(null, 400), ...on("A", 5000)]), [["A", 50 + DWELL_MS]]);
});

test("beside the keys nothing is pressed", () => {
  assert.deepEqual(pressed(on(undefined, 5000)), []);
});
