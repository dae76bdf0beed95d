// The part of the wall's rail that speaks of trainees: who asks, struggles and has finished, in sentences.
import { render } from "preact";
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { Command_Kind, SessionState, type InstrumentMoment } from "wire";
import type { App } from "../app";
import { LOST } from "../history";
import { FIRST_INSTRUMENT, isOptic, USUAL } from "../instruments";
import { Button, Field, Icon, openForm, toast, toastFault, type IconName } from "../kit";
import type { CommandInit, StationState } from "../live";
import { routeTo } from "../router";
import { attemptOf } from "../teach/live_attempt";
import { goalsMet, type Attempt, type AttemptRow } from "../teach/model";
import { useTick } from "../teach/parts";
import { limitsOf } from "../teach/limits";
import { quantile } from "../teach/quantile";
import { Attention, type AttentionRow, type Group, type Observed } from "../teach/rules";
import { sees } from "../teach/sight";
import { format, text } from "../text";
import { askLimits } from "./attention_limits";
import { nameOf } from "./wall_model";
import type { Pictures } from "./wall_scene";

const NEAR_MM = 15; // a tip so near to a surface works
const GROUPS: readonly Group[] = ["asks", "struggles", "finished"];
const SIGNS: Record<Group, IconName> = { asks: "act", struggles: "look", finished: "quiet" };
const TRIED = 200; // attempts that a task's usual time is taken from

export interface Trainees {
  show(stations: readonly StationState[]): void;
  end(): void;
}

/** Draws into `place`, and listens to the attempts of all stations until it is ended. `pictures` gets those of its rows. */
export function trainees(place: HTMLElement, app: App, pictures: Pictures): Trainees {
  const attention = new Attention(limitsOf);
  const attempts = new Map<number, Attempt>();
  const usual = new Map<string, number | undefined>(); // median time of a task, s
  let rows: AttentionRow[] = [];
  const draw = (): void => render(<People app={app} rows={rows} attention={attention} pictures={pictures} limits={askFor} changed={draw} />, place);
  const askFor = (): void => void askLimits(app, [...attempts.values()].find(({ end }) => end === "")?.task).catch(toastFault);
  const askUsual = (task: string): void => {
    if (usual.has(task)) return;
    usual.set(task, undefined);
    void app.api.get<{ attempts: AttemptRow[] }>("/attempts", { task, limit: TRIED }).then(({ attempts: all }) => {
      const times = all.filter(({ verdict }) => verdict === "passed").map(({ time_s }) => time_s!);
      if (times.length >= 5) usual.set(task, quantile(times, 0.5));
    }, () => undefined);
  };
  const end = app.feed.on("attempt", (told) => {
    const attempt = attemptOf(told, USUAL);
    attempts.set(told.stationNumber, attempt);
    if (app.account?.role === "instructor") askUsual(attempt.task);
  });
  draw();
  return {
    show(stations) {
      rows = attention.update(app.feed.now(), stations.map((station) => observe(station, attempts.get(station.number), usual)));
      draw();
    },
    end() {
      end();
      render(null, place);
    },
  };
}

/** What the rules are told of a station. */
export function observe(station: StationState, attempt: Attempt | undefined, usual: ReadonlyMap<string, number | undefined>): Observed {
  const { place, moment } = station;
  const there = (moment?.instruments ?? []).filter(({ validity }) => validity !== LOST);
  const current = moment && attempt && moment.attempt === attempt.number ? attempt : undefined;
  const medianS = current && usual.get(current.task);
  const scope = there.find(({ channel }) => isOptic(kindOf(channel)));
  const tools = there.filter(({ channel }) => !isOptic(kindOf(channel)));
  const working = tools.filter(({ nearestMm }) => nearestMm >= 0 && nearestMm <= NEAR_MM);
  const optic = { tiltDeg: place?.opticDeg ?? 0, fieldDeg: place?.opticViewDeg ?? 0, postDeg: 0 };
  const shown = ({ warped, tip }: InstrumentMoment): { q: number[]; t: number[] } | undefined => warped ?? tip;
  const seesScope = scope && shown(scope);
  const unseen = seesScope && optic.fieldDeg > 0 && working.some((tool) => shown(tool) && !sees(seesScope, optic, shown(tool)!));
  return {
    station: nameOf(station), trainee: place?.trainee ?? "", paused: place?.info?.state === SessionState.PAUSED, helpAsked: place?.helpAsked ?? false,
    ...(current && { attempt: { number: current.number, exam: current.purpose === "exam", task: current.task, title: current.title, ended: current.end !== "", met: goalsMet(current), time_s: Number(moment!.attemptNs) * 1e-9,
      ...(current.verdict !== "open" && { passed: current.verdict === "passed" }), ...(medianS !== undefined && { medianS }) } }),
    ...(unseen !== undefined && { unseen }),
    deepMm: Math.max(0, ...there.filter(({ channel }) => !kindOf(channel)?.cuts).map(({ penetrationMm }) => penetrationMm)),
    ...(place && place.plannedMm3 > 0 && { beyondShare: place.overMm3 / place.plannedMm3 }),
    ...(place && { outerMm3: place.outerMm3 }),
  };
}

const kindOf = (channel: number): (typeof USUAL)[number] | undefined => USUAL[channel - FIRST_INSTRUMENT];

// ---- the rows ------------------------------------------------------------------------------------------------

interface PeopleProps {
  app: App;
  rows: readonly AttentionRow[];
  attention: Attention;
  pictures: Pictures;
  limits(): void;
  changed(): void;
}

function People({ app, rows, attention, pictures, limits, changed }: PeopleProps) {
  const words = text.teach.attention;
  const now = useTick();
  return <>
    {GROUPS.map((group) => {
      const mine = rows.filter((row) => row.group === group);
      return mine.length > 0 && (
        <section key={group} class={`attention-group ${group}`} aria-label={words.groups[group]}>
          <h3>{words.groups[group]} <span class="badge number">{mine.length}</span></h3>
          <ol>{mine.map((row) => <Row key={row.key} app={app} row={row} now={now} pictures={pictures} snooze={() => {
            attention.snooze(row.key, app.feed.now());
            changed();
          }} />)}</ol>
        </section>);
    })}
    {rows.length === 0 && <p class="attention-empty"><Icon name="quiet" />{words.empty}</p>}
    <Button kind="quiet" class="small attention-limits" onClick={limits}>{words.limitsOpen}</Button>
    {attention.history.length > 0 && <Earlier rows={attention.history} now={now} />}
  </>;
}

const sentenceOf = (row: AttentionRow): string => text.teach.attention.rules[row.rule]!(row);
const whoOf = ({ trainee }: AttentionRow): string => trainee || text.teach.attention.nobody;

function Row({ app, row, now, pictures, snooze }: { app: App; row: AttentionRow; now: number; pictures: Pictures; snooze: () => void }) {
  const words = text.teach.attention;
  const instructor = app.account?.role === "instructor";
  const [busy, setBusy] = useState(false);
  const send = async (what: string, command: CommandInit): Promise<void> => {
    setBusy(true);
    const reply = await app.feed.command({ ...command, station: row.station }).finally(() => setBusy(false));
    toast(reply.ok ? what : reply.text, reply.ok ? "done" : "fault");
  };
  const note = (): void => openForm(text.station.noteTitle, text.station.send,
    <Field label={text.station.noteLabel} hint={text.station.noteHint}><textarea name="note" maxLength={240} rows={3} /></Field>,
    ({ note: said = "" }) => send(words.noted, { kind: Command_Kind.NOTE, remark: { text: said.trim() } }),
    ({ note: said = "" }) => ({ note: said.trim() ? "" : text.station.noteNeeded }));
  const of = (what: string): string => words.of(what, whoOf(row));
  return (
    <li class="attention-row">
      <RowPicture station={row.station} label={words.picture(whoOf(row))} pictures={pictures} />
      <p><Icon name={SIGNS[row.group]} /><span><b>{whoOf(row)}</b> {sentenceOf(row)}. <span class="quiet-text">{row.station}, {words.since(now - row.since)}</span></span></p>
      <div class="attention-do">
        <a class="button small" href={routeTo("station", [row.station])} aria-label={of(words.watch)}>{words.watch}</a>
        {instructor && !row.exam && row.group !== "finished" && <>
          <Button class="small" aria-label={of(words.note)} onClick={note}>{words.note}</Button>
          <Button class="small" disabled={busy} aria-label={of(words.freeze)} onClick={() => void send(words.frozen(row.station), { kind: Command_Kind.PAUSE }).catch(toastFault)}>{words.freeze}</Button></>}
        <Button class="small" aria-label={of(words.snooze)} onClick={snooze}>{words.snooze}</Button>
      </div>
    </li>
  );
}

// What the scope sees there now; the wall draws it.
function RowPicture({ station, label, pictures }: { station: string; label: string; pictures: Pictures }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useLayoutEffect(() => {
    const place = canvas.current!;
    pictures.set(place, station);
    return () => void pictures.delete(place);
  }, [station]);
  return <canvas ref={canvas} class="attention-picture" role="img" aria-label={label} />;
}

function Earlier({ rows, now }: { rows: readonly AttentionRow[]; now: number }) {
  const words = text.teach.attention;
  return (
    <details class="attention-earlier"><summary>{words.history}</summary>
      <ol>{rows.map((row) => <li key={`${row.key} ${row.since}`}><b>{whoOf(row)}</b> {sentenceOf(row)}. <span class="quiet-text">{format.ago(now - row.until!)}</span></li>)}</ol>
    </details>
  );
}

