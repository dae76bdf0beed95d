// #/rate: what I have to rate; #/rate/SESSION/NUMBER: the ASSET form beside the replay through the scope, without names.
import { useEffect, useLayoutEffect, useState } from "preact/hooks";
import { part } from "../api";
import type { App } from "../app";
import { Await, Badge, Button, Empty, Head, toast, toastFault, useLoaded, view, type ViewProps } from "../kit";
import { routeTo } from "../router";
import { ScopeReplay } from "../scope_replay";
import { FeedSource } from "../source";
import { DOMAINS, levels, missing, sum, type Domain, type Scores } from "../teach/asset";
import { StepTimes, type AttemptRow } from "../teach/model";
import { format, text } from "../text";

const RATE_HZ = 30;

export const rate = view(({ route, app }: ViewProps) => {
  const [session, number] = route.args;
  app.title(text.teach.rate.title);
  return session && number ? <Rate key={`${session} ${number}`} app={app} session={session} number={Number(number)} /> : <List app={app} />;
});

interface ToRate {
  session: string;
  number: number;
  title: string;
}

function List({ app }: { app: App }) {
  const words = text.teach.rate;
  const loaded = useLoaded(async () => (await app.api.get<{ attempts: ToRate[] }>("/rate")).attempts);
  return <>
    <Head title={words.list} hint={words.blinded} />
    <Await of={loaded}>{(all) => all.length === 0 ? <Empty title={words.noneToRate} /> : (
      <ul class="course-list">{all.map(({ session, number, title }) => <li key={`${session} ${number}`} class="panel"><h2>{title}</h2><a class="button primary" href={routeTo("rate", [session, String(number)])}>{text.teach.exam.rate}</a></li>)}</ul>)}</Await>
  </>;
}

function Rate({ app, session, number }: { app: App; session: string; number: number }) {
  const words = text.teach.rate;
  const attempt = useLoaded(async () => (await app.api.get<{ attempt: AttemptRow }>(`/attempts/${part(session)}/${number}`)).attempt, [session, number]);
  return <>
    <Head title={words.title} hint={words.blinded} />
    <Await of={attempt}>{(row) => <div class="rate-page">
      <section class="panel" aria-label={words.through}><h2>{row.title}</h2><Replay app={app} attempt={row} /></section>
      <section class="panel"><Form app={app} session={session} number={number} /></section>
    </div>}</Await>
  </>;
}

/** From the attempt's first step to its last, through the scope. */
function Replay({ app, attempt }: { app: App; attempt: AttemptRow }) {
  const words = text.teach.replay;
  const [source, setSource] = useState<FeedSource>();
  const [span, setSpan] = useState<{ from: number; to: number }>();
  const [time, setTime] = useState(0);
  const [playing, setPlaying] = useState(false);
  useLayoutEffect(() => { // what watches ends before the next view watches
    const steps = new StepTimes();
    const end = app.feed.on("moment", ({ step, timeNs }) => steps.add(Number(step), Number(timeNs) * 1e-9));
    const recorded = FeedSource.recorded(app.feed, attempt.session, RATE_HZ);
    setSource(recorded);
    recorded.onChange((change) => {
      if (change !== "progress" || recorded.progress < 1) return;
      const from = steps.at(attempt.first_step);
      setSpan({ from, to: Math.max(from, steps.at(attempt.last_step)) });
      setTime(from);
    });
    return () => {
      end();
      recorded.close();
    };
  }, [attempt.session, attempt.number]);
  useEffect(() => {
    if (!playing || !span) return;
    let frame = 0;
    let last = performance.now();
    const step = (now: number): void => {
      frame = requestAnimationFrame(step);
      setTime((before) => {
        const next = before + (now - last) / 1000;
        if (next >= span.to) setPlaying(false);
        return Math.min(span.to, next);
      });
      last = now;
    };
    frame = requestAnimationFrame(step);
    return () => cancelAnimationFrame(frame);
  }, [playing, span]);
  return <>
    <div class="rate-picture">{source && <ScopeReplay source={source} time={time} />}</div>
    <div class="rate-transport">
      <Button icon={playing ? "paused" : "running"} disabled={!span} onClick={() => {
        if (span && time >= span.to) setTime(span.from);
        setPlaying(!playing);
      }}>{playing ? words.pause : words.play}</Button>
      <input type="range" aria-label={words.time} disabled={!span} min={span?.from ?? 0} max={span?.to ?? 1} step={0.1} value={time} onInput={(event) => setTime(event.currentTarget.valueAsNumber)} />
      <span class="number">{span ? format.clock(time - span.from) : words.waiting}</span>
    </div>
  </>;
}

interface Rating extends Record<Domain, number> {
  rater: string | null;
  own: boolean;
  sum: number;
  competent: boolean;
  remark: string | null;
}

interface Ratings {
  ratings: Rating[];
  others: number;
  agreement: { both_competent: boolean; difference: number } | null;
}

function Form({ app, session, number }: { app: App; session: string; number: number }) {
  const words = text.teach.rate;
  const path = `/attempts/${part(session)}/${number}/ratings`;
  const loaded = useLoaded(() => app.api.get<Ratings>(path), [path]);
  const [scores, setScores] = useState<Scores>({});
  const [remark, setRemark] = useState("");
  const left = missing(scores);
  const save = async (): Promise<void> => {
    await app.api.post(path, { ...scores, ...(remark.trim() ? { remark: remark.trim() } : {}) });
    toast(words.saved);
    loaded.reload();
  };
  return <>
    <form class="asset" onSubmit={(event) => {
      event.preventDefault();
      void save().catch(toastFault);
    }}>
      {DOMAINS.map((domain) => (
        <fieldset key={domain}><legend>{words.domains[domain]}</legend>
          <div>{levels(domain).map((level) => <label key={level}><input type="radio" name={domain} checked={scores[domain] === level} onChange={() => setScores({ ...scores, [domain]: level })} /> {(domain === "autonomy" ? words.autonomyLevels : words.levels)[level]}</label>)}</div></fieldset>))}
      <label class="asset-remark"><span>{words.remark}</span><textarea rows={2} maxLength={240} value={remark} onInput={(event) => setRemark(event.currentTarget.value)} /></label>
      <p class="number" role="status">{left.length ? words.missing(left.length) : words.sum(sum(scores))}</p>
      <Button kind="primary" type="submit" disabled={left.length > 0}>{words.submit}</Button>
    </form>
    <Await of={loaded}>{({ ratings, others, agreement }) => (
      <div class="asset-others">
        <p class="quiet-text">{ratings.length === 0 || others > 0 ? words.others(others) : ""}</p>
        {ratings.map((one, at) => <p key={at}><Badge kind={one.competent ? "good" : "act"} icon={one.competent ? "quiet" : "waiting"}>{words.rating(one.own ? words.you : (one.rater ?? words.other), one.sum)}</Badge></p>)}
        {agreement && <p role="status"><b>{words.agreement}</b>: {words.difference(agreement.difference)} {ratings.length > 1 && (new Set(ratings.map(({ competent }) => competent)).size === 1 ? words.same : words.differ)}</p>}
      </div>)}</Await>
  </>;
}
