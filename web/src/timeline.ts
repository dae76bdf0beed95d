// The timeline of a replay: what has come, what happened when, where it stands. A pointer scrubs.
import { clockStep } from "./axes";
import type { TimedEvent, Source } from "./source";
import { SessionState } from "wire";
import { format, text } from "./text";
import { onTheme, themeColour } from "./theme";
import { bandsOf } from "./playback";
import { h, setText } from "./ui";

const EDGE = 10; // px, so that the knob has room at both ends
const BAND = 26; // where the band of states begins,
const BAND_HIGH = 8; // px high
const OTHER = 40; // where the events of another session begin
const SNAP = 5; // px

const COLOURS: Record<string, string> = {
  cut: "--plot-4", piece: "--plot-4", undone: "--plot-5", grasped: "--plot-4", takenOut: "--good", dropped: "--now", refused: "--now", deviceLost: "--now", deviceBack: "--good", state: "--look",
};
const BAND_COLOURS: Record<number, string> = {
  [SessionState.RUNNING]: "--accent", [SessionState.PAUSED]: "--act",
};

interface Flag {
  time: number;
  words: string;
}

export class Timeline {
  readonly element: HTMLElement;
  onSeek: (time: number) => void = () => {};

  private readonly canvas = h("canvas", { "aria-hidden": "true" });
  private readonly surface = this.canvas.getContext("2d")!;
  private readonly tip = h("div", { class: "timeline-tip", hidden: true, "aria-hidden": "true" });
  private readonly colours = new Map<string, string>();
  private readonly ends: (() => void)[];
  private time = 0;
  private length = 1;
  private other: { source: Source; ahead: number } | undefined;
  private wide = 0;
  private high = 0;
  private pending = 0;

  constructor(private readonly source: Source) {
    this.element = h("div", { class: "timeline", tabindex: 0, role: "slider", "aria-label": text.debrief.timeline, "aria-valuemin": 0 }, this.canvas, this.tip);
    const resize = new ResizeObserver(() => this.measure());
    resize.observe(this.element);
    this.ends = [() => resize.disconnect(), onTheme(() => {
      this.colours.clear();
      this.draw();
    }), source.onChange(() => this.draw())];
    this.element.addEventListener("pointerdown", (event) => this.press(event));
    this.element.addEventListener("pointermove", (event) => this.move(event));
    this.element.addEventListener("pointerleave", () => (this.tip.hidden = true));
  }

  close(): void {
    cancelAnimationFrame(this.pending);
    for (const end of this.ends) end();
  }

  setTime(time: number, length: number): void {
    this.time = time;
    this.length = Math.max(length, 0.1);
    this.element.setAttribute("aria-valuemax", this.length.toFixed(1));
    this.element.setAttribute("aria-valuenow", time.toFixed(1));
    this.element.setAttribute("aria-valuetext", text.debrief.timeOf(format.clock(time), format.clock(length)));
    this.draw();
  }

  /** Another session's events below; `ahead`: its time less this one's. */
  setOther(source: Source | undefined, ahead = 0): void {
    this.other = source && { source, ahead };
    this.draw();
  }

  draw(): void {
    this.pending ||= requestAnimationFrame(() => {
      this.pending = 0;
      this.paint();
    });
  }

  // ---- the pointer -----------------------------------------------------------------------------------

  private press(event: PointerEvent): void {
    if (event.button !== 0) return;
    this.element.setPointerCapture(event.pointerId);
    const flag = this.flagAt(event.offsetX);
    this.onSeek(flag?.time ?? this.timeAt(event.offsetX));
  }

  private move(event: PointerEvent): void {
    const x = event.clientX - this.element.getBoundingClientRect().left;
    const dragged = (event.buttons & 1) !== 0 && this.element.hasPointerCapture(event.pointerId);
    if (dragged) this.onSeek(this.timeAt(x));
    const flag = this.flagAt(x);
    this.tip.hidden = false;
    setText(this.tip, `${format.tenths(flag?.time ?? this.timeAt(x))}${flag ? ` · ${flag.words}` : ""}`);
    this.tip.style.left = `${Math.min(Math.max(x, 60), this.wide - 60)}px`;
  }

  private timeAt(x: number): number {
    return Math.min(1, Math.max(0, (x - EDGE) / (this.wide - 2 * EDGE))) * this.length;
  }

  private x(time: number): number {
    return EDGE + (time / this.length) * (this.wide - 2 * EDGE);
  }

  private flagAt(x: number): Flag | undefined {
    let best: Flag | undefined;
    let least = SNAP;
    const look = (time: number, words: () => string): void => {
      const far = Math.abs(this.x(time) - x);
      if (far < least) [least, best] = [far, { time, words: words() }];
    };
    for (const { event, time, times } of this.source.events)
      if (COLOURS[event]) look(time, () => text.session.events[event]! + text.session.times(times));
    for (const remark of this.source.remarks)
      look(Number(remark.timeNs) * 1e-9, () => `${remark.author}: ${remark.text || text.session.marker}`);
    for (const { time, words } of this.source.markers) look(time, () => words);
    return best;
  }

  // ---- the picture -----------------------------------------------------------------------------------

  private measure(): void {
    const { clientWidth: wide, clientHeight: high } = this.element;
    if (wide === this.wide && high === this.high) return;
    this.wide = wide;
    this.high = high;
    const scale = Math.min(devicePixelRatio, 2);
    this.canvas.width = Math.round(wide * scale);
    this.canvas.height = Math.round(high * scale);
    this.surface.setTransform(scale, 0, 0, scale, 0, 0);
    this.draw();
  }

  private colour(name: string): string {
    let found = this.colours.get(name);
    if (!found) this.colours.set(name, (found = themeColour(name)));
    return found;
  }

  private paint(): void {
    if (this.wide <= 2 * EDGE) return;
    this.surface.clearRect(0, 0, this.wide, this.high);
    this.paintBands();
    this.paintTouches(this.source.events, 0, BAND + BAND_HIGH + 1, "--text-quiet");
    this.paintEvents();
    this.paintRemarks();
    this.paintMarkers();
    if (this.other) this.paintOther(this.other.source, this.other.ahead);
    this.paintTimes();
    this.paintHere();
  }

  private box(from: number, to: number, y: number, high: number, colour: string): void {
    this.surface.fillStyle = this.colour(colour);
    this.surface.fillRect(this.x(from), y, Math.max(1, this.x(to) - this.x(from)), high);
  }

  private paintBands(): void {
    const { surface } = this;
    this.box(0, this.length, BAND, BAND_HIGH, "--line");
    surface.globalAlpha = 0.35;
    for (const { from, to, state } of bandsOf(this.source.history, this.source.events))
      this.box(from, to, BAND, BAND_HIGH, BAND_COLOURS[state] ?? "--line-strong");
    surface.globalAlpha = 1;
  }

  private paintTouches(events: readonly TimedEvent[], ahead: number, y: number, colour: string): void {
    this.surface.fillStyle = this.colour(colour);
    for (const { event, time } of events) if (event === "contact") this.surface.fillRect(Math.round(this.x(time - ahead)), y, 1, 4);
  }

  private paintEvents(): void {
    for (const { event, time } of this.source.events) {
      const colour = COLOURS[event];
      if (!colour) continue;
      this.surface.fillStyle = this.colour(colour);
      const small = event === "state" || event === "deviceBack";
      this.surface.fillRect(Math.round(this.x(time)) - 1, small ? BAND - 4 : BAND - 9, 2, (small ? 4 : 9) + BAND_HIGH);
    }
  }

  // Flags.
  private paintRemarks(): void {
    const { surface } = this;
    surface.fillStyle = this.colour("--accent");
    for (const { timeNs } of this.source.remarks) {
      const x = Math.round(this.x(Number(timeNs) * 1e-9));
      surface.fillRect(x - 1, BAND - 14, 2, 14 + BAND_HIGH);
      surface.beginPath();
      surface.moveTo(x + 1, BAND - 14);
      surface.lineTo(x + 9, BAND - 10.5);
      surface.lineTo(x + 1, BAND - 7);
      surface.fill();
    }
  }

  // What a device marked: thin lines that begin above the events.
  private paintMarkers(): void {
    this.surface.fillStyle = this.colour("--plot-3");
    for (const { time } of this.source.markers) this.surface.fillRect(Math.round(this.x(time)), BAND - 12, 1, 12 + BAND_HIGH);
  }

  private paintOther({ history, events }: Source, ahead: number): void {
    const { surface } = this;
    surface.globalAlpha = 0.3;
    if (history.count) this.box(Math.max(0, history.start - ahead), Math.min(this.length, history.end - ahead), OTHER + 3, 4, "--other");
    surface.globalAlpha = 1;
    surface.fillStyle = this.colour("--other");
    for (const { event, time } of events)
      if (COLOURS[event] && event !== "state" && time - ahead >= 0 && time - ahead <= this.length) surface.fillRect(Math.round(this.x(time - ahead)) - 1, OTHER, 2, 10);
  }

  private paintTimes(): void {
    const { surface } = this;
    const step = clockStep(this.length, Math.max(2, this.wide / 90));
    surface.font = "11px system-ui, sans-serif";
    surface.fillStyle = this.colour("--text-quiet");
    surface.textAlign = "center";
    surface.textBaseline = "alphabetic";
    for (let n = 0; n * step <= this.length; n++) {
      const words = step < 1 ? format.tenths(n * step) : format.clock(n * step);
      const half = surface.measureText(words).width / 2;
      surface.fillText(words, Math.min(Math.max(this.x(n * step), half), this.wide - half), 9);
    }
  }

  private paintHere(): void {
    const { surface } = this;
    const x = Math.round(this.x(this.time));
    surface.fillStyle = this.colour("--text");
    surface.fillRect(x - 1, 12, 2, this.high - 14);
    surface.beginPath();
    surface.arc(x, BAND + BAND_HIGH / 2, 7, 0, 2 * Math.PI);
    surface.fill();
    surface.fillStyle = this.colour("--surface");
    surface.beginPath();
    surface.arc(x, BAND + BAND_HIGH / 2, 3, 0, 2 * Math.PI);
    surface.fill();
  }
}
