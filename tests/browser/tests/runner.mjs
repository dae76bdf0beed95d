// The runner itself: what it tries again, and what it reports of that.
import assert from "node:assert/strict";
import { Report } from "../report.mjs";
import { RETRIES_MOST, Runner } from "../runner.mjs";

// `outcomes`: of each test, whether its first and its second attempt pass.
async function ran(outcomes) {
  const report = new Report();
  const left = structuredClone(outcomes);
  const runner = new Runner(report, ({ name }) => ({ name, seconds: 0, passed: left[name].shift() }));
  await runner.run(Object.keys(outcomes).map((name) => ({ name })));
  return { report, runner };
}

async function a_retried_test_stays_in_the_report_with_its_failure() {
  const { report, runner } = await ran({ one: [true], two: [false, true], three: [true] });
  assert.deepEqual(report.tests.map(({ name, attempt, passed }) => [name, attempt, passed]),
    [["one", 1, true], ["two", 1, false], ["two", 2, true], ["three", 1, true]]);
  assert.ok(report.holds(false));
  assert.equal(runner.summary, "retried: 1 (two)");
  assert.equal((await ran({ one: [true] })).runner.summary, "retried: 0");
  assert.ok(!(await ran({ one: [false, false] })).report.holds(false));
}

async function a_run_that_needs_more_retries_than_its_budget_fails() {
  const names = Array.from({ length: RETRIES_MOST + 1 }, (_, i) => `test ${i}`);
  const { report, runner } = await ran(Object.fromEntries(names.map((name) => [name, [false, true]])));
  assert.deepEqual(runner.retried, names.slice(0, RETRIES_MOST));
  assert.ok(!report.holds(false));
  assert.deepEqual(report.tests.at(-1), { name: names.at(-1), seconds: 0, passed: false, attempt: 1 });
}

export const tests = [a_retried_test_stays_in_the_report_with_its_failure, a_run_that_needs_more_retries_than_its_budget_fails];
