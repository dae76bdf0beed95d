// What a replay is run with: play, speed, events, the timeline, keys.
import { signal } from "@preact/signals";
import { useLayoutEffect } from "preact/hooks";
import { Button, Drop, Island, Select, type IconName } from "../kit";
import { nextStop, Player, SPEEDS, stopsOf } from "../playback";
import type { Change, FeedSource, Source } from "../source";
import { format, text } from "../text";
import { Timeline } from "../timeline";

const FOLLOW_MS = 250;
const PICTURE_MOST_S = 1; // a page that was hidden goes on where it was

/** The clock of a replay; its bar shows the signals. */
export class Transport {
  onTime: (time: number) => void = () => {};

  readonly timeline: Timeline;
  readonly playing = signal(false);
  readonly speed = signal(1);
  readonly clock = signal("");
  readonly progress = signal(0); // the share of the record that is here
  readonly replays = signal(false); // the server has begun to send it
  readonly outcome = signal({ words: "", wrong: false }); // what is said once all is here
  readonly withOther = signal(false);
  private readonly player = new Player();
  private readonly ends: (() => void)[];
  private pending = 0;
  private last = 0; // when the picture before was drawn
  private shown = -1;
  private followed = 0; // when the end was last shown while more came

  constructor(private readonly source: FeedSource) {
    this.timeline = new Timeline(source);
    this.timeline.onSeek = (time) => this.seek(time);
    this.ends = [source.onChange((change) => this.changed(change)), () => this.timeline.close()];
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
    this.withOther.value = source !== undefined;
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
      this.progress.value = this.source.progress;
      this.replays.value = this.source.session !== undefined;
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

  toggle(): void {
    this.player.toggle(this.source.history.start, this.source.history.end, this.complete);
    this.last = performance.now();
    this.show();
  }

  jump(way: 1 | -1): void {
    const said = this.source.remarks.map(({ timeNs }) => Number(timeNs) * 1e-9);
    const stops = stopsOf(this.source.events, [...said, ...this.source.markers.map(({ time }) => time)]);
    const { start, end } = this.source.history;
    // While it plays, the event that has just passed is not the one before.
    const from = way === -1 && this.player.playing ? this.player.time - 0.7 : this.player.time;
    this.seek(nextStop(stops, from, way) ?? (way === 1 ? end : start));
  }

  private show(): void {
    const { time, playing } = this.player;
    this.playing.value = playing;
    this.clock.value = `${format.tenths(time)} / ${format.tenths(this.length)}`;
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

  key(event: KeyboardEvent): void {
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

  setSpeed(speed: number): void {
    this.player.speed = this.speed.value = speed;
  }

  private faster(way: number): void {
    this.player.shift(way);
    this.speed.value = this.player.speed;
  }
}

const Tool = ({ icon, words, click }: { icon: IconName; words: string; click: () => void }) =>
  <Button class="icon-only" icon={icon} aria-label={words} title={words} onClick={click} />;

export function TransportBar({ of }: { of: Transport }) {
  const words = text.debrief;
  useLayoutEffect(() => {
    const key = (event: KeyboardEvent): void => of.key(event);
    document.addEventListener("keydown", key);
    return () => document.removeEventListener("keydown", key);
  }, [of]);
  const playing = of.playing.value;
  return (
    <section class={`transport panel ${of.withOther.value ? "with-other" : ""}`} aria-label={words.transport}>
      <div class="transport-tools">
        <Tool icon="previous" words={words.previous} click={() => of.jump(-1)} />
        <Tool icon={playing ? "paused" : "running"} words={playing ? words.pause : words.play} click={() => of.toggle()} />
        <Tool icon="next" words={words.next} click={() => of.jump(1)} />
        <output class="transport-clock number">{of.clock}</output>
        <Select label={words.speed} options={SPEEDS.map((speed) => [String(speed), words.times(speed)])} value={String(of.speed.value)} onChoose={(speed) => of.setSpeed(Number(speed))} />
        <Drop label={words.keysTitle} class="keys">{words.keys.split(" · ").map((key) => <p key={key}>{key}</p>)}</Drop>
        <State of={of} />
      </div>
      <Island make={(place) => {
        place.append(of.timeline.element);
        return () => {};
      }} />
    </section>
  );
}

function State({ of }: { of: Transport }) {
  const progress = of.progress.value;
  const { words, wrong } = of.outcome.value;
  const complete = progress === 1;
  return (
    <div class="transport-state">
      <p class={`transport-line ${complete && wrong ? "fault" : ""}`} role="status">{complete ? words : ""}</p>
      <span class="transport-line">{complete || !of.replays.value ? "" : text.debrief.replaying(format.percent(progress, 0))}</span>{/* not read out at each step */}
      <progress class="transport-progress" max={1} value={progress} hidden={complete} aria-label={text.debrief.transport} />
    </div>
  );
}
