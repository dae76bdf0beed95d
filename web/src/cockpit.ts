// A session on one page: the joint, plots with a common cursor, events, remarks, resection, metrics. It
// shows any moment of its source, live or recorded.
import { Vector3 } from "three";
import { FLEXION, GAIN, GAIN_LEAST, newRow, SEEN, SPEED, toolAt, VARUS, WARP, WARPED, WORKING } from "./history";
import { Panels } from "./panels";
import { Plots, type PlotRow, type Sign, type Values } from "./plot";
import { loadKnee, type Knee } from "./scene/anatomy";
import { Joint, USUAL_SHOW, type Marker, type Show } from "./scene/joint";
import { NoWebGl, View3D } from "./scene/view3d";
import { Toolbar } from "./scene_tools";
import { markerAt, type Change, type Source } from "./source";
import { format, text } from "./text";
import { broken, button, fill, h, loading, setText } from "./ui";

const MEASURED_MOST = 1500; // moments for the maps in one frame
const LIVE_WINDOW_S = 120;

export interface CockpitOptions {
  onMarker?: (marker: Marker) => void; // a point of the surface was chosen
  onTime?: (time: number | undefined) => void; // another moment is shown; undefined: the newest
}

export class Cockpit {
  readonly element: HTMLElement;
  readonly panels: Panels;
  time: number | undefined; // what is shown, s; undefined: the newest
  picking = false; // a click on the surface chooses a point

  private readonly stage = h("div", { class: "stage" });
  private readonly state = h("div", { class: "stage-state" });
  private readonly toolbar: Toolbar;
  private readonly plots: Plots;
  private readonly back: HTMLElement;
  private readonly working = h("output", { class: "working" });
  private readonly ends: (() => void)[] = [];
  private readonly row = newRow();
  private readonly measuring = newRow();
  private show: Show = { ...USUAL_SHOW };
  private view: View3D | undefined;
  private joint: Joint | undefined;
  private knee = ""; // which one is shown, or asked for
  private measured = -1; // moments that the maps know
  private cursor: number | undefined;
  private windowS = LIVE_WINDOW_S; // 0: all
  private signs = 0; // marks and remarks that the plots have
  private pending = 0;

  constructor(private readonly source: Source, private readonly options: CockpitOptions = {}) {
    this.toolbar = new Toolbar(this.show, {
      show: (show) => this.setShow(show),
      preset: (name) => this.view?.orbit.preset(name),
      follow: (on) => this.follow(on),
    });
    this.plots = new Plots(PLOT_ROWS, this.values(), { name: text.session.plots, help: text.session.plotsHelp });
    this.plots.onCursor = (time) => this.setCursor(time);
    this.plots.onPick = (time) => this.setTime(time);
    this.panels = new Panels(source, (time) => this.setTime(time));
    this.back = button(text.session.backToLive, () => this.setTime(undefined), { class: "back-to-live", kind: "primary" });
    this.back.hidden = true;
    this.stage.append(this.state, this.toolbar.element, this.back);
    this.element = h("div", { class: "cockpit" }, this.stage, this.panels.element,
      h("section", { class: "plots-panel panel", "aria-label": text.session.plots }, this.plotHead(), this.plots.element));
    this.ends.push(source.onChange((change) => this.changed(change)), () => this.plots.close(), () => this.dropScene());
    if (source.recorded) this.windowS = 0;
    this.changed("session");
  }

  close(): void {
    cancelAnimationFrame(this.pending);
    for (const end of this.ends) end();
  }

  /** The moment to show; undefined: the newest. */
  setTime(time: number | undefined): void {
    this.time = time === undefined ? undefined : Math.min(Math.max(time, this.source.history.start), this.source.history.end);
    this.back.hidden = this.source.recorded || this.time === undefined;
    if (this.time !== undefined) setText(this.back, `${text.session.at(format.clock(this.time))} · ${text.session.backToLive}`);
    this.options.onTime?.(this.time);
    this.soon();
  }

  get shownTime(): number {
    return this.time ?? this.source.history.end;
  }

  /** Where the working instrument's tip is shown, on the nearest surface; undefined: no probe is seen. */
  markerAtTip(): Marker | undefined {
    const tip = this.tip();
    return tip && this.joint?.markerAt(tip);
  }

  // ---- what changes ----------------------------------------------------------------------------------

  private changed(change: Change): void {
    if (change === "session") this.begin();
    if (change === "moment" && this.time !== undefined) {
      this.plots.draw();
      this.panels.changed(change);
      return;
    }
    this.panels.changed(change);
    this.soon();
  }

  private begin(): void {
    this.measured = -1;
    this.signs = 0;
    if (!this.source.history.count) this.time = undefined;
    this.joint?.forget();
    const session = this.source.session;
    if (!session) {
      fill(this.state, loading(text.session.waiting));
      return;
    }
    const key = `${session.caseName} ${session.caseHash}`;
    if (key === this.knee) return;
    this.knee = key;
    this.dropScene();
    fill(this.state, loading(text.session.loadingCase(session.caseName)));
    loadKnee(session.caseName, key).then(
      (knee) => this.knee === key && this.stage.isConnected && this.setKnee(knee),
      () => this.knee === key && fill(this.state, broken(text.session.noCase, text.session.noCaseHint, () => {
        this.knee = "";
        this.begin();
      })));
  }

  private setKnee(knee: Knee): void {
    fill(this.state);
    const joint = new Joint(knee);
    try {
      this.view = new View3D(this.stage, joint, text.session.scene);
    } catch (error) {
      if (!(error instanceof NoWebGl)) throw error;
      joint.dispose();
      fill(this.state, broken(text.session.noScene, text.session.noSceneHint));
      return;
    }
    this.joint = joint;
    joint.onMap = () => this.toolbar.showLegend(this.show.map, joint.map);
    joint.setShow(this.show);
    this.view.onFrame = (now) => this.frame(now);
    this.view.onPick = (marker) => this.picking && this.options.onMarker?.(marker);
    this.measured = -1;
    this.soon();
  }

  private dropScene(): void {
    this.view?.close();
    this.joint?.dispose();
    this.view = undefined;
    this.joint = undefined;
  }

  private setShow(show: Show): void {
    if (show.map !== this.show.map) this.measured = -1;
    this.show = show;
    this.joint?.setShow(show);
    this.view?.draw();
  }

  private tip(): Vector3 | undefined {
    const at = toolAt(this.row[WORKING]!);
    if (this.row[WORKING]! < 0 || this.row[at + SEEN]! < 1) return undefined;
    return new Vector3(this.row[at + WARPED + 4], this.row[at + WARPED + 5], this.row[at + WARPED + 6]);
  }

  private follow(on: boolean): void {
    if (!this.view) return;
    this.view.orbit.follow = on ? () => this.tip() : undefined;
    this.view.orbit.closeUp(on);
  }

  // ---- a picture ---------------------------------------------------------------------------------------

  private soon(): void {
    this.view?.draw();
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
    if (this.windowS === 0) this.plots.setWindow(history.start, end);
    else {
      const from = Math.max(0, Math.min(time + this.windowS / 2, end) - this.windowS);
      this.plots.setWindow(from, from + this.windowS);
    }
    if (this.signs !== this.source.marks.length + this.source.remarks.length) {
      this.signs = this.source.marks.length + this.source.remarks.length;
      this.plots.setSigns(signsOf(this.source));
    }
    this.panels.showTime(time);
    this.readWorking();
  }

  private frame(now: number): boolean {
    const { history } = this.source;
    const joint = this.joint!;
    const index = history.indexAt(this.shownTime);
    if (index < 0) return false;
    history.read(index, this.row);
    joint.setRow(this.row, history.time(index));
    joint.setTrails(history, history.time(index));
    for (const group of this.source.groups()) {
      const tissue = this.source.tissue(group, this.shownTime);
      if (tissue) joint.setTissue(group, tissue);
    }
    joint.setMarker(markerOf(this.source, this.shownTime));
    const more = this.measure(index);
    return joint.paint(now) || more;
  }

  // The maps of what was measured: all moments up to the one that is shown, some in each frame.
  private measure(index: number): boolean {
    if (this.show.map !== "gain" && this.show.map !== "contact") return false;
    if (index < this.measured) {
      this.joint!.forget();
      this.measured = -1;
    }
    const last = Math.min(index, this.measured + MEASURED_MOST);
    for (let i = this.measured + 1; i <= last; i++) {
      this.source.history.read(i, this.measuring);
      this.joint!.measure(this.measuring);
    }
    this.measured = last;
    return last < index;
  }

  // ---- plots -------------------------------------------------------------------------------------------

  private plotHead(): HTMLElement {
    const choices = text.session.window.map(([seconds, label]) => {
      const input = h("input", { type: "radio", name: "window", value: seconds, on: { change: () => {
        this.windowS = seconds;
        this.soon();
      } } });
      input.checked = seconds === (this.source.recorded ? 0 : LIVE_WINDOW_S);
      return h("label", { class: "choice" }, input, h("span", {}, label));
    });
    return h("div", { class: "plots-head" }, h("span", { class: "quiet-text" }, `${text.session.working}: `, this.working),
      h("fieldset", { class: "segments" }, h("legend", { class: "unseen" }, text.session.windows), ...choices));
  }

  private setCursor(time: number | undefined): void {
    this.cursor = time;
    this.readWorking();
  }

  private readWorking(): void {
    const { history } = this.source;
    const index = history.indexAt(this.cursor ?? this.shownTime);
    setText(this.working, text.session.instruments[history.value(index, WORKING)] ?? format.none);
  }

  private values(): Values {
    const { history } = this.source;
    const removed = (trace: number): { time: number; removed: number }[] => this.removed(trace);
    return {
      end: () => history.end,
      count: (row, trace) => (row === REMOVED ? removed(trace).length : history.count),
      time: (row, trace, index) => (row === REMOVED ? removed(trace)[index]!.time : history.time(index)),
      value: (row, trace, index) => {
        if (row === REMOVED) return removed(trace)[index]!.removed;
        if (row === 0) return history.value(index, FLEXION);
        if (row === 1) return history.value(index, VARUS);
        const tool = history.value(index, WORKING);
        if (!(tool >= 0)) return NaN;
        return history.value(index, toolAt(tool) + PLACES[row]![trace]!);
      },
    };
  }

  private readonly removedOf: { time: number; removed: number }[][] = [[], []];
  private removedCount = 0;

  // Of the medial and of the lateral meniscus.
  private removed(trace: number): { time: number; removed: number }[] {
    const { resections } = this.source;
    if (resections.length < this.removedCount) {
      this.removedOf[0] = [];
      this.removedOf[1] = [];
      this.removedCount = 0;
    }
    for (; this.removedCount < resections.length; this.removedCount++) {
      const { time, resection } = resections[this.removedCount]!;
      this.removedOf[resection.group === "meniscus_lateral" ? 1 : 0]!.push({ time, removed: resection.removedMm3 + resection.piecesMm3 });
    }
    return this.removedOf[trace]!;
  }
}

const REMOVED = 4;
const PLACES: Record<number, number[]> = { 2: [WARP], 3: [GAIN, GAIN_LEAST], 5: [SPEED] };

const PLOT_ROWS: PlotRow[] = [
  { label: text.session.rows.flexion, unit: "°", digits: 1, traces: [{ label: "", colour: "--plot-1" }], least: 0, most: 30 },
  { label: text.session.rows.varus, unit: "°", digits: 1, traces: [{ label: "", colour: "--plot-1" }], least: -5, most: 5, lines: [0] },
  { label: text.session.rows.warp, unit: "mm", digits: 2, traces: [{ label: "", colour: "--plot-2" }], least: 0, most: 1 },
  {
    label: text.session.rows.gain, unit: "", digits: 2, least: 0.8, most: 1.2, lines: [0.88, 1.07],
    traces: [{ label: text.session.rows.gainMost, colour: "--plot-2" }, { label: text.session.rows.gainLeast, colour: "--plot-3" }],
  },
  {
    label: text.session.rows.removed, unit: "mm³", digits: 0, least: 0, most: 50, step: true,
    traces: [
      { label: text.session.shortGroups.meniscus_medial!, colour: "--plot-4" }, { label: text.session.shortGroups.meniscus_lateral!, colour: "--plot-5" },
    ],
  },
  { label: text.session.rows.speed, unit: "mm/s", digits: 0, traces: [{ label: "", colour: "--plot-1" }], least: 0, most: 20 },
];

function markerOf(source: Source, time: number): Marker | undefined {
  const remark = markerAt(source, time);
  return remark?.point && { body: remark.body, point: remark.point };
}

const SIGN_COLOURS: Record<string, string> = {
  cut: "--plot-4", piece: "--plot-4", undone: "--plot-5", refused: "--act", deviceLost: "--now", deviceBack: "--good", state: "--look",
};

function signsOf(source: Source): Sign[] {
  const signs: Sign[] = [];
  for (const { time, event } of source.marks) {
    const colour = SIGN_COLOURS[event];
    if (colour) signs.push({ time, colour, label: text.session.events[event]! });
  }
  for (const { timeNs } of source.remarks) signs.push({ time: Number(timeNs) * 1e-9, colour: "--accent", label: "" });
  return signs;
}
