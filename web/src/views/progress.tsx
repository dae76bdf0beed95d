// Who of a course has come how far, and the learning curve of one of them.
import { useMemo, useState } from "preact/hooks";
import { part } from "../api";
import type { App } from "../app";
import { nameInWords } from "../groups";
import { Await, Badge, Empty, Head, Icon, Table, useLoaded } from "../kit";
import { Chart, type Series } from "../kit/chart";
import { routeTo } from "../router";
import type { AttemptRow, Curve } from "../teach/model";
import { SHAPES, stateOf, type Cell, type CellState, type Progress, type ProgressRow } from "../teach/progress";
import { format, text } from "../text";
import { VerdictBadge } from "./verdict";

export function Shape({ state }: { state: CellState }) {
  return <svg viewBox="0 0 16 16" class={`icon shape ${state}`} aria-hidden="true"><path d={SHAPES[state]} /></svg>;
}

export function CourseProgress({ app, course }: { app: App; course: string }) {
  const words = text.teach.progress;
  app.title(words.title(course));
  const loaded = useLoaded(() => app.api.get<Progress>(`/courses/${part(course)}/progress`), [course]);
  const agreement = useLoaded(() => app.api.get<{ pairs: number; icc: number | null; kappa: number | null }>(`/courses/${part(course)}/agreement`), [course]);
  const [chosen, setChosen] = useState<{ trainee: string; task: string }>();
  return <>
    <Head title={words.title(course)}><a class="button" href={routeTo("courses", [course, "plan"])}>{text.teach.courses.plan}</a></Head>
    <Await of={loaded}>{(progress) => progress.tasks.length === 0
      ? <Empty title={words.noPlan} hint={words.noPlanHint}><a class="button primary" href={routeTo("courses", [course, "plan"])}>{words.makePlan}</a></Empty>
      : <>
        <p class={`progress-behind ${progress.behind ? "act" : ""}`} role="status"><Icon name={progress.behind ? "act" : "quiet"} />{progress.behind ? words.behind(progress.behind) : words.nobodyBehind}</p>
        <Key />
        <Matrix progress={progress} chosen={chosen} choose={(trainee, task) => setChosen({ trainee, task })} />
        {agreement.value && agreement.value.pairs > 0 && <p class="quiet-text">{words.agreement(agreement.value.pairs, format.number(agreement.value.icc ?? undefined, 2), format.number(agreement.value.kappa ?? undefined, 2))}</p>}
        {chosen ? <Attempts key={`${chosen.trainee} ${chosen.task}`} app={app} course={course} {...chosen} /> : <p class="quiet-text">{words.chooseCell}</p>}
      </>}</Await>
  </>;
}

function Key() {
  const states = text.teach.progress.states;
  return <ul class="progress-key">{(Object.keys(SHAPES) as CellState[]).map((state) => <li key={state}><Shape state={state} />{states[state]}</li>)}</ul>;
}

interface MatrixProps {
  progress: Progress;
  chosen: { trainee: string; task: string } | undefined;
  choose(trainee: string, task: string): void;
}

function Matrix({ progress, chosen, choose }: MatrixProps) {
  const words = text.teach.progress;
  const rows = [...progress.trainees].sort((a, b) => Number(b.behind) - Number(a.behind));
  return (
    <div class="table-scroll panel" tabIndex={0} role="region" aria-label={words.table}>
      <table class="matrix">
        <caption class="unseen">{words.table}</caption>
        <thead><tr><th scope="col">{words.trainee}</th>{progress.tasks.map(({ task, title, week }) => <th key={task} scope="col"><span class="quiet-text">{text.teach.course.week(week)}</span>{title ?? nameInWords(task)}</th>)}</tr></thead>
        <tbody>{rows.map((row) => (
          <tr key={row.name}>
            <th scope="row">{row.full_name ?? row.name}{row.behind && <> <Badge kind="act" icon="act">{text.teach.course.overdue}</Badge></>}</th>
            {row.cells.map((cell, at) => <td key={progress.tasks[at]!.task}><CellButton row={row} task={progress.tasks[at]!} cell={cell} pressed={chosen?.trainee === row.name && chosen.task === progress.tasks[at]!.task} choose={choose} /></td>)}
          </tr>))}</tbody>
      </table>
    </div>
  );
}

function CellButton({ row, task, cell, pressed, choose }: { row: ProgressRow; task: Progress["tasks"][number]; cell: Cell; pressed: boolean; choose: MatrixProps["choose"] }) {
  const words = text.teach.progress;
  const state = stateOf(cell);
  return (
    <button type="button" class={`cell ${state}`} aria-pressed={pressed} aria-label={words.cell(row.full_name ?? row.name, task.title ?? nameInWords(task.task), words.states[state]!, cell.attempts)}
      onClick={() => choose(row.name, task.task)}><Shape state={state} /><span class="number">{words.tries(cell.attempts)}</span></button>
  );
}

// ---- one trainee's attempts at one task --------------------------------------------------------------------------

function Attempts({ app, course, trainee, task }: { app: App; course: string; trainee: string; task: string }) {
  const words = text.teach.progress;
  const attempts = useLoaded(async () => (await app.api.get<{ attempts: AttemptRow[] }>("/attempts", { trainee, task, limit: 200 })).attempts, [trainee, task]);
  return (
    <section class="panel progress-detail" aria-label={words.attempts(trainee, nameInWords(task))}>
      <h2>{words.attempts(trainee, nameInWords(task))}</h2>
      <CurveOf app={app} course={course} trainee={trainee} task={task} />
      <Await of={attempts}>{(rows) => rows.length === 0 ? <Empty title={words.none} /> : <AttemptTable rows={rows} rate />}</Await>
    </section>
  );
}

export function AttemptTable({ rows, rate = false }: { rows: readonly AttemptRow[]; rate?: boolean }) {
  const words = text.teach.progress;
  return <Table caption={words.attemptTable} rows={rows} keyOf={({ session, number }) => `${session} ${number}`} columns={[
    { label: words.columns.when, cell: (row) => <span class="number">{format.time(row.begun_utc_s * 1000)}</span> },
    { label: words.columns.hand, cell: ({ hand }) => words.handShort[hand] },
    { label: words.columns.time, number: true, cell: ({ time_s }) => (time_s === null ? format.none : format.clock(time_s)) },
    { label: words.columns.errors, number: true, cell: ({ errors }) => format.number(errors ?? undefined) },
    { label: words.columns.verdict, cell: ({ verdict }) => <VerdictBadge verdict={verdict} /> },
    { label: words.debrief, hidden: true, cell: ({ session, number }) => <span class="row-actions">
      <a class="button quiet small" href={routeTo("session", [session], { attempt: String(number) })}>{words.debrief}</a>
      {rate && <a class="button quiet small" href={routeTo("rate", [session, String(number)])}>{words.rate}</a>}</span> },
  ]} />;
}

/** The learning curve with pass line and quartiles, and LC-CUSUM below. */
export function CurveOf({ app, course, trainee, task }: { app: App; course: string | undefined; trainee?: string; task: string }) {
  const words = text.teach.progress;
  const loaded = useLoaded(() => app.api.get<Curve>("/curve", { task, trainee, course }), [task, trainee, course]);
  return <Await of={loaded}>{(curve) => curve.attempts.length === 0 ? <Empty title={words.none} /> : <Curves curve={curve} />}</Await>;
}

function Curves({ curve }: { curve: Curve }) {
  const words = text.teach.progress;
  const drawn = useMemo(() => {
    const x = curve.attempts.map((_, at) => at + 1);
    const of = (verdict: string): (number | null)[] => curve.attempts.map((one) => (one.verdict === verdict ? one.time_s : null));
    const quartile = (at: number): (number | null)[] => x.map((n) => curve.course.find(({ attempt }) => attempt === n)?.quartiles[at] ?? null);
    const times: Series[] = [
      { label: words.passedDot, unit: "s", colour: "--plot-3", values: of("passed"), kind: "points" },
      { label: words.failed, unit: "s", colour: "--plot-4", values: of("not yet"), kind: "points" },
      { label: words.attempt, unit: "s", colour: "--plot-1", values: curve.attempts.map(({ time_s }) => time_s) },
      ...(curve.course.length ? [0, 2].map((at): Series => ({ label: words.quartiles, unit: "s", colour: "--text-quiet", values: quartile(at), dashed: true })) : []),
    ];
    return {
      x, times, pass: [{ y: curve.mark.time_s, colour: "--good", label: words.passLine }],
      scores: curve.cusum ? [{ label: words.cusum, digits: 2, colour: "--plot-2", values: curve.cusum.scores, kind: "steps" } satisfies Series] : [],
      limit: curve.cusum ? [{ y: curve.cusum.h, colour: "--good", label: words.limit }] : [],
    };
  }, [curve]);
  const { cusum } = curve;
  return (
    <div class="curves">
      <div><h3>{words.curve}</h3><Chart label={words.curveOf} x={drawn.x} series={drawn.times} least={0} marks={drawn.pass} /></div>
      {cusum && <div><h3>{words.cusum}</h3>
        <Chart label={words.cusum} x={drawn.x} series={drawn.scores} least={0} marks={drawn.limit} height={160} />
        <p><Badge kind={cusum.competent_at ? "good" : ""} icon={cusum.competent_at ? "quiet" : "waiting"}>{cusum.competent_at ? words.competent(cusum.competent_at) : words.notCompetent}</Badge>
          {cusum.relapses.length > 0 && <> <Badge kind="act" icon="act">{words.relapses(cusum.relapses.join(", "))}</Badge></>}</p>
        <p class="hint">{words.cusumHint(format.percent(cusum.p0, 0), format.percent(cusum.p1, 0), format.number(cusum.h, 1))}</p></div>}
    </div>
  );
}
