// #/station/NAME: one station's session, as it happens.
import { effect, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { AttemptState_End, AttemptState_Purpose, SessionState, type AttemptState, type LiveSession } from "wire";
import type { App, View } from "../app";
import { Dashboard } from "../dashboard";
import { STATE } from "../history";
import { announcer, Empty, Icon, Island, Loading, useEverySecond, view, type IconName } from "../kit";
import { QUIET_MS } from "../live";
import { routeTo } from "../router";
import { FeedSource, markerAt } from "../source";
import { format, text } from "../text";
import { Controls, SessionControls } from "./session_controls";

const RATE_HZ = 30;

const STATES: Record<SessionState, [icon: IconName, words: keyof typeof text.wall.statuses]> = {
  [SessionState.WAITING]: ["waiting", "waiting"],
  [SessionState.RUNNING]: ["running", "running"],
  [SessionState.PAUSED]: ["paused", "paused"],
  [SessionState.CLOSED]: ["closed", "closed"],
};
const idOf = ({ id }: LiveSession): string => [...id].map((byte) => byte.toString(16).padStart(2, "0")).join("");

/** The session of a station as the page has it, with its pictures. */
class Station {
  readonly source: FeedSource;
  readonly dashboard: Dashboard;
  readonly controls: SessionControls | undefined; // of an instructor
  readonly began: number;
  heard = 0; // when the last moment came
  private attempt: AttemptState | undefined; // the last that was told
  private readonly deaf: () => void;

  constructor(readonly app: App, readonly name: string) {
    this.began = app.feed.now();
    const source = (this.source = FeedSource.live(app.feed, name, RATE_HZ));
    this.deaf = app.feed.on("attempt", (attempt) => void (this.attempt = attempt)); // it may come before the page is drawn
    this.dashboard = new Dashboard(source, { onMarker: (marker) => this.controls?.placeMarker(marker) });
    this.controls = app.account?.role === "instructor" ? new SessionControls(app, {
      station: name, case: () => source.session?.caseName ?? "", strength: () => source.session?.strength ?? 1, trainee: () => source.session?.trainee ?? "",
    }) : undefined;
  }

  close(): void {
    this.deaf();
    this.dashboard.close();
    this.source.close();
  }

  get state(): SessionState | undefined {
    const { history } = this.source;
    return history.count ? history.value(history.count - 1, STATE) : undefined;
  }

  get inExam(): boolean {
    const { attempt, source: { session } } = this;
    return attempt !== undefined && attempt.stationNumber === session?.stationNumber
      && attempt.purpose === AttemptState_Purpose.EXAM && attempt.end === AttemptState_End.RUNS;
  }

  /** For how long nothing is heard, and in which words; undefined: what is shown is how it is. */
  get staleness(): string | undefined {
    const { feed } = this.app;
    const lost = feed.lostMs();
    if (lost !== undefined) return text.station.lost(lost);
    const age = this.heard && this.source.history.count ? feed.now() - this.heard : 0;
    return age >= QUIET_MS && this.state !== SessionState.CLOSED ? text.station.stale(age) : undefined;
  }

  /** Why there is nothing to show. */
  get missing(): "refused" | "lost" | "none" | "waiting" {
    const { feed } = this.app;
    if (this.source.refused) return "refused";
    if (feed.lostMs() !== undefined) return "lost";
    const late = feed.link.state === "open" && feed.now() - this.began > QUIET_MS;
    return this.source.trouble || late ? "none" : "waiting";
  }
}

export const station: View = (root, route, app) => {
  const own = new Station(app, route.args[0] ?? "");
  app.title(text.station.title(own.name));
  const end = view(() => <StationPage of={own} />)(root, route, app);
  return () => {
    end();
    own.close();
  };
};

function StationPage({ of: own }: { of: Station }) {
  const { app, source, dashboard, controls } = own;
  useChanges(own);
  usePicking(own);
  const old = own.staleness;
  const reachable = app.feed.lostMs() === undefined;
  const tell = useRef(announcer());
  const waiting = source.session === undefined && source.history.count === 0;
  useEffect(() => {
    tell.current(old !== undefined && reachable ? "quiet" : "", old ?? text.link.open); // the frame announces a silent server
    dashboard.element.inert = waiting;
  });
  return (
    <div class={`station-page ${old !== undefined ? "old" : ""} ${controls?.picking.value ? "picking" : ""}`}>
      <Head of={own} old={old} />
      {controls && <Controls of={controls} />}
      <div class="station-main">
        <Island class="island" make={(place) => {
          place.append(dashboard.element);
          return () => {};
        }} />
        {waiting && <div class="station-waiting"><Instead of={own} /></div>}
      </div>
    </div>
  );
}

// Drawn again where something but a moment came, the link changed, or a second passed.
function useChanges(own: Station): void {
  const tick = useSignal(0);
  void tick.value; // what draws the view again
  const show = (): void => {
    const { controls, source, app } = own;
    controls?.setReachable(app.feed.lostMs() === undefined);
    if (controls) {
      controls.state.value = own.state;
      controls.marker.value = markerAt(source, Infinity);
      controls.exam.value = own.inExam;
    }
    tick.value++;
  };
  useEffect(() => {
    const ends = [
      own.source.onChange((change) => {
        if (change === "moment") own.heard = own.app.feed.now();
        if (change !== "moment" || own.controls?.state.peek() !== own.state) show();
      }),
      own.app.feed.on("attempt", show),
      own.app.feed.onLink(show),
    ];
    return () => ends.forEach((end) => end());
  }, []);
  useEverySecond(show);
}

// While the place of a marker is picked: clicks, T and Escape.
function usePicking({ controls, dashboard: { viewport } }: Station): void {
  useEffect(() => {
    if (!controls) return undefined;
    const key = (event: KeyboardEvent): void => {
      if (event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) return;
      if ((event.target as HTMLElement).matches("input, select, textarea") || !viewport.picking) return;
      if (event.key === "t") controls.placeMarker(viewport.markerAtTip());
      else if (event.key === "Escape") controls.setPicking(false);
    };
    document.addEventListener("keydown", key);
    const end = effect(() => void (viewport.picking = controls.picking.value));
    return () => {
      document.removeEventListener("keydown", key);
      end();
    };
  }, []);
}

// On its own: who reads a signal is not drawn again where only what a prop holds has changed.
function ExamBadge({ of }: { of: SessionControls }) {
  return of.exam.value ? <span class="badge act"><Icon name="look" />{text.teach.exam.runs}</span> : null;
}

function Head({ of, old }: { of: Station; old: string | undefined }) {
  const { source, name, state } = of;
  const { session } = source;
  const [sign, words] = STATES[state ?? SessionState.WAITING];
  return (
    <header class="station-head">
      <div class="station-name">
        <Back app={of.app} quiet /><h1>{name}</h1>
        <span class="badge state-badge" data-state={old !== undefined ? "old" : String(state)} hidden={source.refused}>
          <Icon name={old !== undefined ? "gone" : sign} />{old !== undefined ? text.station.unknown : text.wall.statuses[words]}
        </span>
        {of.controls && <ExamBadge of={of.controls} />}
        <span class="session-clock number">{source.history.count ? format.clock(source.history.end) : ""}</span>
        <p class="stale badge now">{old ?? ""}</p>
        <p class="badge act" role="status" hidden={!source.note}>{source.note}</p>
      </div>
      <p class="about quiet-text">{session ? [session.trainee || text.station.nobody, session.caseName, text.station.shape(session.strength)].join(" · ") : ""}</p>
      {session && state === SessionState.CLOSED && <a class="button" href={routeTo("session", [idOf(session)])}>{text.station.debrief}</a>}
      <a class="button" href={routeTo("scope", [name])}>{text.station.scope}</a>
    </header>
  );
}

function Back({ app, quiet = false }: { app: App; quiet?: boolean }) {
  const [href, words] = app.account?.role === "trainee" ? ["#/sessions", text.views.mySessions] : ["#/wall", text.views.wall];
  return <a href={href} class={quiet ? "button quiet back" : "button"}>{quiet && <Icon name="back" />}{words}</a>;
}

function Instead({ of }: { of: Station }) {
  const t = text.station;
  const { source, missing, app, name } = of;
  if (missing === "refused")
    return app.account?.role === "trainee" ? <Empty title={t.notYours} hint={t.notYoursHint}><Back app={app} /></Empty> : <Empty title={t.notThere} hint={source.trouble}><Back app={app} /></Empty>;
  if (missing === "lost") return <Empty title={text.wall.unreachable} hint={t.comesBack} />;
  return missing === "none" ? <Empty title={t.noSession} hint={source.trouble || t.noSessionHint} /> : <Loading what={t.waiting(name)} />;
}
