// Runs stages of tests one after the other; the lanes of a stage side by side, and the tests of a lane one after the
// other. A test that fails is tried once more while the run's budget for that lasts.

export const RETRIES_MOST = 2; // as in ./check
const LONGEST = 5; // tests that the summary names

export class Runner {
  retried = []; // names

  /** `attempt` runs a test and gives what it reports of it: {name, seconds, passed}. */
  constructor(report, attempt) {
    this.report = report;
    this.attempt = attempt;
  }

  /** `stages`: lists of lanes, which are lists of tests. */
  async run(stages) {
    for (const lanes of stages) await Promise.all(lanes.map((tests) => this.#lane(tests)));
  }

  async #lane(tests) {
    for (const test of tests) if (!(await this.#once(test, 1)) && this.#mayRetry(test)) await this.#once(test, 2);
  }

  /** What is said at the end of a run. */
  get summary() {
    const longest = [...this.report.tests].sort((a, b) => b.seconds - a.seconds).slice(0, LONGEST);
    return [`longest: ${longest.map(({ name, seconds }) => `${name} ${seconds.toFixed(1)} s`).join(", ")}`,
      `retried: ${this.retried.length}${this.retried.length ? ` (${this.retried.join(", ")})` : ""}`];
  }

  // Every attempt stays in the report; the last one of a test counts.
  async #once(test, attempt) {
    const result = await this.attempt(test);
    this.report.tests.push({ ...result, attempt });
    return result.passed;
  }

  #mayRetry({ name }) {
    if (this.retried.length === RETRIES_MOST) return false;
    this.retried.push(name);
    return true;
  }
}
