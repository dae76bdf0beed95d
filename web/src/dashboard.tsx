// A session on one page: the joint, plots with a common cursor, events, remarks, resection, metrics. It
// shows any moment of its source, live or recorded.
import { effect, signal, type Signal } from "@preact/signals";
import { render, type ComponentChildren } from "preact";
import type { Metric } from "wire";
import { nameOf } from "./instruments";
import { FLEXION, FORCE, GAIN, GAIN_LEAST, SPEED, toolAt, VARUS, WARP, WORKING } from "./history";
import { Panels } from "./panels";
import { Plots, type PlotRow, type Flag, type Values } from "./plot";
import type { Marker } from "./scene/joint";
import { Viewport } from "./viewport";
import { Removed, REMOVED_TRACES, removedLabels } from "./removed";
import type { Change, Source } from "./source";
import { isTechnical, TechnicalSwitch } from "./technical";
import { format, text } from "./text";
import { h, setText } from "./ui";

const LIVE_WINDOW_S = 120;
const LATE_S = 2; // a page that was opened sooner has all of the session

export interface DashboardOptions {
  onMarker?: (marker: Marker) => void; // a point of the surface was chosen
  onTime?: (time: number | undefined) => void; // another moment was asked for; undefined: the newest
  metrics?: (metrics: readonly Metric[]) => ComponentChildren; // instead of the usual table
}

export class Dashboard {
  readonly element: HTMLElement;
  readonly viewports: HTMLElement; // one picture, or more side by side
  readonly viewport: Viewport;
  readonly panels: Panels;
  time: number | undefined; // what is shown, s; undefined: the newest

  private readonly plots: Plots;
  private readonly back: HTMLElement;
  private readonly working = signal<string>(format.none); // the instrument
  private readonly since = signal("");
  private readonly ends: (() => void)[] = [];
  private cursor: number | undefined;
  private readonly windowS: Signal<number>; // 0: all
  private flags = 0; // events, remarks and markers that the plots have
  private pending = 0;

  constructor(private readonly source: Source, private readonly options: DashboardOptions = {}) {
    this.viewport = new Viewport(source);
    this.viewport.onMarker = (marker) => options.onMarker?.(marker);
    this.plots = new Plots(PLOT_ROWS, valuesOf(source), { name: text.session.plots, help: text.session.plotsHelp });
    this.plots.onCursor = (time) => this.setCursor(time);
    this.plots.onPick = (time) => this.pick(time);
    this.panels = new Panels(source, (time) => this.pick(time), options.metrics);
    this.back = h("button", { type: "button", class: "button primary back-to-live", on: { click: () => this.pick(undefined) } }, text.session.backToLive);
    this.back.hidden = true;
    this.viewport.element.append(this.back);
    this.viewports = h("div", { class: "viewports" }, this.viewport.element);
    this.windowS = signal(source.recorded ? 0 : LIVE_WINDOW_S);
    const head = h("div", {});
    render(<PlotsHead working={this.working} since={this.since} windowS={this.windowS} />, head);
    this.element = h("div", { class: "dashboard" }, this.viewports, this.panels.element,
      h("section", { class: "plots-panel panel", "aria-label": text.session.plots }, head, this.plots.element));
    const shown = effect(() => {
      isTechnical();
      void this.windowS.value;
      this.soon();
    });
    this.ends.push(source.onChange((change) => this.changed(change)), shown, () => render(null, head), () => this.panels.close(), () => this.plots.close(), () => this.viewport.close());
    this.changed("session");
  }

  close(): void {
    cancelAnimationFrame(this.pending);
    for (const end of this.ends) end();
  }

  /** The moment to show; undefined: the newest. */
  setTime(time: number | undefined): void {
    this.time = time;
    this.back.hidden = this.source.recorded || this.time === undefined;
    if (this.time !== undefined) setText(this.back, `${text.session.at(format.clock(this.time))} · ${text.session.backToLive}`);
    this.viewport.setTime(time);
    this.soon();
  }

  get shownTime(): number {
    return this.time ?? this.source.history.end;
  }

  /** Adds a second session to the plots, or removes it (undefined). `ahead`: its time at this one's start. */
  setOther(other: Source | undefined, ahead = 0): void {
    this.plots.setOther(other && shifted(valuesOf(other), ahead));
  }

  private pick(time: number | undefined): void {
    this.setTime(time === undefined ? undefined : Math.min(Math.max(time, this.source.history.start), this.source.history.end));
    this.options.onTime?.(this.time);
  }

  // ---- what changes ----------------------------------------------------------------------------------

  private changed(change: Change): void {
    if (change === "session") {
      this.plots.setLabels(REMOVED, removedLabels(this.source.session?.groups));
      this.flags = 0;
      if (!this.source.history.count && !this.source.recorded && this.time !== undefined) this.setTime(undefined);
    }
    this.panels.changed(change);
    if (change === "progress" || (change === "moment" && this.time !== undefined)) this.plots.draw(); // what a cut did has its time only then
    else if (!this.source.recorded || (change !== "mesh" && change !== "resection")) this.soon();
  }

  private soon(): void {
    this.pending ||= requestAnimationFrame(() => {
      this.pending = 0;
      this.refresh();
    });
  }

  // Beside the picture.
  private refresh(): void {
    const { history } = this.source;
    const time = this.shownTime;
    const end = Math.max(history.end, 1);
    this.plots.setHere(this.time);
    this.plots.setUnknown(this.source.recorded || !history.count ? -Infinity : history.start);
    const late = !this.source.recorded && history.start > LATE_S;
    this.since.value = late ? text.session.since(format.clock(history.start)) : "";
    const windowS = this.windowS.value;
    if (windowS === 0) this.plots.setWindow(history.start, end);
    else {
      const from = Math.max(0, Math.min(time + windowS / 2, end) - windowS);
      this.plots.setWindow(from, from + windowS);
    }
    const { events, remarks, markers } = this.source;
    if (this.flags !== events.length + remarks.length + markers.length) {
      this.flags = events.length + remarks.length + markers.length;
      this.plots.setFlags(flagsOf(this.source));
    }
    this.plots.showRows(PLOT_ROWS.flatMap((_, row) => ((row !== FORCE_ROW || history.hasForce) && (!TECHNICAL_ROWS.includes(row) || isTechnical()) ? [row] : [])));
    this.panels.showTime(time);
    this.readWorking();
  }

  // ---- plots -------------------------------------------------------------------------------------------

  private setCursor(time: number | undefined): void {
    this.cursor = time;
    this.readWorking();
  }

  private readWorking(): void {
    const { history } = this.source;
    const index = history.indexAt(this.cursor ?? this.shownTime);
    this.working.value = nameOf(history.instruments[history.value(index, WORKING)]) ?? format.none;
  }
}

interface PlotsHeadProps {
  working: Signal<string>;
  since: Signal<string>;
  windowS: Signal<number>;
}

function PlotsHead({ working, since, windowS }: PlotsHeadProps) {
  return (
    <div class="plots-head">
      <span class="quiet-text">{text.session.working}: <output class="working">{working}</output><span class="since">{since}</span></span>
      <TechnicalSwitch label={text.session.technical} />
      <fieldset class="segments">
        <legend class="unseen">{text.session.windows}</legend>
        {text.session.window.map(([seconds, label]) => (
          <label key={seconds} class="choice">
            <input type="radio" name="window" value={seconds} checked={windowS.value === seconds} onChange={() => (windowS.value = seconds)} /><span>{label}</span>
          </label>))}
      </fieldset>
    </div>
  );
}

const REMOVED = 4;
const FORCE_ROW = 6; // where there is a gauge
const TECHNICAL_ROWS = [2, 3]; // how the method moves what is shown
const PLACES: Record<number, number[]> = { 2: [WARP], 3: [GAIN, GAIN_LEAST], 5: [SPEED], 6: [FORCE] };

function valuesOf(source: Source): Values {
  const { history } = source;
  const removed = new Removed(source);
  return {
    end: () => history.end,
    spacing: () => history.spacing,
    count: (row, trace) => (row === REMOVED ? removed.of(trace).length : history.count),
    time: (row, trace, index) => (row === REMOVED ? removed.of(trace)[index]!.time : history.time(index)),
    value: (row, trace, index) => {
      if (row === REMOVED) return removed.of(trace)[index]!.mm3;
      if (row === 0) return history.value(index, FLEXION);
      if (row === 1) return history.value(index, VARUS);
      const tool = history.value(index, WORKING);
      if (!(tool >= 0)) return NaN;
      return history.value(index, toolAt(tool) + PLACES[row]![trace]!);
    },
  };
}

function shifted(values: Values, ahead: number): Values {
  return { ...values, end: () => values.end() - ahead, time: (row, trace, index) => values.time(row, trace, index) - ahead };
}

const PLOT_ROWS: PlotRow[] = [
  { label: text.session.rows.flexion, unit: text.units.degrees, digits: 1, traces: [{ label: "", colour: "--plot-1" }], least: 0, most: 30 },
  { label: text.session.rows.varus, unit: text.units.degrees, digits: 1, traces: [{ label: "", colour: "--plot-1" }], least: -5, most: 5, lines: [0] },
  { label: text.session.rows.warp, unit: text.units.mm, digits: 2, traces: [{ label: "", colour: "--plot-2" }], least: 0, most: 1 },
  {
    label: text.session.rows.gain, unit: "", digits: 2, least: 0.8, most: 1.2, lines: [0.88, 1.07],
    traces: [{ label: text.session.rows.gainMost, colour: "--plot-2" }, { label: text.session.rows.gainLeast, colour: "--plot-3" }],
  },
  {
    label: text.session.rows.removed, unit: text.units.mm3, digits: 0, least: 0, most: 50, step: true,
    traces: ["--plot-4", "--plot-5", "--plot-3"].slice(0, REMOVED_TRACES).map((colour) => ({ label: "", colour })), // labels: of the session
  },
  { label: text.session.rows.speed, unit: text.units.mmPerSecond, digits: 0, traces: [{ label: "", colour: "--plot-1" }], least: 0, most: 20 },
  { label: text.session.rows.force, unit: text.units.newton, digits: 1, traces: [{ label: "", colour: "--plot-3" }], least: 0, most: 5 }, // where there is a gauge
];

const FLAG_COLOURS: Record<string, string> = {
  cut: "--plot-4", piece: "--plot-4", undone: "--plot-5", grasped: "--plot-4", takenOut: "--good", dropped: "--act", refused: "--act", deviceLost: "--now", deviceBack: "--good", state: "--look",
};

function flagsOf(source: Source): Flag[] {
  const flags: Flag[] = [];
  for (const { time, event } of source.events) {
    const colour = FLAG_COLOURS[event];
    if (colour) flags.push({ time, colour, label: text.session.events[event]! });
  }
  for (const { timeNs } of source.remarks) flags.push({ time: Number(timeNs) * 1e-9, colour: "--accent", label: "" });
  for (const { time, words } of source.markers) flags.push({ time, colour: "--plot-3", label: words });
  return flags;
}
