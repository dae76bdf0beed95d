// Runs the tests on one test bed and in one browser, and reports.
import assert from "node:assert/strict";
import { existsSync, readdirSync, rmSync } from "node:fs";
import { resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";
import { Testbed } from "./testbed.mjs";
import { Browser, CHROMIUM } from "./browser.mjs";
import { Report } from "./report.mjs";
import { Runner } from "./runner.mjs";
import { tests as runs } from "./tests/runner.mjs";
import { tests as signIn } from "./tests/sign_in.mjs";
import { tests as wall } from "./tests/wall.mjs";
import { tests as station } from "./tests/station.mjs";
import { tests as scope } from "./tests/scope.mjs";
import { tests as force } from "./tests/force.mjs";
import { tests as debrief } from "./tests/debrief.mjs";
import { tests as views } from "./tests/views.mjs";
import { tests as keyboard } from "./tests/keyboard.mjs";
import { tests as load } from "./tests/load.mjs";
import { tests as memory } from "./tests/memory.mjs";
import { tests as people } from "./tests/people.mjs";
import { tests as restart } from "./tests/restart.mjs";
import { tests as teach } from "./tests/teach.mjs";
import { tests as throttle } from "./tests/throttle.mjs";

// Each line's suites run side by side, so they use different stations. The tests that sign in come first, those of
// views without a session before all stations run, and those that stop the server last.
const STAGES = [
  { runner: runs }, { "sign-in": signIn }, { wall, station }, { scope }, { force }, { teach }, { debrief }, { memory, people }, { views },
  { keyboard }, { load }, { restart }, { throttle },
];

const LONG = ["load"]; // what many stations and pages cost: not with --quick

const { values: options } = parseArgs({ options: {
  json: { type: "boolean", default: false }, quick: { type: "boolean", default: false },
  only: { type: "string", default: "" }, minutes: { type: "string", default: "1" }, "keep-pictures": { type: "boolean", default: false },
} });
const minutes = (seconds) => `${Math.floor(seconds / 60)} min ${String(Math.floor(seconds % 60)).padStart(2, "0")} s`;
const say = (words) => console.error(`browser: ${words}`);

if (!existsSync(CHROMIUM)) {
  say(`there is no ${CHROMIUM}`);
  process.exit(77);
}

const chosen = STAGES.map((suites) => Object.entries(suites).filter(([suite]) => !(options.quick && LONG.includes(suite))).map(([suite, tests]) => tests
  .map((run) => ({ name: `${suite}: ${run.name.replaceAll("_", " ")}`, run }))
  .filter(({ name, run }) => run.always || name.includes(options.only))));

if (!chosen.flat(2).some(({ name }) => name.includes(options.only))) {
  say(`no test has ${JSON.stringify(options.only)} in its name`);
  process.exit(2);
}

// A trainee who stays at a station would be why the next tests fail there.
async function leaveStations(browser, testbed) {
  for (const trainee of await browser.signOut()) await testbed.giveBack(trainee);
}

async function attempt({ name, run }, world) {
  const begun = performance.now();
  const browser = world.browser.apart();
  let fault;
  try {
    await run({ ...world, browser });
    assert.deepEqual(browser.faults, [], "what its pages complain of");
  } catch (error) {
    fault = error;
    world.testbed.keepLogs(browser.picturePath("failed").replace(/png$/, "log"));
    await browser.keepAll();
    await leaveStations(browser, world.testbed).catch((left) => say(`${name}: its trainees stay where they are: ${left.message}`));
  }
  await browser.closeAll();
  const seconds = Number(((performance.now() - begun) / 1000).toFixed(1));
  say(`${fault ? "FAILED" : "passed"} ${seconds.toFixed(1).padStart(5)} s  ${name}${fault ? `\n${fault.stack}` : ""}`);
  return { name, seconds, passed: !fault, ...(fault && { why: fault.message.split("\n")[0] }) };
}

async function main() {
  const begun = performance.now();
  const source = resolve(fileURLToPath(import.meta.url), "../../..");
  const out = resolve(source, "build/browser");
  if (existsSync(out)) for (const name of readdirSync(out)) if (name.startsWith("failed")) rmSync(resolve(out, name));
  const report = new Report();
  const testbed = await Testbed.open(source);
  for (const signal of ["SIGINT", "SIGTERM"]) process.once(signal, () => void testbed.close().finally(() => process.exit(1)));
  let browser, runner;
  try {
    browser = await Browser.open(testbed.url, out);
    const world = { testbed, browser, report, quick: options.quick, keepPictures: options["keep-pictures"], minutes: Number(options.minutes), users: {} };
    runner = new Runner(report, (test) => attempt(test, world));
    await runner.run(chosen);
    report.strictMark("console_errors", browser.errors.length, "errors", 0);
    report.strictMark("axe_violations", browser.checked ? browser.violations.length : NaN, "violations", 0);
  } finally {
    await browser?.close();
    await testbed.close();
  }
  report.retried = runner.retried;
  report.print(options.json);
  for (const words of [...runner.summary, ...report.faults(options.json)]) say(words);
  say(`built in ${minutes(Number(process.env.BUILT_S ?? 0))}, tested in ${minutes((performance.now() - begun) / 1000)}`);
  return report.faults(options.json).length ? 1 : 0;
}

process.exitCode = await main();
