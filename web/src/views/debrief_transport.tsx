// What a replay is run with: play, speed, events, the timeline, keys.
import type { Change, FeedSource, Source } from "../source";
import { format, text } from "../text";
import { nextStop, Player, SPEEDS, stopsOf } from "../playback";
import { Timeline } from "../timeline";
import type { IconName } from "../kit/icon";
import { fill, h, icon, select, setText } from "../ui";

const FOLLOW_MS = 250;
const PICTURE_MOST_S = 1; // a page that was hidden goes on where it was

export class Transport {
  readonly element: HTMLElement;
  onTime: (time: number) => void = () => {};

  private readonly player = new Player();
  private readonly timeline: Timeline;
  private readonly play: HTMLButtonElement;
  private readonly speed: HTMLSelectElement;
  private readonly clock = h("output", { class: "transport-clock number" });
  private readonly line = h("p", { class: "transport-line", role: "status" });
  private readonly share = h("span", { class: "transport-line" }); // not read out at each step
  private readonly bar = h("progress", { class: "transport-progress", max: 1, "aria-label": text.debrief.transport });
  private readonly ends: (() => void)[];
  private pending = 0;
  private last = 0; // when the picture before was drawn
  private shown = -1;
  private followed = 0; // when the end was last shown while more came

  constructor(private readonly source: FeedSource) {
    const words = text.debrief;
    this.timeline = new Timeline(source);
    this.timeline.onSeek = (time) => this.seek(time);
    this.play = this.tool("running", words.play, () => this.toggle());
    this.speed = select(SPEEDS.map((speed) => [String(speed), words.times(speed)]), "1", { "aria-label": words.speed,
      on: { change: () => (this.player.speed = Number(this.speed.value)) } });
    const keys = h("details", { class: "drop keys" }, h("summary", { class: "button" }, words.keysTitle),
      h("div", { class: "drop-panel" }, ...words.keys.split(" · ").map((key) => h("p", {}, key))));
    this.element = h("section", { class: "transport panel", "aria-label": words.transport },
      h("div", { class: "transport-tools" }, this.tool("previous", words.previous, () => this.jump(-1)), this.play, this.tool("next", words.next, () => this.jump(1)),
        this.clock, this.speed, keys, h("div", { class: "transport-state" }, this.line, this.share, this.bar)),
      this.timeline.element);
    const key = (event: KeyboardEvent): void => this.key(event);
    document.addEventListener("keydown", key);
    this.ends = [() => document.removeEventListener("keydown", key), source.onChange((change) => this.changed(change)), () => this.timeline.close()];
    this.changed("session");
  }

  close(): void {
    cancelAnimationFrame(this.pending);
    for (const end of this.ends) end();
  }

  seek(time: number): void {
    this.player.seek(time, this.source.history.start, this.length);
    this.show();
  }

  /** The outcome: as much of it as is here, and the rest as it comes. */
  toEnd(): void {
    this.player.toEnd(Math.max(this.source.history.end, this.source.history.start));
    this.show();
  }

  setOther(source: Source | undefined, ahead: number): void {
    this.timeline.setOther(source, ahead);
    this.element.classList.toggle("with-other", source !== undefined);
  }

  /** What stands beside the buttons once all is here. */
  say({ words, wrong }: { words: string; wrong: boolean }): void {
    setText(this.line, words);
    this.line.classList.toggle("fault", wrong);
  }

  private tool(sign: IconName, words: string, click: () => void): HTMLButtonElement {
    return h("button", { type: "button", class: "button icon-only", "aria-label": words, title: words, on: { click } }, icon(sign));
  }

  private get complete(): boolean {
    return this.source.progress === 1;
  }

  private get length(): number {
    const told = Number(this.source.session?.lengthNs ?? 0n) * 1e-9;
    return this.complete ? this.source.history.end : Math.max(told, this.source.history.end);
  }

  // ---- what changes ----------------------------------------------------------------------------------

  private changed(change: Change): void {
    if (change === "session" || change === "progress") {
      this.bar.value = this.source.progress;
      this.bar.hidden = this.complete;
      setText(this.share, this.complete || !this.source.session ? "" : text.debrief.replaying(format.percent(this.source.progress, 0)));
      if (!this.complete) this.say({ words: "", wrong: false });
    }
    if (this.player.atEnd) {
      this.follow(change);
      return;
    }
    // The moment that is shown may be the first one, or nearer to what is wanted than the one before.
    const { history } = this.source;
    if (change !== "session" && change !== "progress" && history.count > 1) return;
    this.shown = -1;
    this.seek(Math.max(this.player.time, this.source.history.start));
  }

  // Not at each moment: drawing them all would hold up what comes.
  private follow(change: Change): void {
    const now = performance.now();
    if (change === "session") this.shown = -1;
    if (!this.complete && now - this.followed < FOLLOW_MS) return;
    this.followed = now;
    this.toEnd();
  }

  private toggle(): void {
    this.player.toggle(this.source.history.start, this.source.history.end, this.complete);
    this.last = performance.now();
    this.show();
  }

  private jump(way: 1 | -1): void {
    const said = this.source.remarks.map(({ timeNs }) => Number(timeNs) * 1e-9);
    const stops = stopsOf(this.source.events, [...said, ...this.source.markers.map(({ time }) => time)]);
    const { start, end } = this.source.history;
    // While it plays, the event that has just passed is not the one before.
    const from = way === -1 && this.player.playing ? this.player.time - 0.7 : this.player.time;
    this.seek(nextStop(stops, from, way) ?? (way === 1 ? end : start));
  }

  private show(): void {
    const { time, playing } = this.player;
    const label = playing ? text.debrief.pause : text.debrief.play;
    if (this.play.title !== label) {
      this.play.title = label;
      this.play.setAttribute("aria-label", label);
      fill(this.play, icon(playing ? "paused" : "running"));
    }
    setText(this.clock, `${format.tenths(time)} / ${format.tenths(this.length)}`);
    this.timeline.setTime(time, this.length);
    if (time !== this.shown) this.onTime(time);
    this.shown = time;
    if (playing) this.run();
  }

  private run(): void {
    this.pending ||= requestAnimationFrame((now) => {
      this.pending = 0;
      const seconds = Math.min(PICTURE_MOST_S, Math.max(0, now - this.last) / 1000);
      this.last = now;
      this.player.advance(seconds, this.source.history.end, this.complete);
      this.show();
    });
  }

  // ---- keys ------------------------------------------------------------------------------------------

  // One moment on or back.
  private step(way: 1 | -1): void {
    const { history } = this.source;
    const at = Math.min(Math.max(history.indexAt(this.player.time) + way, 0), history.count - 1);
    if (at >= 0) this.seek(history.time(at));
  }

  private key(event: KeyboardEvent): void {
    if (event.defaultPrevented || event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) return;
    const on = event.target as HTMLElement;
    if (on.matches("input, select, textarea, [role=tab]") || (event.key === " " && on.matches("button, a, summary"))) return;
    const { time } = this.player;
    const far = event.shiftKey ? 10 : 1;
    const keys: Record<string, () => void> = {
      " ": () => this.toggle(), k: () => this.toggle(),
      ArrowLeft: () => this.seek(time - far), ArrowRight: () => this.seek(time + far), j: () => this.seek(time - 5), l: () => this.seek(time + 5),
      ",": () => this.step(-1), ".": () => this.step(1), p: () => this.jump(-1), n: () => this.jump(1),
      Home: () => this.seek(0), End: () => this.toEnd(), "+": () => this.faster(1), "-": () => this.faster(-1),
    };
    const what = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!what) return;
    event.preventDefault();
    what();
  }

  private faster(way: number): void {
    this.player.shift(way);
    this.speed.value = String(this.player.speed);
  }
}
