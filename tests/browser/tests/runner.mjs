// The runner itself: what it tries again, and what it reports of that.
import assert from "node:assert/strict";
import { Report } from "../report.mjs";
import { RETRIES_MOST, Runner } from "../runner.mjs";

// `outcomes`: of each test, whether its first and its second attempt pass.
async function ran(outcomes) {
  const report = new Report();
  const left = structuredClone(outcomes);
  const runner = new Runner(report, ({ name }) => ({ name, seconds: 0, passed: left[name].shift() }));
  await runner.run([[Object.keys(outcomes).map((name) => ({ name }))]]);
  return { report, runner };
}

async function a_retried_test_stays_in_the_report_with_its_failure() {
  const { report, runner } = await ran({ one: [true], two: [false, true], three: [true] });
  assert.deepEqual(report.tests.map(({ name, attempt, passed }) => [name, attempt, passed]),
    [["one", 1, true], ["two", 1, false], ["two", 2, true], ["three", 1, true]]);
  assert.deepEqual(report.faults(false), []);
  assert.equal(runner.summary.at(-1), "retried: 1 (two)");
  assert.equal((await ran({ one: [true] })).runner.summary.at(-1), "retried: 0");
  assert.deepEqual((await ran({ one: [false, false] })).report.faults(false), ["failed: one"]);
}

async function a_run_that_needs_more_retries_than_its_budget_fails() {
  const names = Array.from({ length: RETRIES_MOST + 1 }, (_, i) => `test ${i}`);
  const { report, runner } = await ran(Object.fromEntries(names.map((name) => [name, [false, true]])));
  assert.deepEqual(runner.retried, names.slice(0, RETRIES_MOST));
  assert.deepEqual(report.faults(false), [`failed: ${names.at(-1)}`]);
  assert.deepEqual(report.tests.at(-1), { name: names.at(-1), seconds: 0, passed: false, attempt: 1 });
}

// `length`: of a test, in turns of the event loop.
async function lanes_run_side_by_side_and_stages_one_after_the_other() {
  const lengths = { long: 3, short: 1, next: 1, last: 1 };
  const said = [];
  const report = new Report();
  const runner = new Runner(report, async ({ name }) => {
    said.push(name);
    for (let i = 0; i < lengths[name]; i++) await new Promise(setImmediate);
    said.push(`${name} ends`);
    return { name, seconds: lengths[name], passed: true };
  });
  const lane = (...names) => names.map((name) => ({ name }));
  await runner.run([[lane("long"), lane("short", "next")], [lane("last")]]);
  assert.deepEqual(said.slice(0, 3), ["long", "short", "short ends"]);
  assert.deepEqual(said.slice(-2), ["last", "last ends"]);
  assert.equal(said.length, 8);
  assert.match(runner.summary[0], /^longest: long 3.0 s, /);
}

export const tests = [lanes_run_side_by_side_and_stages_one_after_the_other, a_retried_test_stays_in_the_report_with_its_failure, a_run_that_needs_more_retries_than_its_budget_fails];
