import assert from "node:assert/strict";
import { test } from "node:test";
import { CIVIDIS, LESS_MORE, MAPS, sample, scaledTo, share, VIRIDIS, type Colour, type Table } from "../src/scene/colours";

// CIE lightness of an sRGB colour.
function lightness(colour: Colour): number {
  const [r, g, b] = colour.map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4)) as Colour;
  const y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
  return y > 0.008856 ? 116 * Math.cbrt(y) - 16 : 903.3 * y;
}

const at = (table: Table, share: number): Colour => sample(table, share, [0, 0, 0]);

test("amounts are told by lightness alone: it rises all the way and evenly", () => {
  for (const table of [CIVIDIS, VIRIDIS]) {
    const steps: number[] = [];
    for (let i = 1; i <= 20; i++) steps.push(lightness(at(table, i / 20)) - lightness(at(table, (i - 1) / 20)));
    const mean = steps.reduce((sum, step) => sum + step, 0) / steps.length;
    for (const step of steps) assert.ok(step > 0.4 * mean && step < 1.8 * mean, JSON.stringify(steps));
  }
});

test("less and more darken from the middle outwards, alike on both sides", () => {
  for (let i = 1; i <= 8; i++) {
    const [less, more] = [lightness(at(LESS_MORE, 0.5 - i / 16)), lightness(at(LESS_MORE, 0.5 + i / 16))];
    const before = Math.min(lightness(at(LESS_MORE, 0.5 - (i - 1) / 16)), lightness(at(LESS_MORE, 0.5 + (i - 1) / 16)));
    if (i > 1) assert.ok(less < before + 12 && more < before + 12);
    assert.ok(Math.abs(less - more) < 18, `${i}: ${less} and ${more}`);
  }
  // Blue against orange: told apart by eyes without red cones or without green ones.
  const [blue, orange] = [at(LESS_MORE, 0.1), at(LESS_MORE, 0.9)];
  assert.ok(blue[2] - blue[0] > 80 && orange[0] - orange[2] > 80);
});

test("a sample is the table's own at its entries, and between them lies between", () => {
  assert.deepEqual(at(VIRIDIS, 0), [0x44, 0x01, 0x54]);
  assert.deepEqual(at(VIRIDIS, 1), [0xfd, 0xe7, 0x25]);
  assert.deepEqual(at(VIRIDIS, -3), at(VIRIDIS, 0));
  assert.deepEqual(at(VIRIDIS, 7), at(VIRIDIS, 1));
  const middle = at(CIVIDIS, 1.5 / 9);
  for (let k = 0; k < 3; k++) assert.ok(Math.abs(middle[k]! - (CIVIDIS[1]![k]! + CIVIDIS[2]![k]!) / 2) < 1e-9);
});

test("scales are round and hold what there is", () => {
  assert.equal(share(MAPS.gain, 1), 0.5);
  assert.equal(share(MAPS.plan, 0), 0.5);
  for (const most of [0, 0.3, 0.41, 2.9, 11.8, 59, 130]) {
    const map = scaledTo(MAPS.displacement, most);
    assert.ok(map.to >= most && map.to > 0);
    assert.deepEqual([map.ticks[0], map.ticks.at(-1)], [0, map.to]);
  }
});
