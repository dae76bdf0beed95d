// What a browser needs after a while.
import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { sleep } from "../programs.mjs";

const PAGE_KB = 4;
const GROWS_MB = { at_once: 1.5, a_minute: 0.4 }; // a moment that leaked 300 bytes would take more

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

async function heapMb(page) {
  const session = await page.context().newCDPSession(page);
  await session.send("HeapProfiler.collectGarbage");
  const { usedSize } = await session.send("Runtime.getHeapUsage");
  await session.detach();
  return usedSize / 1e6;
}

async function a_browser_that_stays_does_not_grow_without_end({ house, browser, who, report, minutes, quick }) {
  await house.runRoom("room-1");
  const context = await browser.context(who.instructor);
  const page = await browser.page(context, "#/station/room-1");
  await page.locator("canvas.scene-canvas").waitFor();
  await sleep(3000);
  const tell = async (when) => {
    const heap = await heapMb(page);
    report.figure(`browser_heap_${when}`, heap, "MB");
    report.figure(`browser_memory_${when}`, residentMb(process.pid) - process.memoryUsage().rss / 1e6, "MB");
    return heap;
  };
  const before = await tell("at_start");
  const stay = minutes || (quick ? 0.1 : 1);
  await sleep(stay * 60_000);
  const grew = (await tell(`after_${stay}_min`)) - before;
  assert.ok(grew <= GROWS_MB.at_once + GROWS_MB.a_minute * stay, `${grew.toFixed(1)} MB more after ${stay} minutes`);
}

export const tests = [a_browser_that_stays_does_not_grow_without_end];
