// Plots of values over the time of a session, one below the other, with a common cursor: a uPlot for each row.
// What the cursor reads stands beside them as text.
import uPlot from "uplot";
import { lastBefore, niceStep } from "./axes";
import { format } from "./text";
import { onTheme, themeColour } from "./theme";
import { h, setClass, setText } from "./ui";

export interface Trace {
  label: string;
  colour: string; // a custom property, as "--plot-1"
}

export interface PlotRow {
  label: string;
  unit: string;
  digits: number;
  traces: Trace[];
  least: number; // what the axis shows at least
  most: number;
  step?: boolean; // a value stays until the next one
  lines?: number[]; // thresholds
}

/** One row's values: times rise. */
export interface Values {
  count(row: number, trace: number): number;
  time(row: number, trace: number, index: number): number;
  value(row: number, trace: number, index: number): number;
  end(): number; // until when the last values hold
  spacing(): number; // between the older values where some were left out, s; else 0
}

export interface Flag {
  time: number;
  colour: string;
  label: string;
}

export interface PlotTexts {
  name: string; // of the whole, for screen readers
  help: string;
}

const LABELS = 172; // px, left of the plots: what the rows are of
const SCALE = 32; // and the figures of their axes
const AXIS = 20; // below
const TOP = 14; // for flags
const RIGHT = 16; // so that the last time has room
const EDGE = 6; // and the first and the last figure of an axis
const FONT = "11px system-ui, sans-serif";
const CLOCK_STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1800, 3600, 7200]; // s
const COST_SHARE = 6; // a picture that takes so long is drawn again after so many times that
const GAP_S = 2; // a longer gap is not drawn as a line

type Points = [times: number[], values: (number | null)[]];

// Those in the window and the next ones outside; null where the line breaks.
function pointsOf(values: Values, i: number, k: number, { step }: PlotRow, from: number, to: number): Points {
  const count = values.count(i, k);
  const timeOf = (index: number): number => values.time(i, k, index);
  const gap = Math.max(GAP_S, 2 * values.spacing());
  const points: Points = [[], []];
  const put = (time: number, value: number | null): void => {
    if (time <= (points[0].at(-1) ?? -Infinity)) points[1][points[1].length - 1] = value; // times rise
    else points[0].push(time), points[1].push(value);
  };
  const first = Math.max(0, lastBefore(count, timeOf, from));
  for (let index = first; index < count; index++) {
    const time = timeOf(index);
    if (!step && index > first && time - timeOf(index - 1) > gap) put((time + timeOf(index - 1)) / 2, null);
    const value = values.value(i, k, index);
    put(step ? Math.max(time, from) : time, Number.isNaN(value) ? null : value);
    if (time > to) break;
  }
  if (step && points[0].length && points[0].at(-1)! < Math.min(to, values.end())) put(Math.min(to, values.end()), points[1].at(-1)!);
  return points;
}

export class Plots {
  readonly element: HTMLElement;
  from = 0; // s
  to = 60;
  onCursor: (time: number | undefined) => void = () => {};
  onPick: (time: number) => void = () => {}; // a click or Enter

  private readonly readings: HTMLElement[][];
  private readonly labels: HTMLElement[];
  private readonly stack = h("div", { class: "plot-stack", "aria-hidden": "true" });
  private readonly hereLine = h("i", { class: "plot-line here", hidden: true });
  private readonly cursorLine = h("i", { class: "plot-line", hidden: true });
  private charts: uPlot[] = []; // of the rows that are shown
  private shown: number[]; // the rows, by their places in all
  private readonly resize: ResizeObserver;
  private cursor: number | undefined;
  private unknown = -Infinity; // what was before that time
  private here: number | undefined; // what is shown elsewhere: a line of its own
  private flags: Flag[] = [];
  private wide = 0;
  private high = 0;
  private pending = 0;
  private stale = true; // what is under the cursor is to be drawn anew
  private paintedAt = 0;
  private costMs = 0;
  private other: Values | undefined;
  private readonly endTheme: () => void;
  private readonly colours = new Map<string, string>();

  constructor(private readonly all: PlotRow[], private readonly values: Values, words: PlotTexts) {
    this.shown = all.map((_, i) => i);
    this.readings = all.map(({ traces }) => traces.map(() => h("output", { class: "plot-reading" })));
    this.labels = all.map((row, i) =>
      h("div", { class: "plot-label" }, h("span", { class: "plot-name" }, row.label, row.unit && h("small", {}, ` ${row.unit}`)),
        h("span", { class: "plot-values" }, ...row.traces.map((trace, k) => this.reading(row, trace, this.readings[i]![k]!)))));
    this.element = h("div", { class: "plots", tabindex: 0, role: "slider", "aria-label": words.name, title: words.help,
      on: { keydown: (event: KeyboardEvent) => this.key(event) } },
      this.stack, this.hereLine, this.cursorLine, h("div", { class: "plot-labels" }, ...this.labels));
    this.element.addEventListener("pointermove", (event) => this.setCursor(this.timeAt(event)));
    this.element.addEventListener("pointerleave", () => this.setCursor(undefined));
    this.element.addEventListener("pointerdown", (event) => {
      const time = this.timeAt(event);
      if (time !== undefined) this.onPick(time);
    });
    this.resize = new ResizeObserver(() => this.measure());
    this.resize.observe(this.element);
    this.endTheme = onTheme(() => {
      this.colours.clear();
      this.draw();
    });
  }

  close(): void {
    this.resize.disconnect();
    this.endTheme();
    cancelAnimationFrame(this.pending);
    for (const chart of this.charts) chart.destroy();
  }

  /** The rows to show, by their places; the others hide. */
  showRows(rows: number[]): void {
    if (rows.join() === this.shown.join()) return;
    this.shown = rows;
    this.labels.forEach((label, i) => (label.hidden = !rows.includes(i)));
    this.build();
  }

  setFlags(flags: Flag[]): void {
    this.flags = flags;
    this.draw();
  }

  /** Values before that time are unknown to this page. */
  setUnknown(until: number): void {
    if (this.unknown === until) return;
    this.unknown = until;
    this.draw();
  }

  setWindow(from: number, to: number): void {
    if (from === this.from && Math.max(to, from + 0.5) === this.to) return;
    this.from = from;
    this.to = Math.max(to, from + 0.5);
    this.draw();
  }

  /** The same values of another session, drawn behind in a colour of their own: the first trace of each row. */
  setOther(values: Values | undefined): void {
    this.other = values;
    this.build();
  }

  /** The moment that the rest of the page shows; undefined: the newest. */
  setHere(time: number | undefined): void {
    if (time === this.here) return;
    this.here = time;
    this.soon();
  }

  setCursor(time: number | undefined): void {
    if (time === this.cursor) return;
    this.cursor = time;
    this.onCursor(time);
    this.soon();
  }

  /** Once for all changes until the next frame. */
  draw(): void {
    this.stale = true;
    this.soon();
  }

  private soon(): void {
    this.pending ||= requestAnimationFrame((now) => {
      this.pending = 0;
      this.paint(now);
    });
  }

  private reading(row: PlotRow, trace: Trace, output: HTMLElement): HTMLElement {
    const key = h("i", { class: "plot-key", "aria-hidden": "true" });
    key.style.background = `var(${trace.colour})`;
    return h("span", { class: "plot-value" }, row.traces.length > 1 && key, row.traces.length > 1 && h("span", { class: "plot-trace" }, trace.label), output);
  }

  /** What a row's traces are of. */
  setLabels(row: number, labels: readonly string[]): void {
    this.readings[row]!.forEach((output, k) => setText(output.parentElement!.querySelector<HTMLElement>(".plot-trace")!, labels[k] ?? ""));
  }

  // Of groups: those that were cut; where none was, those that this case has.
  private showWorked(row: number, read: readonly (number | undefined)[]): void {
    const worked = read.some((value) => value);
    this.readings[row]!.forEach((reading, k) => setClass(reading.parentElement!, "none", worked ? !read[k] : k > 0 && read[k] === undefined));
  }

  private key(event: KeyboardEvent): void {
    const time = this.cursor ?? this.here ?? this.to;
    const step = (event.shiftKey ? 10 : 1) * (this.to - this.from) / 100;
    const to: Record<string, number | undefined> = {
      ArrowLeft: time - step, ArrowRight: time + step, PageDown: time - 10 * step, PageUp: time + 10 * step, Home: this.from, End: this.to, Escape: undefined,
    };
    if (event.key === "Enter") this.onPick(time);
    else if (event.key in to) {
      const wanted = to[event.key];
      this.setCursor(wanted === undefined ? undefined : Math.min(Math.max(wanted, this.from), this.to));
    } else return;
    event.preventDefault();
  }

  private timeAt({ clientX }: PointerEvent): number | undefined {
    const x = clientX - this.element.getBoundingClientRect().left - LABELS - SCALE;
    return x < 0 ? undefined : this.from + (x / this.plotted) * (this.to - this.from);
  }

  // Width of what is between the axes, px.
  private get plotted(): number {
    return Math.max(1, this.wide - LABELS - SCALE - RIGHT);
  }

  private measure(): void {
    const wide = this.element.clientWidth;
    const high = this.element.clientHeight;
    if (wide === this.wide && high === this.high) return;
    this.wide = wide;
    this.high = high;
    this.paintedAt = -Infinity;
    this.build();
  }

  private colour(name: string): string {
    let found = this.colours.get(name);
    if (!found) this.colours.set(name, (found = themeColour(name)));
    return found;
  }

  // ---- uPlot -------------------------------------------------------------------------------------------

  private build(): void {
    for (const chart of this.charts) chart.destroy();
    this.charts = [];
    const each = (this.high - TOP - AXIS) / this.shown.length;
    if (this.plotted > 20 && each > 8) this.charts = this.shown.map((i, place) => new uPlot(this.options(i, place, each), this.dataOf(i), this.stack));
    this.draw();
  }

  private options(i: number, place: number, each: number): uPlot.Options {
    const row = this.all[i]!;
    const first = place === 0;
    const last = place === this.shown.length - 1;
    const line = { stroke: () => this.colour("--line"), width: 1 };
    const axis: uPlot.Axis = { font: FONT, stroke: () => this.colour("--text-quiet"), ticks: { show: false } };
    const trace = (colour: string): uPlot.Series => ({
      stroke: () => this.colour(colour), width: 1.5, points: { show: false }, ...(row.step ? { paths: uPlot.paths.stepped!({ align: 1 }) } : {}),
    });
    const clock = (time: number, step: number): string => (step < 1 ? format.tenths(time) : format.clock(time));
    return {
      width: this.wide - LABELS, height: Math.floor(each) + (first ? TOP : 0) + (last ? AXIS : 0),
      padding: [first ? TOP : EDGE, RIGHT, last ? 0 : EDGE, 0], legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false, auto: false }, y: { range: (_, least, most) => this.range(row, least, most) } },
      series: [{}, ...(this.other ? [trace("--other")] : []), ...row.traces.map(({ colour }) => trace(colour))],
      axes: [
        { ...axis, size: last ? AXIS : 0, space: 80, gap: 2, incrs: CLOCK_STEPS, grid: line, values: (_, ticks, __, ___, step) => (last ? ticks.map((time) => clock(time, step)) : ticks.map(() => "")) },
        { ...axis, size: SCALE, space: 14, gap: 4, grid: { show: false }, values: (_, ticks, __, ___, step) => ticks.map((tick) => format.number(tick, digitsOf(step))) },
      ],
      hooks: { drawClear: [(chart) => this.drawUnder(chart, row)], draw: [(chart) => first && this.drawFlags(chart)] },
    };
  }

  // What the axis shows: the values in the window, and what it shows at least.
  private range({ least, most }: PlotRow, low: number | null, high: number | null): [number, number] {
    const bottom = Math.min(least, low ?? least);
    const top = Math.max(most, high ?? most);
    const step = niceStep(top - bottom, 4);
    return [Math.floor(bottom / step + 1e-6) * step, Math.ceil(top / step - 1e-6) * step];
  }

  private dataOf(i: number): uPlot.AlignedData {
    const row = this.all[i]!;
    const traces = row.traces.map((_, k) => pointsOf(this.values, i, k, row, this.from, this.to));
    const all = this.other ? [pointsOf(this.other, i, 0, row, this.from, this.to), ...traces] : traces;
    return all.length === 1 ? all[0]! : uPlot.join(all);
  }

  private drawUnder({ ctx, bbox, valToPos }: uPlot, { lines = [] }: PlotRow): void {
    ctx.save();
    if (this.unknown > this.from) {
      ctx.fillStyle = this.colour("--raised");
      ctx.fillRect(bbox.left, bbox.top, valToPos(Math.min(this.unknown, this.to), "x", true) - bbox.left, bbox.height);
    }
    ctx.beginPath();
    ctx.strokeStyle = this.colour("--line-strong");
    ctx.setLineDash([2 * devicePixelRatio, 3 * devicePixelRatio]);
    for (const line of lines) {
      const y = Math.round(valToPos(line, "y", true)) + 0.5;
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
    }
    ctx.stroke();
    ctx.restore();
  }

  private drawFlags({ ctx, bbox, valToPos }: uPlot): void {
    const unit = devicePixelRatio;
    for (const { time, colour } of this.flags) {
      if (time < this.from || time > this.to) continue;
      const x = Math.round(valToPos(time, "x", true)) + 0.5;
      ctx.fillStyle = this.colour(colour);
      ctx.beginPath();
      ctx.moveTo(x - 4 * unit, bbox.top - 11 * unit);
      ctx.lineTo(x + 4 * unit, bbox.top - 11 * unit);
      ctx.lineTo(x, bbox.top - 3 * unit);
      ctx.fill();
    }
  }

  // What is under the cursor waits where it takes long: a long session that is still coming.
  private paint(now: number): void {
    this.read();
    if (this.stale && now - this.paintedAt >= COST_SHARE * this.costMs) {
      const began = performance.now();
      this.charts.forEach((chart, place) => chart.batch(() => {
        chart.setData(this.dataOf(this.shown[place]!), false);
        chart.setScale("x", { min: this.from, max: this.to });
      }));
      this.stale = false;
      this.paintedAt = now;
      this.costMs = performance.now() - began;
    }
    this.place(this.hereLine, this.here);
    this.place(this.cursorLine, this.cursor);
    if (this.stale) this.soon();
  }

  private place(line: HTMLElement, time: number | undefined): void {
    line.hidden = time === undefined || time < this.from || time > this.to;
    if (!line.hidden) line.style.transform = `translateX(${LABELS + SCALE + Math.round(((time! - this.from) / (this.to - this.from)) * this.plotted)}px)`;
  }

  // What the cursor, or the moment that is shown, reads.
  private read(): void {
    const time = this.cursor ?? this.here ?? Infinity;
    this.all.forEach((row, i) => {
      const read = row.traces.map((_, k) => {
        const index = lastBefore(this.values.count(i, k), (at) => this.values.time(i, k, at), time);
        return index < 0 ? undefined : this.values.value(i, k, index);
      });
      row.traces.forEach((_, k) => setText(this.readings[i]![k]!, format.number(read[k], row.digits)));
      if (row.step) this.showWorked(i, read);
    });
    const shown = Math.min(time, this.to);
    this.element.setAttribute("aria-valuemin", this.from.toFixed(1));
    this.element.setAttribute("aria-valuemax", this.to.toFixed(1));
    this.element.setAttribute("aria-valuenow", shown.toFixed(1));
    this.element.setAttribute("aria-valuetext", `${format.clock(shown)}: ${this.spoken()}`);
  }

  private spoken(): string {
    return this.shown.map((i) => `${this.all[i]!.label} ${this.readings[i]!.map((output) => output.textContent).join(", ")} ${this.all[i]!.unit}`).join("; ");
  }
}

const digitsOf = (step: number): number => Math.max(0, Math.min(3, -Math.floor(Math.log10(step) + 1e-9)));
