// Plots of values over the time of a session, one below the other, with a common cursor. They are one
// canvas; what the cursor reads stands beside it as text. A column of pixels shows the least and the
// greatest value that fall into it, so that no peak is lost.
import { clockStep, lastBefore, niceStep } from "./axes";
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

const LABEL = 204; // px, left of the plots
const AXIS = 20; // below
const TOP = 14; // for flags
const COST_SHARE = 6; // a picture that takes so long is drawn again after so many times that
const TICK = 14; // between figures of an axis at least, and so much of a row is theirs at its edges
const GAP_S = 2; // a longer gap is not drawn as a line

// A line over columns of pixels: of each the least and the greatest value. It breaks where a value is NaN.
class Columns {
  private column = NaN;
  private least = 0;
  private most = 0;
  private last = 0;

  constructor(private readonly surface: CanvasRenderingContext2D, private readonly y: (value: number) => number) {}

  add(x: number, value: number): void {
    if (x === this.column && !Number.isNaN(value)) {
      this.least = Math.min(this.least, value);
      this.most = Math.max(this.most, value);
      this.last = value;
      return;
    }
    const begun = !Number.isNaN(this.column);
    if (begun) for (const each of this.most === this.least ? [this.last] : [this.least, this.most, this.last]) this.surface.lineTo(this.column, this.y(each));
    if (!begun && !Number.isNaN(value)) this.surface.moveTo(x, this.y(value));
    this.column = Number.isNaN(value) ? NaN : x;
    this.least = this.most = this.last = value;
  }
}

export class Plots {
  readonly element: HTMLElement;
  from = 0; // s
  to = 60;
  onCursor: (time: number | undefined) => void = () => {};
  onPick: (time: number) => void = () => {}; // a click or Enter

  private readonly canvas = h("canvas", { "aria-hidden": "true" }); // all but the cursor
  private readonly over = h("canvas", { "aria-hidden": "true" });
  private readonly readings: HTMLElement[][];
  private readonly labels: HTMLElement[];
  private shown: number[]; // the rows, by their places in all
  private readonly surface: CanvasRenderingContext2D;
  private readonly overSurface: CanvasRenderingContext2D;
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
      this.canvas, this.over, h("div", { class: "plot-labels" }, ...this.labels));
    this.surface = this.canvas.getContext("2d")!;
    this.overSurface = this.over.getContext("2d")!;
    this.over.addEventListener("pointermove", (event) => this.setCursor(this.timeAt(event.offsetX)));
    this.over.addEventListener("pointerleave", () => this.setCursor(undefined));
    this.over.addEventListener("pointerdown", (event) => {
      const time = this.timeAt(event.offsetX);
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
  }

  /** The rows to show, by their places; the others hide. */
  showRows(rows: number[]): void {
    if (rows.join() === this.shown.join()) return;
    this.shown = rows;
    this.labels.forEach((label, i) => (label.hidden = !rows.includes(i)));
    this.draw();
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
    this.draw();
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

  private timeAt(x: number): number | undefined {
    if (x < LABEL) return undefined;
    return this.from + ((x - LABEL) / (this.wide - LABEL - 8)) * (this.to - this.from);
  }

  private x(time: number): number {
    return LABEL + ((time - this.from) / (this.to - this.from)) * (this.wide - LABEL - 8);
  }

  private measure(): void {
    const wide = this.element.clientWidth;
    const high = this.element.clientHeight;
    if (wide === this.wide && high === this.high) return;
    this.wide = wide;
    this.high = high;
    const scale = Math.min(devicePixelRatio, 2);
    for (const surface of [this.surface, this.overSurface]) {
      surface.canvas.width = Math.round(wide * scale);
      surface.canvas.height = Math.round(high * scale);
      surface.setTransform(scale, 0, 0, scale, 0, 0);
    }
    this.paintedAt = -Infinity;
    this.draw();
  }

  private colour(name: string): string {
    let found = this.colours.get(name);
    if (!found) this.colours.set(name, (found = themeColour(name)));
    return found;
  }

  // What is under the cursor waits where it takes long: a long session that is still coming.
  private paint(now: number): void {
    this.read();
    if (this.wide <= LABEL + 20 || this.high <= 0) return;
    if (this.stale && now - this.paintedAt >= COST_SHARE * this.costMs) {
      const began = performance.now();
      this.paintUnder();
      this.stale = false;
      this.paintedAt = now;
      this.costMs = performance.now() - began;
    }
    this.overSurface.clearRect(0, 0, this.wide, this.high);
    this.paintLine(this.here, "--accent", 2);
    this.paintLine(this.cursor, "--text", 1);
    if (this.stale) this.soon();
  }

  private paintUnder(): void {
    const { surface } = this;
    surface.clearRect(0, 0, this.wide, this.high);
    surface.font = "11px system-ui, sans-serif";
    const each = (this.high - TOP - AXIS) / this.shown.length;
    this.paintTimes();
    this.paintUnknown();
    this.shown.forEach((i, place) => this.paintRow(i, TOP + place * each, each));
    this.paintFlags();
  }

  private paintTimes(): void {
    const { surface } = this;
    const step = clockStep(this.to - this.from, Math.max(2, (this.wide - LABEL) / 80));
    surface.fillStyle = this.colour("--text-quiet");
    surface.strokeStyle = this.colour("--line");
    surface.lineWidth = 1;
    surface.textAlign = "center";
    surface.textBaseline = "alphabetic";
    surface.beginPath();
    for (let n = Math.ceil(this.from / step); n * step <= this.to; n++) {
      const x = Math.round(this.x(n * step)) + 0.5;
      surface.moveTo(x, TOP);
      surface.lineTo(x, this.high - AXIS);
      const words = step < 1 ? format.tenths(n * step) : format.clock(n * step);
      surface.fillText(words, Math.min(x, this.wide - 2 - surface.measureText(words).width / 2), this.high - 6);
    }
    surface.stroke();
  }

  private paintUnknown(): void {
    if (this.unknown <= this.from) return;
    this.surface.fillStyle = this.colour("--raised");
    this.surface.fillRect(LABEL, TOP, this.x(Math.min(this.unknown, this.to)) - LABEL, this.high - TOP - AXIS);
  }

  private paintRow(i: number, top: number, high: number): void {
    const row = this.all[i]!;
    const { surface } = this;
    const [least, most] = this.range(i);
    const y = (value: number): number => top + high - 5 - ((value - least) / (most - least)) * (high - 10);
    surface.strokeStyle = this.colour("--line");
    surface.beginPath();
    surface.moveTo(0, Math.round(top) + 0.5);
    surface.lineTo(this.wide, Math.round(top) + 0.5);
    surface.stroke();
    surface.strokeStyle = this.colour("--line-strong");
    surface.setLineDash([2, 3]);
    surface.beginPath();
    for (const line of row.lines ?? [])
      if (line >= least && line <= most) {
        surface.moveTo(LABEL, Math.round(y(line)) + 0.5);
        surface.lineTo(this.wide - 8, Math.round(y(line)) + 0.5);
      }
    surface.stroke();
    surface.setLineDash([]);
    this.paintScale(least, most, y, top, high);
    if (this.other) this.paintTrace(this.other, i, 0, this.colour("--other"), y);
    row.traces.forEach((trace, k) => this.paintTrace(this.values, i, k, this.colour(trace.colour), y));
  }

  private paintScale(least: number, most: number, y: (value: number) => number, top: number, high: number): void {
    const { surface } = this;
    const room = high - TICK; // between the middles of the first and the last
    const fine = niceStep(most - least, 4); // both ends are multiples of it
    const step = Math.max(fine, niceStep(most - least, Math.max(1, Math.floor(room / TICK))));
    surface.fillStyle = this.colour("--text-quiet");
    surface.textAlign = "right";
    surface.textBaseline = "middle";
    const digits = Math.max(0, Math.min(3, -Math.floor(Math.log10(fine) + 1e-9)));
    const ticks = [least, most];
    for (let n = Math.ceil(least / step - 1e-9); n * step <= most + 1e-9; n++) ticks.push(n * step);
    const places: number[] = [];
    for (const tick of ticks) {
      const at = Math.min(Math.max(y(tick), top + TICK / 2), top + TICK / 2 + room);
      if (places.some((place) => Math.abs(place - at) < TICK - 2)) continue;
      places.push(at);
      surface.fillText(format.number(tick, digits), LABEL - 6, at);
    }
  }

  // The values in the window, and what the axis shows at least.
  private range(i: number): [number, number] {
    const row = this.all[i]!;
    let { least, most } = row;
    const widen = (values: Values, k: number): void => {
      const timeOf = (index: number): number => values.time(i, k, index);
      const count = values.count(i, k);
      for (let index = Math.max(0, lastBefore(count, timeOf, this.from)); index < count && timeOf(index) <= this.to; index++) {
        const value = values.value(i, k, index);
        if (value < least) least = value;
        if (value > most) most = value;
      }
    };
    row.traces.forEach((_, k) => widen(this.values, k));
    if (this.other) widen(this.other, 0);
    const step = niceStep(most - least, 4);
    return [Math.floor(least / step + 1e-6) * step, Math.ceil(most / step - 1e-6) * step];
  }

  private paintTrace(values: Values, i: number, k: number, colour: string, y: (value: number) => number): void {
    const { surface } = this;
    const count = values.count(i, k);
    const timeOf = (index: number): number => values.time(i, k, index);
    const step = this.all[i]!.step === true;
    const gap = Math.max(GAP_S, 2 * values.spacing());
    const line = new Columns(surface, y);
    let last = NaN; // the value before
    surface.beginPath();
    for (let index = Math.max(0, lastBefore(count, timeOf, this.from)); index < count; index++) {
      const time = timeOf(index);
      const x = Math.round(this.x(Math.max(time, this.from)));
      if (step) line.add(x, last);
      else if (index > 0 && time - timeOf(index - 1) > gap) line.add(x, NaN);
      line.add(x, (last = values.value(i, k, index)));
      if (time > this.to) break;
    }
    if (step) line.add(Math.round(this.x(Math.min(this.to, values.end()))), last);
    line.add(0, NaN);
    surface.save();
    surface.clip(this.inside());
    surface.strokeStyle = colour;
    surface.lineWidth = 1.5;
    surface.lineJoin = "round";
    surface.stroke();
    surface.restore();
  }

  private inside(): Path2D {
    const path = new Path2D();
    path.rect(LABEL, 0, this.wide - LABEL - 8, this.high);
    return path;
  }

  private paintFlags(): void {
    const { surface } = this;
    for (const { time, colour } of this.flags) {
      if (time < this.from || time > this.to) continue;
      const x = Math.round(this.x(time)) + 0.5;
      surface.fillStyle = this.colour(colour);
      surface.beginPath();
      surface.moveTo(x - 4, 3);
      surface.lineTo(x + 4, 3);
      surface.lineTo(x, 11);
      surface.fill();
    }
  }

  private paintLine(time: number | undefined, colour: string, width: number): void {
    if (time === undefined || time < this.from || time > this.to) return;
    const surface = this.overSurface;
    const x = Math.round(this.x(time)) + 0.5;
    surface.strokeStyle = this.colour(colour);
    surface.lineWidth = width;
    surface.beginPath();
    surface.moveTo(x, TOP - 2);
    surface.lineTo(x, this.high - AXIS);
    surface.stroke();
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
