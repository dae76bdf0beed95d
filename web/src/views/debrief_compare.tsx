// A second session compared with the replayed one: in a viewport of its own, or overlaid on the first one's.
import { part } from "../api";
import type { App } from "../app";
import type { Dashboard } from "../dashboard";
import type { Value } from "../distribution";
import { explain } from "../explain";
import type { Feed } from "../live";
import { routeTo } from "../router";
import { Overlay } from "../scene/overlay";
import { FeedSource, type Source } from "../source";
import { Viewport } from "../viewport";
import { format, text } from "../text";
import { firstOf, STEPS, type Step } from "../playback";
import { toast } from "../kit/dialog";
import { button, dialog, empty, fill, h, loading, select, setText } from "../ui";
import { anotherFeed, RATE_HZ, sessionTitle, valuesOf, type Record, type SessionRow } from "./debrief";

export type Mode = "side" | "ghost";
const LISTED = 200;

interface Other {
  session: SessionRow;
  feed: Feed;
  source: FeedSource;
  values: readonly Value[];
  viewport: Viewport | undefined; // side by side
  overlay: Overlay | undefined; // as a ghost
  end(): void;
}

export class Comparison {
  readonly element = h("section", { class: "compare panel", hidden: true, "aria-label": text.debrief.comparedWith });
  /** Another one is there, or in step otherwise: `ahead` is its time less this one's; undefined: none. */
  onOther: (source: Source | undefined, ahead: number, values: readonly Value[]) => void = () => {};

  private other: Other | undefined;
  private mode: Mode = "side";
  private step: Step = "start";
  private time = 0;
  private readonly line = h("p", { class: "compare-line", role: "status" });
  private readonly share = h("span", { class: "compare-share number" });
  private readonly steps: HTMLSelectElement;
  private readonly caption = h("p", { class: "viewport-caption" }, text.debrief.this);
  private turn = 0;
  private readonly end: () => void;

  constructor(private readonly app: App, private readonly session: SessionRow, private readonly source: FeedSource, private readonly dashboard: Dashboard) {
    this.steps = select(STEPS.map((step) => [step, text.debrief.steps[step]!]), "start", { "aria-label": text.debrief.align, on: { change: () => {
      this.step = this.steps.value as Step;
      this.inStep();
    } } });
    this.end = source.onChange((change) => {
      if (change === "session") this.meet();
      if (change === "moment" || change === "progress") this.offerSteps();
    });
  }

  close(): void {
    this.end();
    this.turn++;
    this.drop();
  }

  setTime(time: number): void {
    this.time = time;
    this.other?.viewport?.setTime(time + this.ahead);
  }

  // ---- which one ---------------------------------------------------------------------------------------

  choose(): void {
    const words = text.debrief;
    const list = h("div", { class: "compare-list" }, loading());
    const shown = dialog(words.compareTitle, [h("p", { class: "quiet-text" }, words.compareHint), list]);
    shown.element.classList.add("wide");
    this.app.api.get<{ sessions: SessionRow[] }>("/sessions", { limit: LISTED }).then(({ sessions }) => {
      const others = sessions.filter(({ id }) => id !== this.session.id);
      others.sort((a, b) => Number(b.case === this.session.case) - Number(a.case === this.session.case));
      fill(list, others.length ? h("ul", {}, ...others.map((one) => this.choice(one, () => shown.close()))) : empty(words.compareNone));
      list.querySelector("button")?.focus();
    }, (error: unknown) => fill(list, empty(text.listBroken, explain(error))));
  }

  private choice(one: SessionRow, close: () => void): HTMLElement {
    const words = text.debrief;
    const same = one.case === this.session.case;
    return h("li", {}, h("button", { type: "button", class: "event compare-choice", on: { click: () => {
      close();
      void this.begin(one.id, this.mode);
    } } }, h("time", {}, format.time(one.start_utc_s * 1000)), h("span", { class: "compare-who" }, one.trainee ?? words.nobody),
      h("span", { class: "number quiet-text" }, one.end_utc_s === null ? format.none : format.clock(one.end_utc_s - one.start_utc_s)),
      h("span", { class: same ? "badge good" : "badge" }, same ? words.sameCase : words.onOtherCase(one.case))));
  }

  /** Puts another session beside this one. */
  async begin(id: string, mode: Mode): Promise<void> {
    const mine = ++this.turn;
    this.drop();
    this.mode = mode;
    let record: Record;
    try {
      record = await this.app.api.get<Record>(`/sessions/${part(id)}`);
    } catch (error) {
      toast(explain(error), "fault");
      return;
    }
    if (mine !== this.turn) return;
    this.wanted = record;
    this.remember();
    this.meet();
  }
  private wanted: Record | undefined;

  // Once this session's case is known: it is replayed on that.
  private meet(): void {
    const here = this.source.session;
    if (!this.wanted || !here || this.other) return;
    const { session, results } = this.wanted;
    const feed = anotherFeed(this.app);
    const source = FeedSource.recorded(feed, session.id, RATE_HZ, session.case === here.caseName ? "" : here.caseName);
    const other: Other = { session, feed, source, values: valuesOf(results), viewport: undefined, overlay: undefined, end: () => {} };
    const end = source.onChange((change) => {
      if (change !== "moment") this.showLine();
      if (change === "moment" || change === "progress") this.offerSteps();
      if (change === "moment") other.overlay && this.dashboard.viewport.draw();
    });
    other.end = () => {
      end();
      source.close();
    };
    this.other = other;
    this.showBar();
    this.setMode(this.mode);
  }

  private drop(): void {
    this.wanted = undefined;
    if (!this.other) return;
    this.setMode(undefined);
    this.other.end();
    this.other = undefined;
    this.element.hidden = true;
    this.dashboard.setOther(undefined);
    this.onOther(undefined, 0, []);
  }

  private remember(): void {
    const { wanted } = this;
    history.replaceState(null, "", routeTo("session", [this.session.id], { with: wanted?.session.id ?? "", as: wanted && this.mode === "ghost" ? "ghost" : "" }));
  }

  // ---- in step -------------------------------------------------------------------------------------------

  private get ahead(): number {
    const { other } = this;
    if (!other) return 0;
    const here = firstOf(this.step, this.source.history, this.source.events);
    const there = firstOf(this.step, other.source.history, other.source.events);
    return here === undefined || there === undefined ? 0 : there - here;
  }

  private inStep(): void {
    const { other, ahead } = this;
    if (!other) return;
    if (other.overlay) other.overlay.ahead = ahead;
    this.dashboard.setOther(other.source, ahead);
    this.onOther(other.source, ahead, other.values);
    this.setTime(this.time);
    this.dashboard.viewport.draw();
  }

  // Only what happened in both can bring them into step.
  private offerSteps(): void {
    const { other } = this;
    if (!other) return;
    for (const option of this.steps.options) {
      const both = [this.source, other.source].every(({ history: past, events }) => firstOf(option.value as Step, past, events) !== undefined);
      if (option.disabled !== !both) option.disabled = !both;
    }
    const { ahead } = this;
    if (ahead !== this.aheadShown) this.inStep();
    this.aheadShown = ahead;
  }
  private aheadShown = 0;

  // ---- how it is shown -----------------------------------------------------------------------------------

  private showBar(): void {
    const words = text.debrief;
    const { session } = this.other!;
    const modes = (["side", "ghost"] as Mode[]).map((mode) => {
      const input = h("input", { type: "radio", name: "compare-mode", value: mode, on: { change: () => {
        this.setMode(mode);
        this.remember();
      } } });
      input.checked = mode === this.mode;
      return h("label", { class: "choice" }, input, h("span", {}, words.modes[mode]));
    });
    fill(this.element, h("p", { class: "compare-name" }, h("i", { class: "other-key", "aria-hidden": "true" }), `${words.comparedWith} `,
      h("a", { href: routeTo("session", [session.id]) }, sessionTitle(session))),
      h("fieldset", { class: "segments" }, h("legend", { class: "unseen" }, words.mode), ...modes),
      h("label", { class: "compare-align" }, h("span", {}, words.align), this.steps), this.share, this.line,
      button(words.endCompare, () => {
        this.drop();
        this.remember();
      }, { kind: "quiet" }));
    this.element.hidden = false;
    this.showLine();
  }

  private showLine(): void {
    const { other } = this;
    if (!other) return;
    const words = text.debrief;
    const { progress, trouble, session: replayed } = other.source;
    const own = other.session.case;
    const here = this.source.session?.caseName ?? "";
    const parts = [
      trouble ? words.otherTrouble(trouble) : "",
      own !== here ? words.carried(own, here) : "", this.mode === "ghost" ? words.ghostHint : "",
    ];
    setText(this.share, progress < 1 && !trouble ? words.otherLoading(format.percent(replayed ? progress : 0, 0)) : "");
    setText(this.line, parts.filter((words) => words !== "").join(" "));
  }

  // undefined: not at all any more.
  private setMode(mode: Mode | undefined): void {
    const other = this.other!;
    other.viewport?.close();
    other.viewport?.element.remove();
    other.viewport = undefined;
    this.dashboard.viewport.setOverlay(undefined);
    other.overlay?.dispose();
    other.overlay = undefined;
    this.caption.remove();
    this.dashboard.viewport.onCamera = () => {};
    if (!mode) return;
    this.mode = mode;
    if (mode === "ghost") {
      other.overlay = new Overlay(other.source.history);
      this.dashboard.viewport.setOverlay(other.overlay);
    } else this.addViewport(other);
    this.showLine();
    this.inStep();
  }

  private addViewport(other: Other): void {
    const viewport = new Viewport(other.source, text.debrief.otherScene);
    other.viewport = viewport;
    viewport.element.classList.add("other");
    viewport.element.append(h("p", { class: "viewport-caption" }, sessionTitle(other.session)));
    this.dashboard.viewport.element.append(this.caption);
    this.dashboard.viewports.append(viewport.element);
    twins(this.dashboard.viewport, viewport);
  }
}

// Both are seen from the same camera: the one that was touched last leads.
function twins(a: Viewport, b: Viewport): void {
  let leader = a;
  let met = false; // the second one has looked from where the first one does
  for (const [viewport, follower] of [[a, b], [b, a]] as const) {
    for (const kind of ["pointerdown", "wheel", "keydown", "click"]) viewport.element.addEventListener(kind, () => (leader = viewport), { capture: true, passive: true });
    viewport.onCamera = (camera) => {
      if (leader === viewport) follower.setCamera(camera);
      else if (!met) {
        met = true;
        follower.draw();
      }
    };
  }
}
