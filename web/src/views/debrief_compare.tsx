// A second session compared with the replayed one: in a viewport of its own, or overlaid on the first one's.
import { signal } from "@preact/signals";
import { part } from "../api";
import type { App } from "../app";
import type { Dashboard } from "../dashboard";
import type { Value } from "../distribution";
import { explain } from "../explain";
import { Await, Button, Empty, openDialog, toast, useLoaded } from "../kit";
import type { Feed } from "../live";
import { routeTo } from "../router";
import { Overlay } from "../scene/overlay";
import { FeedSource, type Source } from "../source";
import { Viewport } from "../viewport";
import { format, text } from "../text";
import { firstOf, STEPS, type Step } from "../playback";
import { h } from "../ui";
import { anotherFeed, RATE_HZ, sessionTitle, valuesOf, type Record, type SessionRow } from "./debrief";

export type Mode = "side" | "ghost";
const MODES: readonly Mode[] = ["side", "ghost"];
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
  /** Another one is there, or in step otherwise: `ahead` is its time less this one's; undefined: none. */
  onOther: (source: Source | undefined, ahead: number, values: readonly Value[]) => void = () => {};

  readonly compared = signal<SessionRow | undefined>(undefined); // with this one
  readonly mode = signal<Mode>("side");
  readonly step = signal<Step>("start");
  readonly offered = signal<readonly Step[]>([]); // that happened in both
  readonly share = signal(""); // of the other that is here
  readonly line = signal("");
  private other: Other | undefined;
  private time = 0;
  private aheadShown = 0;
  private wanted: Record | undefined;
  private readonly caption = h("p", { class: "viewport-caption" }, text.debrief.this);
  private turn = 0;
  private readonly end: () => void;

  constructor(readonly app: App, readonly session: SessionRow, private readonly source: FeedSource, private readonly dashboard: Dashboard) {
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
    openDialog({ title: text.debrief.compareTitle, wide: true, body: (close) => <Choice of={this} chosen={(id) => {
      close();
      void this.begin(id, this.mode.peek());
    }} /> });
  }

  leave(): void {
    this.drop();
    this.remember();
  }

  /** Puts another session beside this one. */
  async begin(id: string, mode: Mode): Promise<void> {
    const mine = ++this.turn;
    this.drop();
    this.mode.value = mode;
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
    this.compared.value = session;
    this.showAs(this.mode.peek());
  }

  private drop(): void {
    this.wanted = undefined;
    if (!this.other) return;
    this.showAs(undefined);
    this.other.end();
    this.other = undefined;
    this.compared.value = undefined;
    this.dashboard.setOther(undefined);
    this.onOther(undefined, 0, []);
  }

  private remember(): void {
    const { wanted } = this;
    history.replaceState(null, "", routeTo("session", [this.session.id], { with: wanted?.session.id ?? "", as: wanted && this.mode.peek() === "ghost" ? "ghost" : "" }));
  }

  // ---- in step -------------------------------------------------------------------------------------------

  private get ahead(): number {
    const { other } = this;
    if (!other) return 0;
    const here = firstOf(this.step.peek(), this.source.history, this.source.events);
    const there = firstOf(this.step.peek(), other.source.history, other.source.events);
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
    const both = STEPS.filter((step) => [this.source, other.source].every(({ history: past, events }) => firstOf(step, past, events) !== undefined));
    if (both.join() !== this.offered.peek().join()) this.offered.value = both;
    const { ahead } = this;
    if (ahead !== this.aheadShown) this.inStep();
    this.aheadShown = ahead;
  }

  // ---- how it is shown -----------------------------------------------------------------------------------

  setMode(mode: Mode): void {
    this.showAs(mode);
    this.remember();
  }

  setStep(step: Step): void {
    this.step.value = step;
    this.inStep();
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
      own !== here ? words.carried(own, here) : "", this.mode.peek() === "ghost" ? words.ghostHint : "",
    ];
    this.share.value = progress < 1 && !trouble ? words.otherLoading(format.percent(replayed ? progress : 0, 0)) : "";
    this.line.value = parts.filter((words) => words !== "").join(" ");
  }

  // undefined: not at all any more.
  private showAs(mode: Mode | undefined): void {
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
    this.mode.value = mode;
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

/** Who is compared, and how; nothing where nobody is. */
export function CompareBar({ of }: { of: Comparison }) {
  const words = text.debrief;
  const session = of.compared.value;
  if (!session) return null;
  return (
    <section class="compare panel" aria-label={words.comparedWith}>
      <p class="compare-name"><i class="other-key" aria-hidden="true" />{words.comparedWith} <a href={routeTo("session", [session.id])}>{sessionTitle(session)}</a></p>
      <fieldset class="segments"><legend class="unseen">{words.mode}</legend>
        {MODES.map((mode) => (
          <label key={mode} class="choice"><input type="radio" name="compare-mode" value={mode} checked={mode === of.mode.value} onChange={() => of.setMode(mode)} /><span>{words.modes[mode]}</span></label>))}
      </fieldset>
      <label class="compare-align"><span>{words.align}</span>
        <select aria-label={words.align} value={of.step.value} onChange={(event) => of.setStep(event.currentTarget.value as Step)}>
          {STEPS.map((step) => <option key={step} value={step} disabled={!of.offered.value.includes(step)}>{words.steps[step]}</option>)}
        </select></label>
      <span class="compare-share number">{of.share}</span>
      <p class="compare-line" role="status">{of.line}</p>
      <Button kind="quiet" onClick={() => of.leave()}>{words.endCompare}</Button>
    </section>
  );
}

// Those on the same case first.
function Choice({ of: { app, session: here }, chosen }: { of: Comparison; chosen: (id: string) => void }) {
  const words = text.debrief;
  const loaded = useLoaded(async () => {
    const { sessions } = await app.api.get<{ sessions: SessionRow[] }>("/sessions", { limit: LISTED });
    return sessions.filter(({ id }) => id !== here.id).sort((a, b) => Number(b.case === here.case) - Number(a.case === here.case));
  });
  return <>
    <p class="quiet-text">{words.compareHint}</p>
    <div class="compare-list"><Await of={loaded}>{(others) => others.length === 0 ? <Empty title={words.compareNone} /> : (
      <ul>{others.map((one) => (
        <li key={one.id}><button type="button" class="event compare-choice" onClick={() => chosen(one.id)}>
          <time>{format.time(one.start_utc_s * 1000)}</time><span class="compare-who">{one.trainee ?? words.nobody}</span>
          <span class="number quiet-text">{one.end_utc_s === null ? format.none : format.clock(one.end_utc_s - one.start_utc_s)}</span>
          {one.case === here.case ? <span class="badge good">{words.sameCase}</span> : <span class="badge">{words.onOtherCase(one.case)}</span>}
        </button></li>))}</ul>)}</Await></div>
  </>;
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
