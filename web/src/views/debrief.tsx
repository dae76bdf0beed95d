// #/session/ID: a recorded session, replayed; ?with=ID: beside another one.
import { signal } from "@preact/signals";
import { render, type VNode } from "preact";
import { useLayoutEffect } from "preact/hooks";
import type { App, View } from "../app";
import { ApiError, part } from "../api";
import { Dashboard } from "../dashboard";
import { hasOthers, Strips, type Distribution, type Value } from "../distribution";
import { explain } from "../explain";
import { labelOf, type Groups } from "../groups";
import { Badge, Broken, Button, Empty, Icon, Island, Loading, Select } from "../kit";
import { browserEnvironment, Feed } from "../live";
import { routeTo } from "../router";
import { FeedSource, resectionsAt } from "../source";
import { format, text } from "../text";
import { debriefAttempts, type DebriefAttempts } from "./debrief_attempts";
import { CompareBar, Comparison } from "./debrief_compare";
import { Transport, TransportBar } from "./debrief_transport";

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
  const words = text.debrief;
  const id = route.args[0] ?? "";
  app.title(text.views.sessionsOf(app.account?.role));
  let replay: Replay | undefined;
  let ended = false;
  const begin = (): void => {
    render(<Loading what={words.waiting} />, root);
    app.api.get<Record>(`/sessions/${part(id)}`).then(
      (record) => {
        if (ended) return;
        replay = new Replay(record, route.query, app);
        render(<ReplayPage of={replay} />, root);
      },
      (error: unknown) => {
        if (ended) return;
        const gone = error instanceof ApiError && (error.status === 404 || error.status === 400);
        render(gone ? <Empty title={words.noSession} hint={words.noSessionHint}><a class="button" href={routeTo("sessions")}>{text.views.sessionsOf(app.account?.role)}</a></Empty>
          : <Broken title={text.listBroken} hint={explain(error)} again={begin} />, root);
      });
  };
  begin();
  return () => {
    ended = true;
    render(null, root);
    replay?.close();
  };
};

class Replay {
  readonly source: FeedSource;
  readonly metrics: Metrics;
  readonly dashboard: Dashboard;
  readonly transport: Transport;
  readonly comparison: Comparison;
  readonly attempts: DebriefAttempts;
  readonly changes = signal(0); // of all but moments
  private readonly ends: (() => void)[];

  constructor(readonly record: Record, query: URLSearchParams, readonly app: App) {
    const { session } = record;
    app.title(sessionTitle(session));
    this.source = FeedSource.recorded(app.feed, session.id, RATE_HZ);
    this.metrics = new Metrics(app, record);
    this.dashboard = new Dashboard(this.source, { onTime: (time) => this.transport.seek(time ?? 0), metrics: (replayed) => this.metrics.draw(replayed) });
    this.transport = new Transport(this.source);
    this.comparison = new Comparison(app, session, this.source, this.dashboard);
    this.attempts = debriefAttempts(app, session.id, this.source, Number(query.get("attempt")) || 0, (time) => this.transport.seek(time));
    this.dashboard.viewports.append(this.attempts.scope);
    this.ends = this.listen();
    const other = query.get("with");
    if (other) void this.comparison.begin(other, query.get("as") === "ghost" ? "ghost" : "side");
    this.transport.toEnd();
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
    const show = (): void => void this.changes.value++;
    return [
      source.onChange((change) => {
        if (change === "session") this.metrics.setGroups(source.session?.groups); // they have their labels
        if (change === "progress" && source.progress === 1) transport.outcome.value = checked(source);
        if (change !== "moment" || source.history.count === 1) show();
      }),
      this.app.feed.onLink(show),
    ];
  }
}

const island = (element: HTMLElement) => <Island class="island" make={(place) => {
  place.append(element);
  return () => {};
}} />;

function ReplayPage({ of }: { of: Replay }) {
  void of.changes.value;
  const { source, dashboard, comparison, transport, attempts, record } = of;
  const covered = source.history.count === 0;
  useLayoutEffect(() => void (dashboard.element.inert = covered));
  return (
    <div class={`replay-page ${covered && source.progress === 1 ? "nothing" : ""}`}>
      <Head of={of} />
      <div class="notices" role="status">{noticesOf(record.session, source).map((words) => <p key={words} class="notice"><Icon name="act" />{words}</p>)}</div>
      <CompareBar of={comparison} />
      <TransportBar of={transport} />
      {island(attempts.element)}
      <div class="station-main">{island(dashboard.element)}{covered && <div class="station-waiting"><Cover of={of} /></div>}</div>
    </div>
  );
}

function Head({ of: { app, record: { session }, metrics, comparison } }: { of: Replay }) {
  const words = text.debrief;
  const base = `/api/v1/sessions/${part(session.id)}`;
  const length = session.end_utc_s === null ? "" : format.clock(session.end_utc_s - session.start_utc_s);
  const course = metrics.course.value;
  return (
    <header class="station-head">
      <div class="station-name">
        <a href={routeTo("sessions")} class="button quiet back"><Icon name="back" />{text.views.sessionsOf(app.account?.role)}</a>
        <h1>{sessionTitle(session)}</h1>
        {session.state !== "closed" && <Badge kind={text.sessions.kinds[session.state] ?? ""}>{text.sessions.states[session.state] ?? session.state}</Badge>}
      </div>
      <p class="about quiet-text">{[session.case, session.station, length].filter((one) => one !== "").join(" · ")}</p>
      <div class="head-actions">
        <Button onClick={() => comparison.choose()}>{words.compare}</Button>
        <a class="button" href={`${base}/report${course ? `?course=${part(course)}` : ""}`} target="_blank" rel="noopener">{words.report}</a>
        <a class="button" href={`${base}/trace`} download><Icon name="file" />{words.trace}</a>
      </div>
    </header>
  );
}

// Nothing can be played, still or for good: what was measured is known all the same.
function Cover({ of: { source, metrics, app } }: { of: Replay }) {
  const words = text.debrief;
  const figures = <div class="cover-metrics panel">{metrics.draw([])}</div>;
  const over = source.progress === 1;
  if (source.refused) return <Empty title={words.noSession} hint={words.noSessionHint} />;
  if (over && source.trouble) return <><Empty title={words.noReplay} hint={source.trouble}><Button onClick={() => location.reload()}>{text.tryAgain}</Button></Empty>{figures}</>;
  if (over) return <><Empty title={words.noMoments} hint={words.noMomentsHint} />{figures}</>;
  if (app.feed.lostMs() !== undefined) return <Empty title={text.wall.unreachable} hint={text.station.comesBack} />;
  return <Loading what={source.trouble || words.waiting} />;
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

/** What the session's figures stand beside. */
class Metrics {
  readonly course = signal("");
  private readonly options = signal<readonly (readonly [value: string, label: string])[]>([]);
  private readonly distributions = signal<readonly Distribution[]>([]);
  private readonly other = signal<readonly Value[]>([]);
  private readonly groups = signal<Groups | undefined>(undefined);
  private turn = 0;

  constructor(private readonly app: App, private readonly record: Record) {
    void this.begin(app.account?.role === "trainee");
  }

  setOther(values: readonly Value[]): void {
    this.other.value = values;
  }

  setGroups(groups: Groups | undefined): void {
    this.groups.value = groups;
  }

  /** `replayed` are the replay's own, for a session whose end was not recorded. */
  draw(replayed: readonly Value[]): VNode {
    return <this.View replayed={replayed} />;
  }

  private readonly View = ({ replayed }: { replayed: readonly Value[] }) => {
    const words = text.debrief;
    const recorded = valuesOf(this.record.results).filter(({ name }) => name !== "depth_time");
    const values = recorded.length ? recorded : replayed;
    const beside = { distributions: this.distributions.value, other: this.other.value, groups: this.groups.value };
    return (
      <div class="beside">
        <label class="beside-choice" hidden={this.options.value.length < 2}><span>{words.besides}</span>
          <Select label={words.besides} options={this.options.value} value={this.course.value} onChoose={(course) => void this.load(course)} /></label>
        <p class="hint">{hasOthers(values, beside.distributions) ? words.stripsHint : words.allAlone}</p>
        <Strips values={values} {...beside} />
      </div>
    );
  };

  private async begin(trainee: boolean): Promise<void> {
    const courses = trainee ? await this.app.api.get<{ courses: string[] }>("/me").then((me) => me.courses, () => [])
      : await this.app.api.get<{ courses: { name: string }[] }>("/courses").then((all) => all.courses.map(({ name }) => name), () => []);
    this.options.value = [...(trainee ? [] : [["", text.debrief.everybody] as const]), ...courses.map((name) => [name, text.debrief.course(name)] as const)];
    if (this.options.value.length) await this.load(this.options.value[0]![0]);
  }

  private async load(course: string): Promise<void> {
    const mine = ++this.turn;
    this.course.value = course;
    const found = await this.app.api.get<{ distributions: Distribution[] }>("/distributions", { case: this.record.session.case, course })
      .then((answer) => answer.distributions, (): Distribution[] => []);
    if (mine === this.turn) this.distributions.value = found;
  }
}
