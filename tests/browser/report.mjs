// What was measured, in the form of the benches: {bench, marks, figures, tests, retried}.

export class Report {
  marks = [];
  figures = [];
  tests = []; // every attempt: {name, attempt, seconds, passed}
  retried = []; // names

  #strict = new Set(); // marks that count only where they are asked for

  /** Low is better. NaN and what could not be measured do not hold. */
  mark(name, value, unit, mark) {
    this.marks.push({ name, value: finite(value), unit, mark, better: "low", holds: value <= mark });
  }

  /** Of times, which only a machine with nothing else to do holds, and of what made tests fail that then passed:
   * it decides only where all marks are asked for. */
  strictMark(name, value, unit, mark) {
    this.#strict.add(name);
    this.mark(name, value, unit, mark);
  }

  figure(name, value, unit) {
    this.figures.push({ name, value: finite(value), unit });
  }

  /** Why the run fails: a line for each mark that does not hold and each test whose last attempt failed. */
  faults(strict) {
    const missed = this.marks.filter(({ name, holds }) => !holds && (strict || !this.#strict.has(name)));
    const failed = [...this.#lastAttempts().values()].filter(({ passed }) => !passed);
    return [...missed.map(({ name, value, mark }) => `missed: ${name} is ${value}, and may be ${mark}`), ...failed.map(({ name, why }) => `failed: ${name}${why ? `: ${why}` : ""}`)];
  }

  #lastAttempts() {
    return new Map(this.tests.map((test) => [test.name, test]));
  }

  print(json) {
    const rows = [...this.marks.map((mark) => [...row(mark), `at most ${mark.mark}`, mark.holds ? "" : "MISSED"]), ...this.figures.map(row)];
    const table = rows.map((cells) => cells.map((cell, i) => cell.padEnd([52, 12, 12, 12][i] ?? 0)).join(" ").trimEnd());
    if (!json) console.log(table.join("\n"));
    else console.log(JSON.stringify({ bench: "browser", marks: this.marks, figures: this.figures, tests: this.tests, retried: this.retried }));
  }
}

const finite = (value) => (Number.isFinite(value) ? Number(value.toPrecision(6)) : null);
const row = ({ name, value, unit }) => [name, value === null ? "none" : String(value), unit];

export const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

/** The value that a share of all lies below. */
export function quantile(values, share) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
}
