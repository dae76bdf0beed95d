// Runs tests one after the other. A test that fails is tried once more while the run's budget for that lasts.

export const RETRIES_MOST = 2; // as in ./check

export class Runner {
  retried = []; // names

  /** `attempt` runs a test and gives what it reports of it: {name, seconds, passed}. */
  constructor(report, attempt) {
    this.report = report;
    this.attempt = attempt;
  }

  async run(tests) {
    for (const test of tests) if (!(await this.#once(test, 1)) && this.#mayRetry(test)) await this.#once(test, 2);
  }

  /** The last line of a run. */
  get summary() {
    return `retried: ${this.retried.length}${this.retried.length ? ` (${this.retried.join(", ")})` : ""}`;
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
