// What a page needs after a while: objects and typed arrays, which hold most of what it keeps.
import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { sleep } from "../programs.mjs";

const PAGE_KB = 4;
const SIZE = { width: 1000, height: 640 }; // a small picture is drawn sooner, and what is kept is the same
const SETTLES_S = 5;
const LOADED_MOST_S = 90; // a page draws first and loads the rest then
const STEADY_MB = 0.3;
const MOMENTS_LEAST = 60; // a page that hardly gets on, on a busy machine, seems steady
// A page keeps its moments in arrays, as many as come in this test. What would leak of each is as much again.
const CHUNK = { moments: 512, bytes: 700 };
const OBJECTS_MB = { at_once: 1.5, a_minute: 0.4 };
// Of room-2 nothing is cut. Of room-1 every change is kept as its bytes (3 kB) and a whole mesh (370 kB, which grows
// as it is cut) for each 16 changes, up to the page's limit.
const PAGES = { "room-2": { at_once: 0.15, a_change: 0 }, "room-1": { at_once: 0.5, a_change: 0.03 } };

// Of a process and all that it started, in MB.
function residentMb(root) {
  const stats = readdirSync("/proc").filter((name) => /^\d+$/.test(name)).flatMap((pid) => {
    try {
      const [parent, resident] = [readFileSync(`/proc/${pid}/stat`, "utf8").split(") ").pop().split(" ")[1], readFileSync(`/proc/${pid}/statm`, "utf8").split(" ")];
      return [{ pid: Number(pid), parent: Number(parent), mb: ((Number(resident[1]) - Number(resident[2])) * PAGE_KB) / 1024 }];
    } catch {
      return []; // it has ended
    }
  });
  const of = new Set([root]);
  for (let grew = true; grew; ) {
    grew = false;
    for (const { pid, parent } of stats) if (of.has(parent) && !of.has(pid)) grew = Boolean(of.add(pid));
  }
  return stats.filter(({ pid }) => of.has(pid)).reduce((sum, { mb }) => sum + mb, 0);
}

/** Of a page: {objects, arrays}, the latter the memory of its ArrayBuffers. */
async function usedMb(page) {
  const session = await page.context().newCDPSession(page);
  await session.send("HeapProfiler.collectGarbage");
  const { usedSize, backingStorageSize } = await session.send("Runtime.getHeapUsage");
  await session.detach();
  assert.ok(backingStorageSize > 0, "this Chromium does not tell the size of typed arrays");
  return { objects: usedSize / 1e6, arrays: backingStorageSize / 1e6 };
}

const chunks = (moments) => Math.ceil(moments / CHUNK.moments);

async function measure({ browser, report }, page, station, when) {
  const used = await usedMb(page);
  for (const kind of ["objects", "arrays"]) report.figure(`${station}_${kind}_${when}`, used[kind], "MB");
  const { moment, mesh_chunk: changes = 0 } = browser.heard(page).kinds;
  return { ...used, moments: moment, changes };
}

function check(station, minutes, before, after) {
  const objects = after.objects - before.objects;
  assert.ok(objects <= OBJECTS_MB.at_once + OBJECTS_MB.a_minute * minutes, `${station}: ${objects.toFixed(1)} MB more of objects`);
  const arrays = after.arrays - before.arrays;
  const moments = ((chunks(after.moments) - chunks(before.moments)) * CHUNK.moments * CHUNK.bytes) / 1e6;
  const { at_once, a_change } = PAGES[station];
  const most = at_once + moments + a_change * (after.changes - before.changes);
  assert.ok(arrays <= most, `${station}: ${arrays.toFixed(1)} MB more of arrays, ${most.toFixed(1)} expected at most`);
}

// Until pages get on, and their arrays do not grow as they do while a case is loaded.
async function loaded(browser, pages) {
  const arrays = async () => Promise.all(pages.map(async ({ page }) => (await usedMb(page)).arrays));
  const end = performance.now() + LOADED_MOST_S * 1000;
  const getOn = () => pages.every(({ page }) => (browser.heard(page).kinds.moment ?? 0) >= MOMENTS_LEAST);
  for (let before = await arrays(), grew = true; (grew || !getOn()) && performance.now() < end; ) {
    await sleep(SETTLES_S * 1000);
    const now = await arrays();
    grew = now.some((mb, i) => mb - before[i] > STEADY_MB);
    before = now;
  }
}

async function pages_that_stay_do_not_grow_without_end(world) {
  const { testbed, browser, users, report, minutes } = world;
  await testbed.recorded(); // which ends a session: a test beside this one may ask for it
  const open = async (station) => {
    await testbed.runStation(station);
    const page = await browser.page(await browser.context(users.instructor, { viewport: SIZE }), `#/station/${station}`);
    await page.locator("canvas.scene-canvas").waitFor();
    return { station, page };
  };
  const pages = [];
  for (const station of Object.keys(PAGES)) pages.push(await open(station));
  await loaded(browser, pages);
  for (const one of pages) one.before = await measure(world, one.page, one.station, "at_start");
  await sleep(minutes * 60_000);
  report.figure("browser_memory", residentMb(process.pid) - process.memoryUsage().rss / 1e6, "MB");
  for (const one of pages) one.after = await measure(world, one.page, one.station, `after_${minutes}_min`);
  for (const { station, before, after } of pages) check(station, minutes, before, after);
}

export const tests = [pages_that_stay_do_not_grow_without_end];
