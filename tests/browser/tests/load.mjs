// 32 stations and 8 browsers: what they cost the server, and what comes to each.
import assert from "node:assert/strict";
import { replayed, SIZES } from "../browser.mjs";
import { SIMULATED_HZ } from "../testbed.mjs";
import { sleep, until } from "../programs.mjs";
import { quantile } from "../report.mjs";

const BROWSERS = 8;
const FRAMES = 60;

async function during(testbed, seconds) {
  const [cpu, begun] = [testbed.server.cpuS, performance.now()];
  await sleep(seconds * 1000);
  return (testbed.server.cpuS - cpu) / ((performance.now() - begun) / 1000);
}

function frames() {
  window.frames_ms = [];
  let last = performance.now();
  requestAnimationFrame(function look(now) {
    window.frames_ms.push(now - last);
    last = now;
    requestAnimationFrame(look);
  });
}

// A page that takes all that the server gives it of the wall, as one does whose pictures cost nothing.
function takeAll() {
  const socket = new WebSocket(`wss://${location.host}/live`, "arthron-live.1");
  socket.binaryType = "arraybuffer";
  window.taken = { messages: 0, bytes: 0 };
  const drawn = new DataView(new Uint8Array([0x12, 9, 9, 0, 0, 0, 0, 0, 0, 0, 0]).buffer); // Page.drawn.batches
  socket.onopen = () => socket.send(new Uint8Array([0x0a, 4, 8, 1, 0x28, 10])); // Page.watch: WALL, 10 Hz
  socket.onmessage = ({ data }) => {
    window.taken.messages++;
    window.taken.bytes += data.byteLength;
    drawn.setUint32(3, window.taken.messages, true);
    socket.send(drawn);
  };
}

const taken = async (pages) => (await Promise.all(pages.map((page) => page.evaluate(() => window.taken))))
  .reduce((sum, one) => ({ messages: sum.messages + one.messages, bytes: sum.bytes + one.bytes }));

async function thirty_two_stations_and_eight_browsers_leave_the_server_its_time({ testbed, browser, users, report }) {
  const seconds = 30;
  await testbed.runAll();
  await sleep(2000);
  const alone = await during(testbed, seconds);
  const pages = [];
  for (let i = 0; i < BROWSERS; i++) pages.push(await browser.page(await browser.context(users.instructor), "#/nowhere"));
  for (const page of pages) await page.evaluate(takeAll);
  await sleep(1000);
  const [before, steps] = [await taken(pages), (await testbed.session("list")).sessions];
  const together = await during(testbed, seconds);
  const [after, later] = [await taken(pages), (await testbed.session("list")).sessions];
  report.strictMark("server_cpu_share_8_browsers_32_stations", together - alone, "core", 0.3);
  report.figure("server_cpu_32_stations_alone", alone, "core");
  report.figure("wall_of_32_messages_per_browser", (after.messages - before.messages) / BROWSERS / seconds, "1/s");
  report.figure("wall_of_32_bytes_per_browser", (after.bytes - before.bytes) / BROWSERS / seconds, "B/s");
  for (const { station, steps: made, trace_missing: missing } of later) {
    const more = made - steps.find((of) => of.station === station).steps;
    assert.ok(more >= 0.5 * SIMULATED_HZ * seconds, `${station} made ${more} steps in ${seconds} s`);
    assert.equal(missing, 0, `the trace of ${station} lacks steps`);
  }
}

async function thirty_two_stations_are_on_one_wall({ testbed, browser, users, report }) {
  await testbed.runAll();
  const page = await browser.page(await browser.context(users.instructor, { viewport: SIZES.wide }), "#/wall", [], frames);
  await page.locator("article.card[data-status=running]").nth(31).waitFor();
  await page.evaluate(() => (window.frames_ms = []));
  await page.waitForFunction((least) => window.frames_ms.length >= least, FRAMES);
  report.figure("wall_of_32_frame_p50", quantile(await page.evaluate(() => window.frames_ms), 0.5), "ms");
  await browser.picture(page, "wall-of-32");
  const fits = await page.locator("article.card").last().evaluate((card) => card.getBoundingClientRect().bottom <= innerHeight);
  assert.ok(fits, "all 32 are on the screen");
}

async function messages_and_bytes_of_each_view({ testbed, browser, users, report }) {
  const seconds = 10;
  await testbed.runStation("room-1");
  for (const [name, hash] of [["wall", "#/wall"], ["station", "#/station/room-1"], ["scope", "#/scope/room-1"]]) {
    const page = await browser.page(await browser.context(users.instructor), hash);
    await page.locator("canvas").first().waitFor();
    await until("moments come", () => browser.heard(page).kinds.moment);
    await sleep(1000);
    const heard = browser.heard(page);
    const before = { ...heard };
    await sleep(seconds * 1000);
    report.figure(`${name}_messages`, (heard.messages - before.messages) / seconds, "1/s");
    report.figure(`${name}_bytes`, (heard.bytes - before.bytes) / seconds, "B/s");
    await browser.closeAll();
  }
  const { id } = await testbed.recorded();
  const page = await browser.page(await browser.context(users.instructor), `#/session/${id}`);
  await replayed(page);
  report.figure("debrief_messages_in_all", browser.heard(page).messages, "");
  report.figure("debrief_bytes_in_all", browser.heard(page).bytes, "B");
}

export const tests = [
  messages_and_bytes_of_each_view, thirty_two_stations_and_eight_browsers_leave_the_server_its_time, thirty_two_stations_are_on_one_wall,
];
