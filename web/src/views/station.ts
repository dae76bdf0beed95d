// #/station/NAME: one station's session, as it happens.
import { SessionState, type LiveSession } from "wire";
import type { App, View } from "../app";
import { Dashboard } from "../dashboard";
import { STATE } from "../history";
import { QUIET_MS } from "../live";
import { routeTo } from "../router";
import { FeedSource, markerAt } from "../source";
import { format, text } from "../text";
import type { IconName } from "../kit/icon";
import { announcer, empty, everySecond, fill, h, icon, loading, setClass, setText } from "../ui";
import { SessionControls } from "./session_controls";

const RATE_HZ = 30;

const STATES: Record<SessionState, [icon: IconName, words: keyof typeof text.wall.statuses]> = {
  [SessionState.WAITING]: ["waiting", "waiting"],
  [SessionState.RUNNING]: ["running", "running"],
  [SessionState.PAUSED]: ["paused", "paused"],
  [SessionState.CLOSED]: ["closed", "closed"],
};
const idOf = ({ id }: LiveSession): string => [...id].map((byte) => byte.toString(16).padStart(2, "0")).join("");
const STALE: [icon: IconName, words: string] = ["gone", text.station.unknown];

export const station: View = (root, route, app) => {
  const page = new StationPage(root, route.args[0] ?? "", app);
  return () => page.close();
};

class StationPage {
  private readonly source: FeedSource;
  private readonly dashboard: Dashboard;
  private readonly controls: SessionControls | undefined; // of an instructor
  private readonly trainee: boolean;
  private readonly began: number;
  private heard = 0; // when the last moment came
  private readonly badge = h("span", { class: "badge state-badge" });
  private readonly clock = h("span", { class: "session-clock number" });
  private readonly about = h("p", { class: "about quiet-text" });
  private readonly debrief = h("a", { class: "button", hidden: true }, text.station.debrief); // of the session that ended here
  private readonly stale = h("p", { class: "stale badge now" });
  private readonly note = h("p", { class: "badge act", role: "status" });
  private readonly waiting: HTMLElement;
  private readonly tell = announcer();
  private readonly ends: (() => void)[];

  constructor(private readonly root: HTMLElement, private readonly name: string, private readonly app: App) {
    app.title(text.station.title(name));
    this.trainee = app.account?.role === "trainee";
    this.began = app.feed.now();
    this.source = FeedSource.live(app.feed, name, RATE_HZ);
    this.dashboard = new Dashboard(this.source, { onMarker: (marker) => this.controls?.placeMarker(marker) });
    this.controls = app.account?.role === "instructor" ? this.makeControls() : undefined;
    this.waiting = h("div", { class: "station-waiting" }, loading(text.station.waiting(name)));
    root.append(this.head(), ...(this.controls ? [this.controls.element] : []), h("div", { class: "station-main" }, this.dashboard.element, this.waiting));
    this.ends = this.listen();
  }

  close(): void {
    for (const end of this.ends) end();
    this.dashboard.close();
    this.source.close();
  }

  private makeControls(): SessionControls {
    const { source } = this;
    const controls = new SessionControls(this.app, {
      station: this.name,
      case: () => source.session?.caseName ?? "",
      strength: () => source.session?.strength ?? 1,
      trainee: () => source.session?.trainee ?? "",
    });
    controls.onPicking = (on) => {
      this.dashboard.viewport.picking = on;
      setClass(this.root, "picking", on);
    };
    return controls;
  }

  private head(): HTMLElement {
    const { name } = this;
    return h("header", { class: "station-head" },
      h("div", { class: "station-name" }, this.back("button quiet back", icon("back")), h("h1", {}, name), this.badge, this.clock, this.stale, this.note),
      this.about, this.debrief, h("a", { class: "button", href: routeTo("scope", [name]) }, text.station.scope));
  }

  private back(kind: string, ...sign: Element[]): HTMLElement {
    const [href, words] = this.trainee ? ["#/sessions", text.views.sessions] : ["#/wall", text.station.wall];
    return h("a", { href, class: kind }, ...sign, words);
  }

  private listen(): (() => void)[] {
    const { feed } = this.app;
    const show = (): void => this.show();
    const key = (event: KeyboardEvent): void => this.key(event);
    document.addEventListener("keydown", key);
    return [
      this.source.onChange((change) => {
        if (change === "moment") this.heard = feed.now();
        else show();
      }),
      everySecond(show),
      feed.onLink(show),
      () => document.removeEventListener("keydown", key),
    ];
  }

  private get state(): SessionState | undefined {
    const { history } = this.source;
    return history.count ? history.value(history.count - 1, STATE) : undefined;
  }

  /** For how long nothing is heard, and in which words; undefined: what is shown is how it is. */
  private staleness(): string | undefined {
    const { feed } = this.app;
    const lost = feed.lostMs();
    if (lost !== undefined) return text.station.lost(lost);
    const age = this.heard && this.source.history.count ? feed.now() - this.heard : 0;
    return age >= QUIET_MS && this.state !== SessionState.CLOSED ? text.station.stale(age) : undefined;
  }

  private show(): void {
    const { source, controls } = this;
    const { session } = source;
    const old = this.staleness();
    const reachable = this.app.feed.lostMs() === undefined;
    this.showBadge(old !== undefined);
    setText(this.clock, source.history.count ? format.clock(source.history.end) : "");
    setText(this.about, session ? [session.trainee || text.station.nobody, session.caseName, text.station.shape(session.strength)].join(" · ") : "");
    this.debrief.hidden = !session || this.state !== SessionState.CLOSED;
    if (session) this.debrief.href = routeTo("session", [idOf(session)]);
    setText(this.stale, old ?? "");
    setText(this.note, source.note);
    this.note.hidden = !source.note;
    this.tell(old !== undefined && reachable ? "quiet" : "", old ?? text.link.open); // the frame announces a silent server
    setClass(this.root, "old", old !== undefined);
    controls?.setReachable(reachable);
    controls?.setState(this.state);
    controls?.setMarker(markerAt(source, Infinity));
    this.showInstead();
  }

  private showBadge(old: boolean): void {
    const { badge, state } = this;
    const key = old ? "old" : String(state);
    if (badge.dataset.state === key) return;
    badge.dataset.state = key;
    const [sign, words] = STATES[state ?? SessionState.WAITING];
    fill(badge, ...(old ? [icon(STALE[0]), STALE[1]] : [icon(sign), text.wall.statuses[words]]));
  }

  private showInstead(): void {
    const { source, waiting } = this;
    waiting.hidden = source.session !== undefined || source.history.count > 0;
    this.dashboard.element.inert = !waiting.hidden;
    this.badge.hidden = source.refused;
    if (waiting.hidden) return;
    const kind = this.missing();
    if (waiting.dataset.kind === kind) return;
    waiting.dataset.kind = kind;
    const words = text.station;
    const back = this.back("button");
    if (kind === "refused") fill(waiting, this.trainee ? empty(words.notYours, words.notYoursHint, back) : empty(words.notThere, source.trouble, back));
    else if (kind === "lost") fill(waiting, empty(text.wall.unreachable, words.comesBack));
    else if (kind === "none") fill(waiting, empty(words.noSession, source.trouble || words.noSessionHint));
    else fill(waiting, loading(words.waiting(this.name)));
  }

  /** Why there is nothing to show. */
  private missing(): "refused" | "lost" | "none" | "waiting" {
    const { feed } = this.app;
    if (this.source.refused) return "refused";
    if (feed.lostMs() !== undefined) return "lost";
    const late = feed.link.state === "open" && feed.now() - this.began > QUIET_MS;
    return this.source.trouble || late ? "none" : "waiting";
  }

  private key(event: KeyboardEvent): void {
    const { controls } = this;
    const { viewport } = this.dashboard;
    if (!controls || event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) return;
    if ((event.target as HTMLElement).matches("input, select, textarea")) return;
    if (event.key === "t" && viewport.picking) controls.placeMarker(viewport.markerAtTip());
    else if (event.key === "Escape" && viewport.picking) controls.setPicking(false);
  }
}
