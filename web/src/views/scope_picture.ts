// What is on the scope's screen: the round picture, words and a legend over it, or words instead of it.
import { createElement, render } from "preact";
import { Legend } from "../legend";
import { MAPS, type MapName } from "../scene/colours";
import { text } from "../text";
import { fill, h, setClass, setText } from "../ui";

export type Sign = "stale" | "state" | "note" | "marker" | "source";

export class Picture {
  canvas = h("canvas", { class: "scope-canvas", role: "img", "aria-label": text.scope.picture });
  side = 0;
  onSide: (side: number) => void = () => {};
  private readonly round: HTMLElement;
  private readonly notch = h("i", { class: "scope-notch", "aria-hidden": "true" });
  private readonly state = h("div", { class: "scope-state" });
  private readonly timing = h("p", { class: "scope-timing number", hidden: true });
  private readonly keys = h("details", { class: "scope-keys" }, h("summary", {}, text.scope.keysTitle),
    h("dl", {}, ...text.scope.keys.map(([key, what]) => h("div", {}, h("dt", {}, key), h("dd", {}, what)))));
  private readonly legend = h("div", {});
  private readonly signs: Record<Sign, HTMLElement>;
  private readonly size: ResizeObserver;
  private told: HTMLElement | undefined;
  private frames: number[] = [];
  private toldAt = 0;

  constructor(private readonly root: HTMLElement, name: string, heading: "h1" | "h3" = "h1") {
    const sign = (kind: Sign): HTMLElement => h("p", { class: `scope-sign ${kind}`, role: kind === "stale" ? undefined : "status" }); // that ticks
    this.signs = { stale: sign("stale"), state: sign("state"), note: sign("note"), marker: sign("marker"), source: sign("source") };
    this.round = h("div", { class: "scope-round" }, this.canvas, h("i", { class: "scope-edge", "aria-hidden": "true" }), this.notch);
    root.append(this.round, this.state, h("div", { class: "scope-top" }, this.signs.stale, this.signs.state),
      h("div", { class: "scope-bottom" }, this.signs.marker, this.signs.note), h("div", { class: "scope-corner" }, this.signs.source, this.timing, this.keys), this.legend,
      h(heading, { class: "unseen" }, name));
    this.size = new ResizeObserver(() => this.measure());
    this.size.observe(root);
    this.measure();
  }

  close(): void {
    this.size.disconnect();
  }

  /** A canvas that no renderer has had. */
  fresh(): void {
    const next = this.canvas.cloneNode() as HTMLCanvasElement;
    this.canvas.replaceWith(next);
    this.canvas = next;
  }

  private measure(): void {
    const side = Math.floor(Math.min(this.root.clientWidth, this.root.clientHeight));
    if (side === this.side || side <= 0) return;
    this.side = side;
    this.round.style.width = this.round.style.height = `${side}px`;
    this.onSide(side);
  }

  /** Instead of the picture; undefined: the picture. */
  say(what: HTMLElement | undefined): void {
    if (what === undefined && this.told === undefined) return;
    if (what && this.told?.textContent === what.textContent) return;
    this.told = what;
    fill(this.state, what);
    setClass(this.round, "dark", what !== undefined);
  }

  sign(kind: Sign, words: string): void {
    setText(this.signs[kind], words);
  }

  showLegend(map: MapName): void {
    render(createElement(Legend, { name: map, map: map === "none" ? undefined : MAPS[map] }), this.legend);
  }

  toggleKeys(): void {
    this.keys.open = !this.keys.open;
  }

  turnNotch(angle: number): void {
    this.notch.style.transform = `rotate(${angle}rad)`;
  }

  showTiming(on: boolean): void {
    this.timing.hidden = !on;
  }

  timed(ms: number, ageMs: number): void {
    if (this.timing.hidden || ms > 1000) return;
    this.frames.push(ms);
    const now = performance.now();
    if (now - this.toldAt < 500) return;
    const mean = this.frames.reduce((sum, one) => sum + one, 0) / this.frames.length;
    setText(this.timing, text.scope.frame(mean.toFixed(1), Math.max(...this.frames).toFixed(1), Math.max(0, ageMs).toFixed(1)));
    this.frames = [];
    this.toldAt = now;
  }
}
