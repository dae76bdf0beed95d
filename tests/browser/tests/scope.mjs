// What the trainee sees.
import assert from "node:assert/strict";
import { STATIONS } from "../testbed.mjs";
import { pixels } from "../browser.mjs";
import { sleep, until } from "../programs.mjs";
import { project, seenFrom } from "../optic.mjs";
import { mean, quantile } from "../report.mjs";
import { view } from "../wire.mjs";

const [PROBE, SCOPE] = [4, 8]; // channels
const SIDE = 600; // a small picture is drawn sooner
const OFF_PX = 2;
const SETTLED_MS = 20_000; // ends what hangs: without a graphics processor a picture takes its time
const STEP_DEG = 15; // of a key
const DRAWN_LEAST = 40;
// As the server's config has it, or the usual one: as long as nobody has chosen another.
const opticOf = (name) => ({ tiltDeg: 30, fieldDeg: 90, postDeg: 0, ...STATIONS[name].optic });
const WHITE = 250; // of 255
const CLIPPED_MOST = 0.03; // share of the round picture

const instrument = (seen, channel) => seen.instruments.find((of) => of.channel === channel);

async function open({ testbed, browser, users }, name, script = undefined) {
  const { port, token } = testbed.viewOf(name);
  const context = await browser.context(users.instructor, { viewport: { width: SIDE, height: SIDE } });
  const page = await browser.page(context, `#/scope/${name}?port=${port}&token=${token}`, [/ws:\/\/127.0.0.1/], script);
  await page.locator("canvas[data-drawn]").waitFor();
  return page;
}

// The middle of what has the marker's blue, in halves of the picture from its middle.
function blue({ width, height, data }) {
  const box = { left: width, right: -1, top: height, bottom: -1 };
  for (let y = 0; y < height; y++)
    for (let x = 0; x < width; x++) {
      const at = 4 * (y * width + x);
      const [r, g, b] = [data[at], data[at + 1], data[at + 2]];
      if (b < 90 || b < r + 60 || b < g + 15) continue;
      box.left = Math.min(box.left, x);
      box.right = Math.max(box.right, x);
      box.top = Math.min(box.top, y);
      box.bottom = Math.max(box.bottom, y);
    }
  if (box.right < 0) return undefined;
  return { right: (box.left + box.right + 1) / width - 1, up: 1 - (box.top + box.bottom + 1) / height, width: box.right - box.left + 1 };
}

async function a_marker_is_where_an_independent_projection_says(world) {
  const { testbed, browser, users } = world;
  await testbed.runStation("room-2");
  const admin = await browser.page(await browser.context(users.instructor), "#/station/room-2");
  await admin.getByRole("button", { name: "Marker", exact: true }).click();
  await until("the tip is marked", async () => {
    await admin.locator("body").press("t");
    return admin.locator(".controls-line", { hasText: "Marker: done" }).isVisible();
  });
  await admin.close();
  const page = await open(world, "room-2");
  await page.getByText("Touch the marked point").waitFor();
  await page.evaluate(() => document.querySelector(".scope-bottom").remove()); // it has the marker's colour, too
  const optic = opticOf("room-2");
  const offs = [];
  for (const tiltDeg of [30, 70]) {
    if (optic.tiltDeg !== tiltDeg) await page.keyboard.press("o");
    optic.tiltDeg = tiltDeg;
    for (let turn = 0; turn < 360 / STEP_DEG; turn += 1) {
      const seen = lastSeen(browser.heard(page).views);
      const wanted = project(instrument(seen, PROBE).warped.t, instrument(seen, SCOPE).warped, optic);
      if (wanted && Math.hypot(wanted.right, wanted.up) < 0.8 && turn % 2 === 0) offs.push({ ...optic, off: await off(page, wanted) });
      await page.keyboard.press(".");
      optic.postDeg += STEP_DEG;
    }
  }
  assert.ok(offs.length >= 4, `in view with ${offs.length} optics only`);
  assert.ok(new Set(offs.map(({ tiltDeg }) => tiltDeg)).size === 2, "with one optic only");
  for (const { tiltDeg, postDeg, off: px } of offs) assert.ok(px <= OFF_PX, `optic ${tiltDeg}°, post ${postDeg}°: ${px.toFixed(2)} px off`);
  world.report.figure("scope_marker_off_px_of_900", (900 / SIDE) * Math.max(...offs.map(({ off: px }) => px)), "px");
}

// The last view that has both: on a busy machine a tracker may be silent for a moment.
function lastSeen(views) {
  for (let i = views.length - 1; i >= 0; i--) {
    const seen = view(views[i]);
    if (instrument(seen, PROBE)?.warped && instrument(seen, SCOPE)?.warped) return seen;
  }
  return assert.fail("the station shows no probe");
}

// Turns the light post, as that many presses of the key do.
const turn = (page, times) => page.evaluate((count) => {
  for (let i = 0; i < count; i++) document.body.dispatchEvent(new KeyboardEvent("keydown", { key: ".", bubbles: true }));
}, times);

// How far the marker is from there, in px of the page, once it stands: a picture takes its time.
async function off(page, wanted) {
  let px = Infinity;
  for (const end = performance.now() + SETTLED_MS; px > OFF_PX && performance.now() < end; ) {
    const found = blue(await pixels(page.locator("canvas.scope-canvas")));
    if (found) px = Math.hypot(found.right - wanted.right, found.up - wanted.up) * (SIDE / 2);
  }
  return px;
}

// Of the middle of the round picture: the share that is white, and how bright it is, 0 to 255.
function brightness({ width, height, data }) {
  let [white, light, count] = [0, 0, 0];
  for (let y = 0; y < height; y++)
    for (let x = 0; x < width; x++) {
      if (Math.hypot(2 * x - width, 2 * y - height) > 0.8 * width) continue;
      const [r, g, b] = data.subarray(4 * (y * width + x), 4 * (y * width + x) + 3);
      if (Math.min(r, g, b) >= WHITE) white++;
      light += 0.3 * r + 0.59 * g + 0.11 * b;
      count++;
    }
  return { white: white / count, light: light / count };
}

async function near_bone_and_far_from_it_the_picture_is_neither_white_nor_black(world) {
  let most = 0;
  for (const name of ["room-2", "room-3"]) {
    await world.testbed.runStation(name);
    const page = await open(world, name);
    const steps = world.quick ? 12 : 4;
    for (let turned = 0; turned < 360 / STEP_DEG; turned += steps) {
      for (let tilt = 0; tilt < 2; tilt++) {
        await page.keyboard.press("o");
        const { white } = await exposed(page, `${name}, turned by ${turned * STEP_DEG}°`);
        most = Math.max(most, white);
      }
      await turn(page, steps);
    }
    await page.close();
  }
  world.report.figure("scope_white_share_most", most, "of the picture");
}

// The camera takes a moment to adapt.
async function exposed(page, where) {
  let found;
  for (const end = performance.now() + SETTLED_MS; performance.now() < end; ) {
    await sleep(300);
    found = brightness(await pixels(page.locator("canvas.scope-canvas")));
    if (found.white <= CLIPPED_MOST && found.light > 50 && found.light < 215) return found;
  }
  assert.fail(`${where}: ${(100 * found.white).toFixed(1)} % are white, ${found.light.toFixed(0)} of 255 bright`);
}

// A picture is drawn with shadows and hollows where a graphics processor draws it. Here none does, so it is slow.
function asIfByGraphicsProcessor() {
  const UNMASKED_RENDERER = 0x9246;
  const real = WebGL2RenderingContext.prototype.getParameter;
  WebGL2RenderingContext.prototype.getParameter = function (name) {
    return name === UNMASKED_RENDERER ? "A graphics processor" : real.call(this, name);
  };
}

async function with_shadows_and_hollows_the_picture_is_neither_white_nor_black(world) {
  await world.testbed.runStation("room-1");
  const page = await open(world, "room-1", asIfByGraphicsProcessor);
  await turn(page, 90 / STEP_DEG); // along a meniscus that is being cut
  await exposed(page, "with shadows and hollows");
  await world.browser.picture(page, "scope-with-shadows");
  await page.close();
}

async function what_stands_is_drawn_finely(world) {
  await world.testbed.runStation("room-2");
  const page = await open(world, "room-2");
  await page.waitForFunction((side) => document.querySelector("canvas.scope-canvas").width === side, SIDE);
}

// Which of the station's views was on the screen when, and where the things of that picture were drawn, as
// the graphics processor knew it: the last columns of all matrices of each thing's program, among them its
// place before the camera. What has not changed is not told again. The next frame begins when the last one
// is there.
function watchDrawn() {
  window.drawn = [];
  const gl = WebGL2RenderingContext.prototype;
  const known = new Map(); // of each program, where each of its matrices is
  let program;
  let places = [];
  let last;
  const before = (name, also) => {
    const real = gl[name];
    gl[name] = function (...args) {
      also(...args);
      return real.apply(this, args);
    };
  };
  const thing = () => places.push(...known.get(program).values());
  before("useProgram", (next) => {
    program = next;
    if (!known.has(next)) known.set(next, new Map());
  });
  before("uniformMatrix4fv", (where, _, values) => known.get(program).set(where, [values[12], values[13], values[14]]));
  before("drawElements", thing);
  before("drawArrays", thing);
  const look = () => {
    requestAnimationFrame(look);
    const number = document.querySelector("canvas[data-drawn]")?.dataset.drawn;
    if (number === undefined || number === last) return;
    last = number;
    window.drawn.push({ number: Number(number), utcMs: performance.timeOrigin + performance.now(), places });
    places = [];
  };
  requestAnimationFrame(look);
}

// What the page draws from now on: for so many ms, and in pictures enough to judge by.
async function drawnFor({ browser }, page, ms) {
  await page.evaluate(() => (window.drawn = []));
  browser.heard(page).views.length = 0;
  await sleep(ms);
  await page.waitForFunction((least) => window.drawn.length >= least, DRAWN_LEAST);
  return page.evaluate(() => window.drawn);
}

// How far what was drawn is from where a tip there would be seen.
function drawnOff({ places }, seen, tip) {
  const [right, up, depth] = seenFrom(tip, instrument(seen, SCOPE).warped, opticOf("room-3"));
  return Math.min(...places.map((place) => distance(place, [right, up, -depth])));
}

async function a_far_server_does_not_make_the_tip_late(world) {
  const { testbed, browser, report, quick } = world;
  await testbed.runStation("room-3");
  const page = await open(world, "room-3", watchDrawn);
  const drawn = await drawnFor(world, page, quick ? 4000 : 30_000);
  const views = new Map(browser.heard(page).views.map(view).map((seen) => [seen.number, seen]));
  await sleep(1000);
  const key = ([x, y, z]) => `${x} ${y} ${z}`;
  const place = (step, name) => ["tx_mm", "ty_mm", "tz_mm"].map((axis) => Number(step[`${name}_${axis}`]));
  const said = new Map((await testbed.steps("room-3")).filter((step) => step.probe_warped_tx_mm).map((step) => [key(place(step, "probe")), place(step, "probe_warped")]));
  const shown = drawn.flatMap((frame) => {
    const seen = views.get(frame.number);
    const probe = seen && instrument(seen, PROBE);
    const server = probe?.warped && said.get(key(probe.tip.t));
    return server ? [{ probe, utcMs: frame.utcMs, error: drawnOff(frame, seen, server), warp: distance(probe.tip.t, server) }] : [];
  });
  assert.ok(shown.length >= 15 && shown.length > drawn.length / 2, `${shown.length} of ${drawn.length} pictures can be compared`);
  assert.ok(quantile(shown.map(({ probe }) => probe.ageMs), 0.5) > 45, "the server is not far");
  const warps = shown.map(({ warp }) => warp);
  assert.ok(Math.max(...warps) - Math.min(...warps) > 0.2, "the warp stands");
  tell(report, shown, drawn);
}

function tell(report, shown, drawn) {
  const errors = shown.map(({ error }) => error);
  report.strictMark("scope_late_error_mm", mean(errors), "mm", 0.1);
  report.figure("scope_late_error_p99", quantile(errors, 0.99), "mm");
  report.figure("scope_late_answer_age", mean(shown.map(({ probe }) => probe.ageMs)), "ms");
  const clockMs = Date.now() - Number(process.hrtime.bigint()) / 1e6; // from monotonic to UTC
  const ages = shown.map(({ probe, utcMs }) => utcMs - clockMs - Number(probe.timeNs) / 1e6);
  const frames = drawn.slice(1).map(({ utcMs }, i) => utcMs - drawn[i].utcMs);
  report.figure("pose_in_to_pixel_p50", quantile(ages, 0.5), "ms");
  report.figure("pose_in_to_pixel_p95", quantile(ages, 0.95), "ms");
  report.figure("scope_frame_p50", quantile(frames, 0.5), "ms");
}

const distance = (a, b) => Math.hypot(...a.map((value, i) => value - b[i]));

async function the_place_of_one_station_is_not_asked_for_another(world) {
  for (const name of ["room-2", "room-3"]) await world.testbed.runStation(name);
  const page = await open(world, "room-2");
  const source = page.locator(".scope-sign.source");
  for (const [name, words] of [["room-3", /server/], ["room-2", /station/]]) {
    await page.goto(`${world.browser.url}/#/scope/${name}`);
    await page.locator("main", { has: page.getByRole("heading", { name: new RegExp(name) }) }).waitFor();
    await page.keyboard.press("f");
    await source.filter({ hasText: words }).waitFor();
  }
}

/** The scope's own picture is there, with these words over it. */
async function picturedAs(page, words) {
  await page.locator(".scope-sign.state", { hasText: words }).waitFor();
  await page.locator("canvas.scope-canvas").waitFor();
  await sleep(500); // what would take its place comes with the next moment
  assert.equal(await page.locator(".scope-state").innerText(), "");
}

async function a_pause_and_the_end_leave_the_trainee_the_picture(world) {
  const { testbed, browser } = world;
  await testbed.runStation("room-3");
  const page = await open(world, "room-3", watchDrawn);
  await testbed.session("pause", "room-3");
  await page.locator(".scope-sign.state", { hasText: "Paused" }).waitFor();
  const drawn = await drawnFor(world, page, 4000);
  const views = new Map(browser.heard(page).views.map(view).map((seen) => [seen.number, seen]));
  await testbed.session("stop", "room-3");
  await picturedAs(page, "The session is closed");
  await page.goto(`${browser.url}/#/scope/room-3`);
  await page.reload();
  await picturedAs(page, "The session is closed");
  await testbed.session("start", "room-3");
  const shown = drawn.flatMap((frame) => {
    const seen = views.get(frame.number);
    const tip = seen && instrument(seen, PROBE)?.warped?.t;
    return tip ? [{ tip, off: drawnOff(frame, seen, tip) }] : [];
  });
  assert.ok(shown.length >= 10 && shown.length > drawn.length / 2, `the probe is in ${shown.length} of ${drawn.length} pictures`);
  assert.ok(quantile(shown.map(({ off }) => off), 0.9) < 0.1, "it is drawn where the station has it");
  assert.ok(Math.max(...shown.map(({ tip }) => distance(tip, shown[0].tip))) > 1, "it stands still");
}

async function the_keys_are_there_to_be_seen({ testbed, browser, users }) {
  await testbed.runStation("room-2");
  const page = await browser.page(await browser.context(users.instructor), "#/scope/room-2");
  const list = page.locator(".scope-keys dl");
  await page.getByText("Keys", { exact: true }).waitFor();
  assert.equal(await list.isVisible(), false);
  await page.keyboard.press("?");
  await list.getByText("Turn the light post").waitFor();
  await page.keyboard.press("?");
  await list.waitFor({ state: "hidden" });
}

// They hide the tissue.
async function colours_of_touch_and_sight_are_off_until_they_are_asked_for(world) {
  await world.testbed.runStation("room-2");
  const page = await open(world, "room-2");
  const legend = page.locator(".legend", { hasText: "touched where nothing is seen" });
  assert.equal(await legend.count(), 0);
  await page.keyboard.press("t");
  await legend.waitFor();
  await world.browser.picture(page, "scope-touch-and-sight");
  await world.browser.check(page, "scope, touch and sight");
  await page.reload();
  await page.locator("canvas[data-drawn]").waitFor();
  assert.equal(await legend.count(), 0);
  await page.keyboard.press("s");
  await page.getByLabel("Colours", { exact: true }).selectOption("Touch and sight");
  await page.getByRole("button", { name: "Save" }).click();
  await legend.waitFor();
  await page.keyboard.press("t");
  await legend.waitFor({ state: "hidden" });
}

export const tests = [
  the_keys_are_there_to_be_seen,
  colours_of_touch_and_sight_are_off_until_they_are_asked_for,
  a_marker_is_where_an_independent_projection_says, near_bone_and_far_from_it_the_picture_is_neither_white_nor_black,
  with_shadows_and_hollows_the_picture_is_neither_white_nor_black, what_stands_is_drawn_finely,
  a_far_server_does_not_make_the_tip_late, the_place_of_one_station_is_not_asked_for_another,
  a_pause_and_the_end_leave_the_trainee_the_picture,
];
