// A camera that sees more light than it can show closes until it shows it, and opens for less.
import assert from "node:assert/strict";
import { test } from "node:test";
import { wantedExposure } from "../src/scene/exposure";

const WIDTH = 120;
const ROWS = 24;

// As the shader makes it of light: a curve of its own here, and sRGB.
function shown(light: number): number {
  const signal = 1 - Math.exp(-1.5 * light);
  return Math.round(255 * (signal <= 0.0031308 ? 12.92 * signal : 1.055 * signal ** (1 / 2.4) - 0.055));
}

function picture(light: (x: number, y: number) => number, exposure: number): Uint8Array {
  const pixels = new Uint8Array(4 * WIDTH * ROWS);
  for (let row = 0; row < ROWS; row++)
    for (let x = 0; x < WIDTH; x++) pixels.fill(shown(exposure * light((2 * x + 1) / WIDTH - 1, (2 * row + 1) / ROWS - 1)), 4 * (row * WIDTH + x), 4 * (row * WIDTH + x) + 4);
  return pixels;
}

function come(light: (x: number, y: number) => number, exposure: number): { exposure: number; pixels: Uint8Array } {
  for (let i = 0; i < 8; i++) exposure = wantedExposure(picture(light, exposure), WIDTH, exposure);
  return { exposure, pixels: picture(light, exposure) };
}

test("from whatever it was it comes to the same, and nothing is white", () => {
  const light = (x: number, y: number): number => 40 * Math.exp(-2 * (x * x + y * y));
  const [low, high] = [come(light, 0.01), come(light, 6)];
  assert.ok(Math.abs(low.exposure / high.exposure - 1) < 0.1, `${low.exposure}, ${high.exposure}`);
  assert.ok(Math.max(...high.pixels) < 250);
  assert.ok(Math.max(...high.pixels) > 200);
});

test("a small thing that shines does not make the rest dark", () => {
  const { pixels } = come((x, y) => (Math.hypot(x, y) < 0.1 ? 100 : 1), 1);
  assert.ok(pixels[4 * (2 * WIDTH + WIDTH / 2)]! > 200);
});

test("what is outside the round picture does not count", () => {
  const plain = come(() => 1, 1).exposure;
  assert.equal(come((x, y) => (Math.hypot(x, y) > 1.05 ? 50 : 1), 1).exposure, plain);
});
