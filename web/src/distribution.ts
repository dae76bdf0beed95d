// A session's metrics beside those of others: where its value lies among theirs.
import type { Metric } from "wire";
import type { Groups } from "./groups";
import { metricValue, subjectName } from "./panels";
import { format, text } from "./text";
import { empty, h, setText } from "./ui";

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

/** Strips, one for each metric. */
export function strips(values: readonly Value[], beside: Beside): HTMLElement {
  const known = values.filter(({ value }) => Number.isFinite(value));
  const alone = hasOthers(known, beside.distributions) ? text.debrief.alone : "";
  if (!known.length) return empty(text.debrief.noMetrics);
  return h("div", { class: "strips" }, ...bySubject(known).map(([subject, of]) =>
    h("section", { class: "strip-group" }, h("h3", {}, subject ? subjectName(subject, beside.groups) : text.debrief.wholeSession), h("dl", {}, ...of.map((value) => strip(value, beside, alone))))));
}

function strip(value: Value, { distributions, other }: Beside, alone: string): HTMLElement {
  const name = text.session.metricNames[value.name] ?? value.name.replaceAll("_", " ");
  const distribution = distributionOf(distributions, value);
  const spread = distribution && spreadOf(distribution);
  const others = other.find((one) => one.name === value.name && one.subject === value.subject && one.version === value.version && Number.isFinite(one.value));
  const shown = h("dd", { class: "strip-value" });
  setText(shown, value.belowFloor ? text.debrief.belowFloor(metricValue(value)) : metricValue(value));
  const words = spread && distribution.n > 1 ? spreadWords(distribution, spread) : alone;
  return h("div", { class: "strip" }, h("dt", {}, name), shown,
    others && h("dd", { class: "strip-other" }, metricValue(others)),
    spread && distribution.n > 1 && h("dd", { class: "strip-plot", "aria-hidden": "true" }, drawn(value.value, others?.value, distribution, spread)),
    words && h("dd", { class: "strip-words" }, words));
}

// Quarters of a handful say nothing.
const QUARTERS_LEAST = 5;

function spreadWords({ n, unit }: Distribution, { least, lower, median, upper, most }: Spread): string {
  const value = (figure: number): string => metricValue({ value: figure, unit }, false);
  const some = format.number(n);
  return n < QUARTERS_LEAST ? text.debrief.few(some, value(least), value(most)) : text.debrief.spread(some, value(median), value(lower), value(upper));
}

const SVG = "http://www.w3.org/2000/svg";

function shape(tag: string, attributes: Record<string, string | number>): SVGElement {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  return element;
}

// Dots are sessions, the box is the middle half; this one's value is the mark.
function drawn(value: number, other: number | undefined, { n, values = [] }: Distribution, spread: Spread): SVGElement {
  const least = Math.min(spread.least, value, other ?? Infinity);
  const range = Math.max(spread.most, value, other ?? -Infinity) - least;
  const x = (at: number): string => `${range > 0 ? 3 + (94 * (at - least)) / range : 50}%`;
  const wide = range > 0 ? `${(94 * (spread.upper - spread.lower)) / range}%` : "0%";
  const svg = shape("svg", { class: "strip-svg", height: 22 });
  svg.append(shape("line", { class: "whisker", x1: x(spread.least), x2: x(spread.most), y1: 11, y2: 11 }),
    ...(n < QUARTERS_LEAST ? [] : [shape("rect", { class: "middle", x: x(spread.lower), width: wide, y: 5, height: 12, rx: 2 })]),
    ...values.map((one) => shape("circle", { class: "one", cx: x(one), cy: 11, r: 2 })),
    ...(n < QUARTERS_LEAST ? [] : [shape("line", { class: "median", x1: x(spread.median), x2: x(spread.median), y1: 4, y2: 18 })]));
  if (other !== undefined) svg.append(shape("circle", { class: "other", cx: x(other), cy: 11, r: 4.5 }));
  svg.append(shape("line", { class: "mine", x1: x(value), x2: x(value), y1: 1, y2: 21 }));
  return svg;
}
