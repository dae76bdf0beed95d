// When pictures are coarse, and when they are fine: of a screen that shows a picture each sixtieth of a second, and
// waits for one that is late.
import assert from "node:assert/strict";
import { test } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { measureScreen, screenMs } from "../src/graphics";
import { AdaptiveResolution } from "../src/scene/view3d";

const LONG_MS = 600;
const SCREEN_MS = 1000 / 60;

// Frames as a screen shows them: `wait` gives how long each takes.
async function screenOf(wait: () => number): Promise<void> {
  let now = 0;
  globalThis.requestAnimationFrame = (frame) => (setTimeout(() => frame((now += wait()))), 0);
  measureScreen();
  await sleep(60);
}

async function resolutionOn(screen: number, finest: number, coarse = false): Promise<AdaptiveResolution> {
  await screenOf(() => screen);
  return new AdaptiveResolution(finest, coarse);
}

test("what stands is drawn finely, once", async () => {
  const resolution = await resolutionOn(SCREEN_MS, 1, true);
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
  const resolution = await resolutionOn(SCREEN_MS, 1, true);
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
  const resolution = await resolutionOn(SCREEN_MS, 2);
  resolution.rest(() => assert.fail("drawn again"));
  await sleep(LONG_MS);
  assert.equal(resolution.value, 2);
});

// `costMs`: of a picture of one pixel for each of the page's, and of each pixel more.
function play(resolution: AdaptiveResolution, costMs: number, pictures: number, screen = SCREEN_MS): { late: number; mean: number } {
  let [late, sum] = [0, 0];
  for (let i = 0; i < pictures; i++) {
    const frames = Math.ceil((costMs * resolution.value ** 2) / screen - 1e-9);
    resolution.took(frames * screen);
    late += frames > Math.max(1, Math.floor(SCREEN_MS / screen)) ? 1 : 0;
    sum += resolution.value;
  }
  return { late: late / pictures, mean: sum / pictures };
}

test("sixty pictures a second are held, as fine as they can be", async () => {
  for (const costMs of [4, 6, 8, 10]) {
    const resolution = await resolutionOn(SCREEN_MS, 2);
    const first = play(resolution, costMs, 600);
    assert.ok(first.late < 0.15, `at ${costMs} ms: ${first.late}`);
    const { late, mean } = play(resolution, costMs, 6000);
    const most = Math.min(2, Math.sqrt(SCREEN_MS / costMs));
    assert.ok(late < 0.02, `at ${costMs} ms: ${late}`);
    assert.ok(mean > Math.max(0.79 * most, 1.2), `at ${costMs} ms: ${mean} of ${most}`);
  }
});

test("what is slow for a moment is fine again a moment later", async () => {
  const resolution = await resolutionOn(SCREEN_MS, 2);
  play(resolution, 4, 60);
  play(resolution, 9, 60);
  assert.ok(resolution.value < 2);
  play(resolution, 4, 300);
  assert.equal(resolution.value, 2);
});

test("a slower screen's pictures are late only where it shows none in its own time", async () => {
  for (const screen of [1000 / 50, 1000 / 30]) {
    const quick = await resolutionOn(screen, 2);
    play(quick, 2, 600, screen);
    assert.equal(quick.value, 2, `each ${screen} ms`);
    const slow = await resolutionOn(screen, 2);
    const { late } = play(slow, screen / 2, 3000, screen);
    assert.ok(late < 0.05 && slow.value < 1.5 && slow.value > 1.1, `each ${screen} ms: ${late}, ${slow.value}`);
  }
});

test("a quicker screen is no reason for coarser pictures", async () => {
  for (const screen of [1000 / 120, 1000 / 144]) {
    const resolution = await resolutionOn(screen, 2);
    play(resolution, 0.95 * SCREEN_MS / 4, 600, screen);
    assert.ok(resolution.value > 1.5, `each ${screen} ms: ${resolution.value}`);
  }
});

test("one long wait makes no picture coarser", async () => {
  const resolution = await resolutionOn(SCREEN_MS, 2);
  play(resolution, 2, 60);
  resolution.took(700);
  assert.equal(resolution.value, 2);
});

test("a screen's own time is the usual one, whatever was late, and early after it", async () => {
  const waits = [900, 35, 5, 20, 60, 20, 20, 35, 5, 20, 20, 20, 20];
  await screenOf(() => waits.shift()!);
  assert.equal(screenMs(), 20);
  await screenOf(() => 500); // no screen
  assert.ok(screenMs() < 42);
});

test("a screen is measured again once nothing moves, and not while something does", async () => {
  const resolution = await resolutionOn(1000 / 60, 1, true);
  const draw = (): void => resolution.rest(draw);
  globalThis.requestAnimationFrame = (frame) => (setTimeout(() => frame(performance.now()), 20), 0);
  resolution.rest(draw);
  await sleep(LONG_MS);
  assert.ok(screenMs() >= 20);
  const before = screenMs();
  globalThis.requestAnimationFrame = (frame) => (setTimeout(() => frame(performance.now()), 35), 0);
  resolution.move();
  resolution.rest(draw);
  await sleep(400);
  resolution.move(); // amid it
  await sleep(LONG_MS);
  assert.equal(screenMs(), before);
  resolution.close();
});

test("it counts how late the next frame is, not how seldom something moves", async (t) => {
  const resolution = await resolutionOn(SCREEN_MS, 2);
  let late = 0;
  globalThis.requestAnimationFrame = (frame) => (frame(now + SCREEN_MS + late), 0);
  t.after(() => Reflect.deleteProperty(globalThis, "requestAnimationFrame"));
  let now = 0;
  const draw = (pictures: number, everyMs: number): void => {
    for (let i = 0; i < pictures; i++, now += everyMs) resolution.drawn(now);
  };
  draw(200, 100);
  assert.equal(resolution.value, 2);
  late = 5 * 60_000; // the page was hidden
  draw(5, 100);
  assert.equal(resolution.value, 2);
  late = SCREEN_MS;
  draw(20, 100);
  assert.ok(resolution.value < 2);
});
