// A session's metrics beside those of others: where its value lies among theirs.
import type { Metric } from "wire";
import type { Groups } from "./groups";
import { Empty } from "./kit";
import { metricName, metricValue, subjectName } from "./panels";
import { format, text } from "./text";

/** What all closed sessions of a case, or of a course, came to. */
export interface Distribution {
  metric: string;
  subject: string;
  version: number;
  unit: string;
  n: number;
  values?: number[]; // they rise
  quantiles?: number[]; // instead of more than 200: 21, from the least by twentieths to the largest
}

export type Value = Pick<Metric, "name" | "subject" | "version" | "unit" | "value" | "belowFloor">;

export interface Spread {
  least: number;
  lower: number; // a quarter is below
  median: number;
  upper: number;
  most: number;
}

/** The value at a share, 0 to 1, of values that rise; between two of them it goes straight. */
export function quantile(values: readonly number[], share: number): number {
  const at = share * (values.length - 1);
  const low = Math.floor(at);
  const high = Math.min(low + 1, values.length - 1);
  return values[low]! + (at - low) * (values[high]! - values[low]!);
}

/** undefined: there are no values. */
export function spreadOf({ values, quantiles }: Distribution): Spread | undefined {
  const all = values ?? quantiles ?? [];
  if (!all.length) return undefined;
  return { least: all[0]!, lower: quantile(all, 0.25), median: quantile(all, 0.5), upper: quantile(all, 0.75), most: all.at(-1)! };
}

/** Only of the same metric, of the same version: other figures are not compared. */
export function distributionOf(all: readonly Distribution[], { name, subject, version }: Value): Distribution | undefined {
  return all.find((one) => one.metric === name && one.subject === subject && one.version === version);
}

/** Metrics by what they are of, in the order in which they came. */
export function bySubject(values: readonly Value[]): [subject: string, values: Value[]][] {
  const found = new Map<string, Value[]>();
  for (const value of values) found.set(value.subject, [...(found.get(value.subject) ?? []), value]);
  return [...found];
}

// ---- the page ------------------------------------------------------------------------------------------

export interface Beside {
  distributions: readonly Distribution[];
  other: readonly Value[]; // of the session that it is compared with
  groups: Groups | undefined; // of the session's case
}

/** Whether there is anything to see a value beside. */
export function hasOthers(values: readonly Value[], distributions: readonly Distribution[]): boolean {
  return values.some((value) => (distributionOf(distributions, value)?.n ?? 0) > 1);
}

interface StripsProps extends Beside {
  values: readonly Value[];
}

/** Strips, one for each metric. */
export function Strips({ values, ...beside }: StripsProps) {
  const known = values.filter(({ value }) => Number.isFinite(value));
  const alone = hasOthers(known, beside.distributions) ? text.debrief.alone : "";
  if (!known.length) return <Empty title={text.debrief.noMetrics} />;
  return (
    <div class="strips">{bySubject(known).map(([subject, of]) => (
      <section key={subject} class="strip-group">
        <h3>{subject ? subjectName(subject, beside.groups) : text.debrief.wholeSession}</h3>
        <dl>{of.map((value) => <Strip key={value.name} of={value} {...beside} alone={alone} />)}</dl>
      </section>))}</div>
  );
}

function Strip({ of, distributions, other, alone }: Beside & { of: Value; alone: string }) {
  const distribution = distributionOf(distributions, of);
  const spread = distribution && spreadOf(distribution);
  const others = other.find((one) => one.name === of.name && one.subject === of.subject && one.version === of.version && Number.isFinite(one.value));
  const several = spread && distribution.n > 1;
  const words = several ? spreadWords(distribution, spread) : alone;
  return (
    <div class="strip">
      <dt>{metricName(of.name)}</dt>
      <dd class="strip-value">{of.belowFloor ? text.debrief.belowFloor(metricValue(of)) : metricValue(of)}</dd>
      {others && <dd class="strip-other">{metricValue(others)}</dd>}
      {several && <dd class="strip-plot" aria-hidden="true"><Drawn value={of.value} other={others?.value} distribution={distribution} spread={spread} /></dd>}
      {words && <dd class="strip-words">{words}</dd>}
    </div>
  );
}

// Quarters of a handful say nothing.
const QUARTERS_LEAST = 5;

function spreadWords({ n, unit }: Distribution, { least, lower, median, upper, most }: Spread): string {
  const value = (figure: number): string => metricValue({ value: figure, unit }, false);
  const some = format.number(n);
  return n < QUARTERS_LEAST ? text.debrief.few(some, value(least), value(most)) : text.debrief.spread(some, value(median), value(lower), value(upper));
}

interface DrawnProps {
  value: number;
  other: number | undefined;
  distribution: Distribution;
  spread: Spread;
}

// Dots are sessions, the box is the middle half; this one's value is the mark.
function Drawn({ value, other, distribution: { n, values = [] }, spread }: DrawnProps) {
  const least = Math.min(spread.least, value, other ?? Infinity);
  const range = Math.max(spread.most, value, other ?? -Infinity) - least;
  const x = (at: number): string => `${range > 0 ? 3 + (94 * (at - least)) / range : 50}%`;
  const wide = range > 0 ? `${(94 * (spread.upper - spread.lower)) / range}%` : "0%";
  return (
    <svg class="strip-svg" height={22}>
      <line class="whisker" x1={x(spread.least)} x2={x(spread.most)} y1={11} y2={11} />
      {n >= QUARTERS_LEAST && <rect class="middle" x={x(spread.lower)} width={wide} y={5} height={12} rx={2} />}
      {values.map((one) => <circle class="one" cx={x(one)} cy={11} r={2} />)}
      {n >= QUARTERS_LEAST && <line class="median" x1={x(spread.median)} x2={x(spread.median)} y1={4} y2={18} />}
      {other !== undefined && <circle class="other" cx={x(other)} cy={11} r={4.5} />}
      <line class="mine" x1={x(value)} x2={x(value)} y1={1} y2={21} />
    </svg>
  );
}
