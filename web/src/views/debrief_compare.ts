// Another session beside the one that is replayed: in a picture of its own, or as a ghost in this one's.
import { part } from "../api";
import type { App } from "../app";
import type { Cockpit } from "../cockpit";
import type { Value } from "../distribution";
import type { Feed } from "../live";
import { routeTo } from "../router";
import { Companion } from "../scene/companion";
import { FeedSource, type Source } from "../source";
import { Stage } from "../stage";
import { format, text } from "../text";
import { firstOf, STEPS, type Step } from "../timeline";
import { button, dialog, empty, explain, fill, h, loading, select, setText, toast } from "../ui";
import { anotherFeed, RATE_HZ, sessionTitle, valuesOf, type Record, type SessionRow } from "./debrief";

export type Mode = "side" | "ghost";
const LISTED = 200;

interface Other {
  session: SessionRow;
  feed: Feed;
  source: FeedSource;
  values: readonly Value[];
  stage: Stage | undefined; // side by side
  companion: Companion | undefined; // as a ghost
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
  private readonly caption = h("p", { class: "stage-caption" }, text.debrief.this);
  private turn = 0;
  private readonly end: () => void;

  constructor(private readonly app: App, private readonly session: SessionRow, private readonly source: FeedSource, private readonly cockpit: Cockpit) {
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
    this.other?.stage?.setTime(time + this.ahead);
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
    const other: Other = { session, feed, source, values: valuesOf(results), stage: undefined, companion: undefined, end: () => {} };
    const end = source.onChange((change) => {
      if (change !== "moment") this.showLine();
      if (change === "moment" || change === "progress") this.offerSteps();
      if (change === "moment") other.companion && this.cockpit.stage.draw();
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
    this.cockpit.setOther(undefined);
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
    const here = firstOf(this.step, this.source.history, this.source.marks);
    const there = firstOf(this.step, other.source.history, other.source.marks);
    return here === undefined || there === undefined ? 0 : there - here;
  }

  private inStep(): void {
    const { other, ahead } = this;
    if (!other) return;
    if (other.companion) other.companion.ahead = ahead;
    this.cockpit.setOther(other.source, ahead);
    this.onOther(other.source, ahead, other.values);
    this.setTime(this.time);
    this.cockpit.stage.draw();
  }

  // Only what happened in both can bring them into step.
  private offerSteps(): void {
    const { other } = this;
    if (!other) return;
    for (const option of this.steps.options) {
      const both = [this.source, other.source].every(({ history: past, marks }) => firstOf(option.value as Step, past, marks) !== undefined);
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
    other.stage?.close();
    other.stage?.element.remove();
    other.stage = undefined;
    this.cockpit.stage.setCompanion(undefined);
    other.companion?.dispose();
    other.companion = undefined;
    this.caption.remove();
    this.cockpit.stage.onLook = () => {};
    if (!mode) return;
    this.mode = mode;
    if (mode === "ghost") {
      other.companion = new Companion(other.source.history);
      this.cockpit.stage.setCompanion(other.companion);
    } else this.addStage(other);
    this.showLine();
    this.inStep();
  }

  private addStage(other: Other): void {
    const stage = new Stage(other.source, text.debrief.otherScene);
    other.stage = stage;
    stage.element.classList.add("other");
    stage.element.append(h("p", { class: "stage-caption" }, sessionTitle(other.session)));
    this.cockpit.stage.element.append(this.caption);
    this.cockpit.stages.append(stage.element);
    twins(this.cockpit.stage, stage);
  }
}

// Both are seen from the same place: the one that was touched last leads.
function twins(a: Stage, b: Stage): void {
  let leader = a;
  let met = false; // the second one has looked from where the first one does
  for (const [stage, follower] of [[a, b], [b, a]] as const) {
    for (const kind of ["pointerdown", "wheel", "keydown", "click"]) stage.element.addEventListener(kind, () => (leader = stage), { capture: true, passive: true });
    stage.onLook = (place) => {
      if (leader === stage) follower.look(place);
      else if (!met) {
        met = true;
        follower.draw();
      }
    };
  }
}
