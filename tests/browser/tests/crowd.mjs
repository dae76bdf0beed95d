// 32 stations and 8 browsers: what they cost the server, and what comes to each.
import assert from "node:assert/strict";
import { SEAT_HZ } from "../house.mjs";
import { sleep } from "../programs.mjs";
import { quantile } from "../report.mjs";

const BROWSERS = 8;

async function during(house, seconds) {
  const [cpu, begun] = [house.server.cpuS, performance.now()];
  await sleep(seconds * 1000);
  return (house.server.cpuS - cpu) / ((performance.now() - begun) / 1000);
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

async function thirty_two_stations_and_eight_browsers_leave_the_server_its_time({ house, browser, who, report, quick }) {
  const seconds = quick ? 6 : 30;
  await house.runAll();
  await sleep(2000);
  const alone = await during(house, seconds);
  const pages = [];
  for (let i = 0; i < BROWSERS; i++) pages.push(await browser.page(await browser.context(who.instructor), "#/wall", [], frames));
  for (const page of pages) await page.locator("article.card[data-standing=running]").nth(31).waitFor({ timeout: 60_000 });
  await sleep(3000);
  const before = (await house.session("list")).sessions;
  const [messages, bytes] = [total(browser, pages, "messages"), total(browser, pages, "bytes")];
  const together = await during(house, seconds);
  const after = (await house.session("list")).sessions;
  report.mark("server_cpu_share_8_browsers_32_stations", together - alone, "core", 0.3);
  report.figure("server_cpu_32_stations_alone", alone, "core");
  report.figure("wall_of_32_messages_per_browser", (total(browser, pages, "messages") - messages) / BROWSERS / seconds, "1/s");
  report.figure("wall_of_32_bytes_per_browser", (total(browser, pages, "bytes") - bytes) / BROWSERS / seconds, "B/s");
  report.figure("wall_of_32_frame_p50", quantile(await pages[0].evaluate(() => window.frames_ms.slice(-60)), 0.5), "ms");
  await browser.picture(pages[0], "wall-of-32");
  for (const { station, steps, trace_missing: missing } of after) {
    const more = steps - before.find((of) => of.station === station).steps;
    assert.ok(more >= 0.5 * SEAT_HZ * seconds, `${station} made ${more} steps in ${seconds} s`);
    assert.equal(missing, 0, `the trace of ${station} lacks steps`);
  }
}

const total = (browser, pages, what) => pages.reduce((sum, page) => sum + browser.heard(page)[what], 0);

async function messages_and_bytes_of_each_view({ house, browser, who, report, quick }) {
  const seconds = quick ? 3 : 10;
  await house.runRoom("room-1");
  for (const [name, hash] of [["wall", "#/wall"], ["station", "#/station/room-1"], ["scope", "#/scope/room-1"]]) {
    const page = await browser.page(await browser.context(who.instructor), hash);
    await page.locator("canvas").first().waitFor();
    await sleep(2000);
    const heard = browser.heard(page);
    const before = { ...heard };
    await sleep(seconds * 1000);
    report.figure(`${name}_messages`, (heard.messages - before.messages) / seconds, "1/s");
    report.figure(`${name}_bytes`, (heard.bytes - before.bytes) / seconds, "B/s");
    await browser.closeAll();
  }
}

export const tests = [messages_and_bytes_of_each_view, thirty_two_stations_and_eight_browsers_leave_the_server_its_time];
