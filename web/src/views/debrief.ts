// #/session/ID: a recorded session, replayed; ?with=ID: beside another one.
import type { App, View } from "../app";
import { ApiError, part } from "../api";
import { Dashboard } from "../dashboard";
import { hasOthers, strips, type Distribution, type Value } from "../distribution";
import { explain } from "../explain";
import { labelOf, type Groups } from "../groups";
import { browserEnvironment, Feed } from "../live";
import { routeTo } from "../router";
import { FeedSource, resectionsAt } from "../source";
import { format, text } from "../text";
import { broken, button, empty, fill, h, icon, loading, select, setClass, setText } from "../ui";
import { debriefAttempts, type DebriefAttempts } from "./debrief_attempts";
import { Comparison } from "./debrief_compare";
import { Transport } from "./debrief_transport";

export const RATE_HZ = 60;
const VOLUME_MM3 = 0.1; // that a page's mesh may differ by from the record

export interface SessionRow {
  id: string;
  station: string;
  trainee: string | null;
  case: string;
  start_utc_s: number;
  end_utc_s: number | null;
  state: string;
  steps: number;
  missing: number;
}

interface Result {
  metric: string;
  subject: string;
  version: number;
  unit: string;
  value: number | null;
  below_floor: boolean;
}

export interface Record {
  session: SessionRow;
  results: Result[];
}

export function valuesOf(results: readonly Result[]): Value[] {
  return results.map(({ metric, subject, version, unit, value, below_floor }) =>
    ({ name: metric, subject, version, unit, value: value ?? NaN, belowFloor: below_floor }));
}

/** A connection of its own for one more replay. */
export function anotherFeed(app: App): Feed {
  return new Feed(browserEnvironment(async () => {
    await app.api.get("/me");
    return true;
  }));
}

export const sessionTitle = ({ trainee, start_utc_s: start }: SessionRow): string =>
  text.debrief.title(trainee ?? text.debrief.nobody, format.time(start * 1000));

export const debrief: View = (root, route, app) => {
  const id = route.args[0] ?? "";
  app.title(text.debrief.sessions);
  let replay: Replay | undefined;
  let ended = false;
  root.append(loading(text.debrief.waiting));
  const begin = (): void => {
    app.api.get<Record>(`/sessions/${part(id)}`).then(
      (record) => {
        if (ended) return;
        root.replaceChildren();
        replay = new Replay(root, record, route.query, app);
      },
      (error: unknown) => {
        if (ended) return;
        const gone = error instanceof ApiError && (error.status === 404 || error.status === 400);
        fill(root, gone ? empty(text.debrief.noSession, text.debrief.noSessionHint, h("a", { class: "button", href: routeTo("sessions") }, text.debrief.sessions))
          : broken(text.listBroken, explain(error), begin));
      });
  };
  begin();
  return () => {
    ended = true;
    replay?.close();
  };
};

class Replay {
  private readonly source: FeedSource;
  private readonly metrics: Metrics;
  private readonly dashboard: Dashboard;
  private readonly transport: Transport;
  private readonly comparison: Comparison;
  private readonly attempts: DebriefAttempts;
  private readonly cover = h("div", { class: "station-waiting" }, loading(text.debrief.waiting));
  private readonly notices = h("div", { class: "notices", role: "status" });
  private noticed = "";
  private readonly ends: (() => void)[];

  constructor(private readonly root: HTMLElement, private readonly record: Record, query: URLSearchParams, private readonly app: App) {
    const { session } = record;
    app.title(sessionTitle(session));
    this.source = FeedSource.recorded(app.feed, session.id, RATE_HZ);
    this.metrics = new Metrics(app, record, () => this.source.session?.groups);
    this.dashboard = new Dashboard(this.source, { onTime: (time) => this.transport.seek(time ?? 0), metrics: (replayed) => this.metrics.draw(replayed) });
    this.transport = new Transport(this.source);
    this.comparison = new Comparison(app, session, this.source, this.dashboard);
    this.attempts = debriefAttempts(app, session.id, this.source, Number(query.get("attempt")) || 0, (time) => this.transport.seek(time));
    root.append(head(session, this.metrics, this.comparison), this.notices, this.comparison.element, this.transport.element, this.attempts.element,
      h("div", { class: "station-main" }, this.dashboard.element, this.attempts.scope, this.cover));
    this.ends = this.listen();
    const other = query.get("with");
    if (other) void this.comparison.begin(other, query.get("as") === "ghost" ? "ghost" : "side");
    this.transport.toEnd();
    this.show();
  }

  close(): void {
    for (const end of this.ends) end();
    for (const open of [this.attempts, this.comparison, this.transport, this.dashboard, this.source]) open.close();
  }

  private listen(): (() => void)[] {
    const { source, transport, comparison } = this;
    transport.onTime = (time) => {
      this.dashboard.setTime(time);
      comparison.setTime(time);
      this.attempts.setTime(time);
    };
    comparison.onOther = (other, ahead, values) => {
      transport.setOther(other, ahead);
      this.metrics.setOther(values);
    };
    const show = (): void => this.show();
    return [
      source.onChange((change) => {
        if (change === "session") this.metrics.refresh(); // groups have their labels
        if (change === "moment" && !this.cover.hidden) show();
        if (change === "progress" && source.progress === 1) transport.say(checked(source));
        if (change !== "moment") show();
      }),
      this.app.feed.onLink(show),
    ];
  }

  private show(): void {
    const { cover, source } = this;
    cover.hidden = source.history.count > 0;
    this.dashboard.element.inert = !cover.hidden;
    if (!cover.hidden) showCover(cover, source, this.app.feed, this.metrics);
    setClass(this.root, "nothing", !cover.hidden && source.progress === 1);
    const found = noticesOf(this.record.session, source);
    if (found.join("\n") === this.noticed) return;
    this.noticed = found.join("\n");
    fill(this.notices, ...found.map((words) => h("p", { class: "notice" }, icon("act"), words)));
  }
}

function head(session: SessionRow, metrics: Metrics, comparison: Comparison): HTMLElement {
  const words = text.debrief;
  const base = `/api/v1/sessions/${part(session.id)}`;
  const report = h("a", { class: "button", href: `${base}/report`, target: "_blank", rel: "noopener" }, words.report);
  metrics.onCourse = (course) => report.setAttribute("href", `${base}/report${course ? `?course=${part(course)}` : ""}`);
  const length = session.end_utc_s === null ? "" : format.clock(session.end_utc_s - session.start_utc_s);
  return h("header", { class: "station-head" },
    h("div", { class: "station-name" }, h("a", { href: routeTo("sessions"), class: "button quiet back" }, icon("back"), words.sessions),
      h("h1", {}, sessionTitle(session)), session.state !== "closed" && h("span", { class: `badge ${text.sessions.kinds[session.state] ?? ""}` }, text.sessions.states[session.state] ?? session.state)),
    h("p", { class: "about quiet-text" }, [session.case, session.station, length].filter((one) => one !== "").join(" · ")),
    h("div", { class: "head-actions" }, button(words.compare, () => comparison.choose()), report,
      h("a", { class: "button", href: `${base}/trace`, download: true }, icon("file"), words.trace)));
}

// Nothing can be played, still or for good: what was measured is known all the same.
function showCover(cover: HTMLElement, source: FeedSource, feed: Feed, metrics: Metrics): void {
  const words = text.debrief;
  const figures = (): HTMLElement => h("div", { class: "cover-metrics panel" }, metrics.draw([]));
  const over = source.progress === 1;
  if (source.refused) fill(cover, empty(words.noSession, words.noSessionHint));
  else if (over && source.trouble) fill(cover, empty(words.noReplay, source.trouble, button(text.tryAgain, () => location.reload())), figures());
  else if (over) fill(cover, empty(words.noMoments, words.noMomentsHint), figures());
  else if (feed.lostMs() !== undefined) fill(cover, empty(text.wall.unreachable, text.station.comesBack));
  else fill(cover, loading(source.trouble || words.waiting));
}

function noticesOf(session: SessionRow, source: FeedSource): string[] {
  const words = text.debrief;
  const found: string[] = [];
  if (session.state === "interrupted") found.push(words.interrupted);
  if (session.state === "open") found.push(words.running);
  if (source.trouble && source.history.count) found.push(words.damaged(source.trouble));
  else if (session.missing) found.push(words.missing(session.missing));
  return found;
}

// Whether the meshes that the page has cut are those of the record.
function checked(source: FeedSource): { words: string; wrong: boolean } {
  if (source.trouble) return { words: text.debrief.readable, wrong: false };
  let seen = false;
  for (const [group, recorded] of resectionsAt(source, Infinity)) {
    const mesh = source.tissue(group, Infinity);
    if (!mesh) return { words: text.debrief.noMesh(labelOf(source.session?.groups, group)), wrong: true };
    seen = true;
    const volume = mesh.volume();
    if (Math.abs(volume - recorded.volumeMm3) <= VOLUME_MM3) continue;
    return { words: text.debrief.volumeDiffers(labelOf(source.session?.groups, group), format.number(volume, 1), format.number(recorded.volumeMm3, 1)), wrong: true };
  }
  return { words: seen ? text.debrief.volumeAgrees : text.debrief.whole, wrong: false };
}

// ---- metrics beside others' ------------------------------------------------------------------------------

class Metrics {
  onCourse: (course: string) => void = () => {};
  private readonly body = h("div", {});
  private readonly hint = h("p", { class: "hint" });
  private readonly select: HTMLSelectElement;
  private readonly element: HTMLElement;
  private distributions: Distribution[] = [];
  private other: readonly Value[] = [];
  private replayed: readonly Value[] = [];
  private turn = 0;

  constructor(private readonly app: App, private readonly record: Record, private readonly groups: () => Groups | undefined) {
    const trainee = app.account?.role === "trainee";
    this.select = select(trainee ? [] : [["", text.debrief.everybody]], "", { "aria-label": text.debrief.besides, on: { change: () => void this.load() } });
    this.element = h("div", { class: "beside" }, h("label", { class: "beside-choice" }, h("span", {}, text.debrief.besides), this.select),
      this.hint, this.body);
    void this.begin(trainee);
  }

  /** `replayed` are the replay's own, for a session whose end was not recorded. */
  draw(replayed: readonly Value[]): HTMLElement {
    this.replayed = replayed;
    this.refresh();
    return this.element;
  }

  setOther(values: readonly Value[]): void {
    this.other = values;
    this.refresh();
  }

  refresh(): void {
    const recorded = valuesOf(this.record.results).filter(({ name }) => name !== "depth_time");
    const values = recorded.length ? recorded : this.replayed;
    setText(this.hint, hasOthers(values, this.distributions) ? text.debrief.stripsHint : text.debrief.allAlone);
    fill(this.body, strips(values, { distributions: this.distributions, other: this.other, groups: this.groups() }));
  }

  private async begin(trainee: boolean): Promise<void> {
    const courses = trainee ? await this.app.api.get<{ courses: string[] }>("/me").then((me) => me.courses, () => [])
      : await this.app.api.get<{ courses: { name: string }[] }>("/courses").then((all) => all.courses.map(({ name }) => name), () => []);
    this.select.append(...courses.map((name) => h("option", { value: name }, text.debrief.course(name))));
    this.select.parentElement!.hidden = this.select.options.length < 2;
    if (this.select.options.length) await this.load();
  }

  private async load(): Promise<void> {
    const mine = ++this.turn;
    const course = this.select.value;
    this.onCourse(course);
    const found = await this.app.api.get<{ distributions: Distribution[] }>("/distributions", { case: this.record.session.case, course })
      .then((answer) => answer.distributions, (): Distribution[] => []);
    if (mine !== this.turn) return;
    this.distributions = found;
    this.refresh();
  }
}
