// Runs the tests one after the other, in one house and one browser, and reports.
import { existsSync, readdirSync, rmSync } from "node:fs";
import { resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";
import { House } from "./house.mjs";
import { Browser, CHROMIUM } from "./look.mjs";
import { Report } from "./report.mjs";
import { Runner } from "./runner.mjs";
import { tests as runs } from "./tests/runner.mjs";
import { tests as door } from "./tests/door.mjs";
import { tests as wall } from "./tests/wall.mjs";
import { tests as station } from "./tests/station.mjs";
import { tests as scope } from "./tests/scope.mjs";
import { tests as debrief } from "./tests/debrief.mjs";
import { tests as looks } from "./tests/looks.mjs";
import { tests as keyboard } from "./tests/keyboard.mjs";
import { tests as crowd } from "./tests/crowd.mjs";
import { tests as memory } from "./tests/memory.mjs";
import { tests as restart } from "./tests/restart.mjs";
import { tests as throttle } from "./tests/throttle.mjs";

// In this order: who signs in first, and what ends the server last.
const ROOMS = { runner: runs, door, wall, station, scope, debrief, looks, keyboard, crowd, memory, restart, throttle };

const { values: options } = parseArgs({ options: {
  json: { type: "boolean", default: false }, quick: { type: "boolean", default: false },
  only: { type: "string", default: "" }, minutes: { type: "string", default: "1" },
} });
const say = (words) => console.error(`browser: ${words}`);

if (!existsSync(CHROMIUM)) {
  say(`there is no ${CHROMIUM}`);
  process.exit(77);
}

if (!chosen().some(({ name }) => name.includes(options.only))) {
  say(`no test has ${JSON.stringify(options.only)} in its name`);
  process.exit(2);
}

function chosen() {
  const all = Object.entries(ROOMS).flatMap(([room, tests]) => tests.map((run) => ({ name: `${room}: ${run.name.replaceAll("_", " ")}`, run })));
  return all.filter(({ name, run }) => run.always || name.includes(options.only));
}

async function attempt({ name, run }, world) {
  const begun = performance.now();
  let fault;
  try {
    await run(world);
  } catch (error) {
    fault = error;
    world.house.keepLogs(world.browser.picturePath("failed").replace(/png$/, "log"));
    await world.browser.keepAll();
  }
  await world.browser.closeAll();
  const seconds = Number(((performance.now() - begun) / 1000).toFixed(1));
  say(`${fault ? "FAILED" : "passed"} ${seconds.toFixed(1).padStart(5)} s  ${name}${fault ? `\n${fault.stack}` : ""}`);
  return { name, seconds, passed: !fault };
}

async function main() {
  const source = resolve(fileURLToPath(import.meta.url), "../../..");
  const out = resolve(source, "build/browser");
  if (existsSync(out)) for (const name of readdirSync(out)) if (name.startsWith("failed")) rmSync(resolve(out, name));
  const report = new Report();
  const house = await House.open(source);
  for (const signal of ["SIGINT", "SIGTERM"]) process.once(signal, () => void house.close().finally(() => process.exit(1)));
  let browser, runner;
  try {
    browser = await Browser.open(house.url, out);
    const world = { house, browser, report, quick: options.quick, minutes: Number(options.minutes), who: {} };
    runner = new Runner(report, (test) => attempt(test, world));
    await runner.run(chosen());
    for (const words of [...browser.errors, ...browser.violations]) say(words);
    report.mark("console_errors", browser.errors.length, "errors", 0);
    report.mark("axe_violations", browser.checked ? browser.violations.length : NaN, "violations", 0);
  } finally {
    await browser?.close();
    await house.close();
  }
  report.retried = runner.retried;
  report.print(options.json);
  say(runner.summary);
  return report.holds(options.json) ? 0 : 1;
}

process.exitCode = await main();
