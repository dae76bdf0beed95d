// #/train/STATION: the station runs itself. Who, today, briefing, do, feedback; then again, next or leave.
import { Fragment } from "preact";
import { useEffect, useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import { SessionState } from "wire";
import { part, type Account } from "../api";
import type { App } from "../app";
import { explain, whyOf } from "../explain";
import { nameInWords } from "../groups";
import { LOST, SEEN, STATE, toolAt } from "../history";
import { isOptic } from "../instruments";
import { Button, confirm, Icon, toast, toastFault, useLoaded, view, type ViewProps } from "../kit";
import type { CommandInit } from "../live";
import { routeTo, type Route } from "../router";
import { FeedSource } from "../source";
import type { ViewAddress } from "../station_view";
import { Clip } from "../teach/clip";
import { ExpertClip, prepareExpert, useExpert } from "../teach/expert";
import { Goals, sentencesOf } from "../teach/limits_words";
import { PlanPicture } from "../teach/plan_picture";
import { attemptOf, beginCommand, helpCommand, leaveCommand, stopCommand, takeCommand } from "../teach/live_attempt";
import { casesOf, clipAround, errorsOf, goalsMet, StepTimes, worst, type Attempt, type AttemptRow, type Hand, type Task, type Today } from "../teach/model";
import { Next } from "../teach/next";
import { Bar, useTick } from "../teach/parts";
import { ProbeCursor } from "../teach/probe_cursor";
import { format, text } from "../text";
import { Scope } from "./scope";
import { settingsOf } from "./scope_settings";

const RATE_HZ = 60;
const KEPT = { recent: 72 * 512, older: 0 }; // ten minutes, for the clips of errors
const CODE_LENGTH = 8;
const KEYS = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789"; // of codes

export const train = view(Train);

interface Chosen {
  task: Task;
  hand: Hand;
  cases: readonly string[]; // on which it counts for the trainee's courses; none: on all
}

function Train({ route, app }: ViewProps) {
  const station = route.args[0] ?? "";
  const words = text.teach.train;
  const { place } = useMemo(() => settingsOf(route), [station]);
  useEffect(() => app.title(words.title(station)), [station]);
  const account = app.account?.role === "trainee" ? app.account : undefined;
  return (
    <div class="train-page">
      <h1 class="unseen">{words.title(station)}</h1>
      {account ? <Trainee station={station} route={route} app={app} account={account} /> : <Who app={app} place={place} />}
    </div>
  );
}

// ---- who -------------------------------------------------------------------------------------------------

function Who({ app, place }: { app: App; place: ViewAddress | undefined }) {
  const words = text.teach.train;
  const [code, setCode] = useState("");
  const [fault, setFault] = useState("");
  const [probe, setProbe] = useState(false); // was seen, and may point at keys
  const input = useRef<HTMLInputElement>(null);
  useEffect(() => input.current?.focus(), []);
  const type = (value: string): void => {
    setFault("");
    setCode(value.toUpperCase().replace(/[^A-Z0-9]/g, "").slice(0, CODE_LENGTH));
  };
  const enter = async (event: Event): Promise<void> => {
    event.preventDefault();
    if (code.length !== CODE_LENGTH) {
      setFault(text.signIn.needCode);
      return;
    }
    try {
      app.signedIn((await app.api.post<{ account: Account }>("/sign-in", { code })).account);
    } catch (error) {
      setFault(explain(error));
    }
  };
  return (
    <form class="train-card who" noValidate onSubmit={(event) => void enter(event)}>
      <h2>{words.who}</h2>
      <label class="who-code"><span>{words.code}</span>
        <input ref={input} class="code" value={code} autocomplete="one-time-code" spellcheck={false} aria-describedby="who-hint" onInput={(event) => type(event.currentTarget.value)} /></label>
      <p id="who-hint" class={fault ? "fault" : "quiet-text"} role="status">{fault || (probe ? words.whoProbe : words.whoHint)}</p>
      <div class="who-keys">
        {place && <ProbeCursor key={`${place.port}`} place={place} told={(seen) => seen && setProbe(true)} />}
        {[...KEYS].map((key) => <button type="button" class="button" key={key} onClick={() => type(code + key)}>{key}</button>)}
        <button type="button" class="button erase" onClick={() => type(code.slice(0, -1))}>{words.erase}</button>
        <button type="submit" class="button primary enter">{words.enter}</button>
      </div>
    </form>
  );
}

// ---- the trainee ------------------------------------------------------------------------------------------

interface LiveState {
  source: FeedSource;
  steps: StepTimes;
  attempt: Attempt | undefined;
}

/** The station's session with its last attempt, as it changes. */
function useLive(app: App, station: string): LiveState | undefined {
  const [state, setState] = useState<LiveState>();
  useLayoutEffect(() => { // what watches ends before the next view watches
    const steps = new StepTimes();
    const source = FeedSource.live(app.feed, station, RATE_HZ, KEPT);
    let session = "";
    setState({ source, steps, attempt: undefined });
    const ends = [
      source.onChange((change) => {
        if (change === "moment") return;
        const now = source.session?.id.join() ?? "";
        if (change === "session" && now !== session) {
          session = now;
          steps.clear();
          setState({ source, steps, attempt: undefined });
        } else setState((before) => before && { ...before });
      }),
      app.feed.on("moment", ({ step, timeNs, stationNumber }) => stationNumber === source.session?.stationNumber && steps.add(Number(step), Number(timeNs) * 1e-9)),
      app.feed.on("attempt", (told) => {
        if (told.stationNumber === source.session?.stationNumber) setState({ source, steps, attempt: attemptOf(told, source.history.instruments) });
      }),
    ];
    return () => {
      for (const end of ends) end();
      source.close();
    };
  }, [station]);
  return state;
}

function Trainee({ station, route, app, account }: { station: string; route: Route; app: App; account: Account }) {
  const live = useLive(app, station);
  const [chosen, setChosen] = useState<Chosen>();
  const [closed, setClosed] = useState(0); // the number of the attempt whose feedback was read
  const attempt = live?.attempt;
  // Whether there is a session to be ended the server knows.
  const leave = async (): Promise<void> => {
    try {
      if (live?.source.session) await app.feed.command(stopCommand(station));
      await app.signOut();
    } catch (error) {
      toastFault(error);
    }
  };
  const choose = async (task: string, hand: Hand): Promise<void> => {
    try {
      const [{ task: found }, today] = await Promise.all([app.api.get<{ task: Task }>(`/tasks/${part(task)}`), app.api.get<Today>("/trainees/me/today")]);
      if (attempt?.end) setClosed(attempt.number);
      setChosen({ task: found, hand, cases: casesOf(today, task) });
    } catch (error) {
      toastFault(error);
    }
  };
  if (live && attempt && attempt.end === "") return <Do app={app} route={route} station={station} live={live} attempt={attempt} />;
  if (live && attempt && attempt.number !== closed)
    return <Feedback app={app} live={live} attempt={attempt} leave={() => void leave()} again={() => void choose(attempt.task, attempt.hand)} next={() => {
      setClosed(attempt.number);
      setChosen(undefined);
    }} />;
  if (chosen) return <Briefing app={app} station={station} live={live} chosen={chosen} back={() => setChosen(undefined)} />;
  return <TodayCard app={app} account={account} choose={choose} leave={() => void leave()} />;
}

// ---- today -----------------------------------------------------------------------------------------------

const handOf = (hand: Hand | "either"): Hand => (hand === "left" ? "left" : "right");

function TodayCard({ app, account, choose, leave }: { app: App; account: Account; choose: (task: string, hand: Hand) => Promise<void>; leave: () => void }) {
  const words = text.teach.train;
  return (
    <section class="train-card today">
      <h2>{words.hello(account.trainee ?? account.name)}</h2>
      <Next app={app} more={({ task, hand }) => <Button kind="primary" class="huge" onClick={() => void choose(task, handOf(hand))}>{words.begin}</Button>}
        others={(tasks, free) => <Others tasks={tasks} open={free} choose={choose} />} />
      <div class="train-actions"><Button onClick={leave}>{words.leave}</Button></div>
    </section>
  );
}

function Others({ tasks, open, choose }: { tasks: Task[]; open: boolean; choose: (task: string, hand: Hand) => Promise<void> }) {
  if (!tasks.length) return null;
  return (
    <details class="others" open={open}><summary>{text.teach.train.others}</summary>
      <ul>{tasks.map(({ name, title }) => <li key={name}><button type="button" class="button" onClick={() => void choose(name, "right")}>{title}</button></li>)}</ul>
    </details>
  );
}

// ---- briefing --------------------------------------------------------------------------------------------

const USUAL_TOOLS = ["scope", "probe"];

/** Whether the instrument of that name is seen now. */
function isSeen({ source }: LiveState, name: string): boolean {
  const place = source.history.instruments.findIndex((one) => one.name === name || (name === "scope" && isOptic(one)));
  if (place < 0 || !source.history.count) return false;
  const seen = source.history.value(source.history.count - 1, toolAt(place) + SEEN);
  return seen >= 1 && seen - 1 !== LOST;
}

function Briefing({ app, station, live, chosen, back }: { app: App; station: string; live: LiveState | undefined; chosen: Chosen; back: () => void }) {
  const words = text.teach.train;
  const { task, hand, cases } = chosen;
  const here = live?.source.session?.caseName;
  const [fault, setFault] = useState("");
  const [busy, setBusy] = useState(false);
  useTick(250);
  useEffect(() => {
    if (here) prepareExpert(app, task.name, here);
  }, [task.name, here]);
  const tools = (task.tools?.length ? task.tools : USUAL_TOOLS).map((name) => ({ name, seen: live !== undefined && isSeen(live, name) }));
  const ready = tools.every(({ seen }) => seen);
  const send = async (command: CommandInit, refused: (why: string) => string): Promise<void> => {
    setBusy(true);
    setFault("");
    try {
      const reply = await app.feed.command(command);
      if (!reply.ok) setFault(refused(whyOf(reply.why, reply.text)));
    } catch (error) {
      setFault(explain(error));
    }
    setBusy(false);
  };
  const take = (): void => void send(takeCommand(station), (why) => `${why.replace(/\.$/, "")}. ${words.takenHint}`);
  const start = (): void => void send(beginCommand(station, task.name, "practice", hand), words.refused);
  return (
    <section class="train-card briefing">
      <h2>{task.title}</h2>
      <p class="briefing-words">{task.briefing}</p>
      <div class="briefing-parts">
        <div><h3>{words.goals}</h3><Goals task={task} />
          {live && task.tools?.includes("punch") && <PlanPicture session={live.source.session} />}</div>
        <div><h3>{words.tools}</h3>
          <ul class="tools">{tools.map(({ name, seen }) => <li key={name} class={seen ? "seen" : ""}><Icon name={seen ? "quiet" : "waiting"} /><span>{words.show(nameInWords(name).toLowerCase())}</span><span class="quiet-text">{seen ? words.ready : words.notSeen}</span></li>)}</ul>
          <p class="quiet-text">{sentenceOf(text.teach.hands[hand]!)}</p>
          <p class="quiet-text">{text.teach.mark(format.clock(task.mark.time_s), task.mark.errors)}</p></div>
      </div>
      {cases.length > 0 && <p class={here && !cases.includes(here) ? "notice" : "quiet-text"} role="status">{here && !cases.includes(here) ? words.otherCase(cases, here) : words.onCases(cases)}</p>}
      <p class="fault" role="alert">{fault || (live ? trouble(live) : "")}</p>
      <div class="train-actions">
        <Button onClick={back}>{words.back}</Button>
        {live && runs(live) ? <Button kind={ready ? "primary" : "plain"} class="huge" disabled={busy} onClick={start}>{ready ? words.start : words.startAnyway}</Button>
          : <Button kind="primary" class="huge" disabled={busy || !live} onClick={take}>{words.take}</Button>}
      </div>
    </section>
  );
}

const sentenceOf = (words: string): string => `${words.charAt(0).toUpperCase()}${words.slice(1)}.`;

/** Whether an own session runs. */
const runs = ({ source: { session, history } }: LiveState): boolean =>
  session !== undefined && history.count > 0 && history.value(history.count - 1, STATE) === SessionState.RUNNING;

function trouble({ source }: LiveState): string {
  const words = text.teach.train;
  return source.session || source.refused || !source.trouble ? "" : `${words.noStation}. ${words.noStationHint}`;
}

// ---- do --------------------------------------------------------------------------------------------------

function Do({ app, route, station, live, attempt }: { app: App; route: Route; station: string; live: LiveState; attempt: Attempt }) {
  const words = text.teach.train;
  const [asked, setAsked] = useState(false);
  const told = useRef({ number: 0, time: 0, at: 0 });
  const now = useTick(200);
  const exam = attempt.purpose === "exam";
  if (told.current.number !== attempt.number || told.current.time !== attempt.time_s) told.current = { number: attempt.number, time: attempt.time_s, at: now };
  const time = Math.min(attempt.limit_s, attempt.time_s + (runs(live) ? (now - told.current.at) / 1000 : 0));
  const met = goalsMet(attempt);
  const next = attempt.goals.find(({ met_s }) => met_s === null);
  const send = (command: Parameters<App["feed"]["command"]>[0]): Promise<void> => app.feed.command(command).then((reply) => {
    if (!reply.ok) toast(reply.text, "fault");
  }, toastFault);
  const help = (): void => void send(helpCommand(station)).then(() => setAsked(true));
  const end = (): void => confirm(words.endTitle, words.endHint, words.end, () => send(leaveCommand(station)));
  return (
    <div class="do">
      <div class="view scope do-scope"><Scope key={attempt.number} route={{ ...route, args: [station] }} app={app} place={{ source: live.source, plain: exam }} /></div>
      <aside class="do-edge" aria-label={attempt.title}>
        <p class="do-title">{attempt.title}</p>
        {!exam && attempt.goals.length > 0 && <div class="do-step" role="status"><p>{next ? words.step(met + 1, attempt.goals.length) : words.allMet}</p><p class="do-goal">{next ? nameInWords(next.name) : ""}</p>
          <Hint app={app} attempt={attempt} goal={next ? attempt.goals.indexOf(next) : -1} /></div>}
        <p class="do-clock number" role="timer" aria-label={words.clock}>{format.clock(time)} <span>{words.limit(format.clock(attempt.limit_s))}</span></p>
        {!exam && <p class="do-errors number">{words.errors(errorsOf(attempt))}</p>}
        <span class="do-space" />
        {!exam && <Button class="huge" disabled={asked} onClick={help}>{asked ? words.helpAsked : words.help}</Button>}
        <Button onClick={end}>{words.end}</Button>
      </aside>
    </div>
  );
}

/** What the goal asks, by the version of the task that is judged. */
function Hint({ app, attempt: { task, version }, goal }: { app: App; attempt: Attempt; goal: number }) {
  const { value } = useLoaded(() => app.api.get<{ task: Task }>(`/tasks/${part(task)}`), [task]);
  const limits = value?.task.version === version ? value.task.limits[goal] : undefined;
  return limits ? <ul class="do-hint">{sentencesOf(limits).map((words) => <li key={words}>{words}</li>)}</ul> : null;
}

// ---- feedback --------------------------------------------------------------------------------------------

function Feedback({ app, live, attempt, leave, again, next }: { app: App; live: LiveState; attempt: Attempt; leave: () => void; again: () => void; next: () => void }) {
  const words = text.teach.train;
  const [clip, setClip] = useState<number | undefined>(0); // the worst plays at once
  const mine = useLoaded(() => app.api.get<{ attempts: AttemptRow[] }>("/attempts", { task: attempt.task, limit: 100 }), [attempt.task, attempt.number]);
  const heading = useRef<HTMLHeadingElement>(null);
  useEffect(() => heading.current?.focus(), [attempt.number]);
  const bad = useMemo(() => worst(attempt), [attempt]);
  const expert = useExpert(app, attempt, live.source.session);
  const withheld = attempt.purpose === "exam" || attempt.verdict === "open";
  if (withheld)
    return (
      <section class="train-card feedback">
        <h2 ref={heading} tabIndex={-1}>{attempt.purpose === "exam" ? words.withheld : words.judging}</h2>
        {attempt.purpose === "exam" && <p>{words.withheldHint}</p>}
        <div class="train-actions"><Button onClick={leave}>{words.leave}</Button><Button kind="primary" class="huge" onClick={next}>{words.nextTask}</Button></div>
      </section>
    );
  const passed = attempt.verdict === "passed";
  const met = goalsMet(attempt);
  const before = (mine.value?.attempts ?? []).filter((row) => row.goals_met === row.goals && !(row.number === attempt.number && row.session === idOf(live)));
  const best = (of: (row: AttemptRow) => number | null): number | undefined => {
    const all = before.map(of).filter((value): value is number => value !== null);
    return all.length ? Math.min(...all) : undefined;
  };
  const { history } = live.source;
  const name = (error: string): string => nameInWords(error);
  return (
    <section class={`train-card feedback ${passed ? "passed" : "not-yet"}`} data-verdict={attempt.verdict}>
      <h2 ref={heading} tabIndex={-1}><Icon name={passed ? "quiet" : "waiting"} />{passed ? text.teach.verdicts.passed : words.notYet(met, attempt.goals.length)}</h2>
      <p class="quiet-text">{attempt.title} · {text.teach.ends[attempt.end]}</p>
      <div class="feedback-parts">
        <div class="feedback-bars">
          <Bar label={words.time} value={attempt.time_s} pass={attempt.pass.time_s} best={best(({ time_s }) => time_s)} words={text.teach.units.seconds} />
          <Bar label={words.errorBar} value={errorsOf(attempt)} pass={attempt.pass.errors} best={best(({ errors }) => errors)} words={text.teach.times} />
          {met < attempt.goals.length && <div><h3>{words.missed}</h3><ul class="goals">{attempt.goals.filter(({ met_s }) => met_s === null).map((goal) => <li key={goal.name}>{name(goal.name)}</li>)}</ul></div>}
        </div>
        <div class="feedback-errors"><h3>{words.worst}</h3>
          {bad.length === 0 && <p>{words.noErrors}</p>}
          <ol class="feedback-clips">{bad.length === 0 && expert && met < attempt.goals.length && <ExpertClip expert={expert} own={attempt} time_s={attempt.time_s} />}{bad.map((one, at) => {
            const still = live.steps.at(one.step);
            const { from, to } = clipAround(still, history.start, history.end);
            return <Fragment key={one.step}>
              <li><button type="button" class="button wide" aria-pressed={clip === at} onClick={() => setClip(clip === at ? undefined : at)}>
                <Icon name={clip === at ? "paused" : "running"} />{words.clip(name(one.error), format.clock(one.time_s))}</button>
                <Clip source={live.source} from={from} to={to} still={still} playing={clip === at} label={words.clipOf(name(one.error))} /></li>
              {clip === at && expert && <ExpertClip expert={expert} own={attempt} time_s={one.time_s} />}</Fragment>;
          })}</ol>
        </div>
      </div>
      <div class="train-actions">
        <Button onClick={leave}>{words.leave}</Button>
        <a class="button" href={routeTo("session", [idOf(live)], { attempt: String(attempt.number) })}>{text.station.debrief}</a>
        <Button kind={passed ? "plain" : "primary"} class="huge" onClick={again}>{words.again}</Button>
        <Button kind={passed ? "primary" : "plain"} class="huge" onClick={next}>{words.nextTask}</Button>
      </div>
    </section>
  );
}

const idOf = ({ source }: LiveState): string => [...(source.session?.id ?? [])].map((byte) => byte.toString(16).padStart(2, "0")).join("");
