// #/exams: all exams; #/exams/ID: checklist, sealed start, interventions, release, signed result.
import { useState } from "preact/hooks";
import { part } from "../api";
import type { App } from "../app";
import { explain } from "../explain";
import { nameInWords } from "../groups";
import { Await, Badge, Button, confirm, Empty, Field, Form, Head, Icon, Listing, openDialog, openForm, Select, Table, toast, toastFault, useLoaded, view, type ViewProps } from "../kit";
import { Watch_What } from "../live";
import { useStations, useWatch } from "../kit";
import { routeTo } from "../router";
import { beginCommand } from "../teach/live_attempt";
import type { Exam, ExamItem, Task } from "../teach/model";
import { format, text } from "../text";
import { VerdictBadge } from "./verdict";
import { nameOf } from "./wall_model";

export const exams = view(({ route, app }: ViewProps) => {
  const [id] = route.args;
  return id ? <One key={id} app={app} id={id} /> : <All app={app} />;
});

const KINDS = { planned: "look", begun: "act", done: "look", released: "good" } as const;

function State({ exam }: { exam: Exam }) {
  const words = text.teach.exam;
  return <><Badge kind={KINDS[exam.state]}>{words.states[exam.state]}</Badge>{exam.flagged && <> <Badge kind="act" icon="act">{words.flagged}</Badge></>}</>;
}

function All({ app }: { app: App }) {
  const words = text.teach.exam;
  app.title(words.title);
  const all = useLoaded(async () => (await app.api.get<{ exams: Exam[] }>("/exams")).exams);
  return <>
    <Head title={words.title}><a class="button" href={routeTo("rate")}>{text.teach.rate.list}</a><Button kind="primary" icon="plus" onClick={() => void plan(app).catch(toastFault)}>{words.add}</Button></Head>
    <Listing caption={words.title} of={all} keyOf={({ id }) => id} none={<Empty title={words.none} hint={words.noneHint} />} columns={[
      { label: words.columns.title, cell: ({ id, title }) => <a href={routeTo("exams", [id])}>{title}</a> },
      { label: words.columns.trainee, cell: ({ trainee }) => trainee ?? words.anybody },
      { label: words.columns.course, cell: ({ course }) => course },
      { label: words.columns.state, cell: (exam) => <State exam={exam} /> },
      { label: words.columns.created, cell: ({ created_utc_s }) => <span class="number">{format.date(created_utc_s * 1000)}</span> },
    ]} />
  </>;
}

// ---- a new one ------------------------------------------------------------------------------------------------

interface Choices {
  courses: string[];
  tasks: Task[];
  cases: string[];
  raters: string[];
}

async function plan(app: App): Promise<void> {
  const words = text.teach.exam;
  const [{ courses }, { tasks }, { cases }, { accounts }] = await Promise.all([
    app.api.get<{ courses: { name: string }[] }>("/courses"), app.api.get<{ tasks: Task[] }>("/tasks"),
    app.api.get<{ cases: { name: string }[] }>("/cases"), app.api.get<{ accounts: { name: string; role: string }[] }>("/accounts")]);
  const names = (all: { name: string }[]): string[] => all.map(({ name }) => name);
  // Who plans an exam knows whose it is.
  const raters = names(accounts.filter(({ role, name }) => role === "instructor" && name !== app.account?.name));
  const choices = { courses: names(courses), tasks, cases: names(cases), raters };
  openDialog({ title: words.add, wide: true, body: (close) => <PlanForm app={app} choices={choices} close={close} /> });
}

function PlanForm({ app, choices, close }: { app: App; choices: Choices; close: () => void }) {
  const words = text.teach.exam;
  const [course, setCourse] = useState(choices.courses[0] ?? "");
  const people = useLoaded(async () => (course ? (await app.api.get<{ course: { trainees: { name: string; full_name: string | null }[] } }>(`/courses/${part(course)}`)).course.trainees : []), [course]);
  const [trainee, setTrainee] = useState("");
  const [picked, setPicked] = useState<Record<"tasks" | "cases" | "raters", string[]>>({ tasks: [], cases: [], raters: [] });
  const who = trainee || (people.value?.[0]?.name ?? "");
  const boxes = (kind: "tasks" | "cases" | "raters", label: string, all: readonly (readonly [string, string])[]) => (
    <fieldset class="picks"><legend>{label}</legend>{all.map(([name, title]) => (
      <label key={name}><input type="checkbox" checked={picked[kind].includes(name)} onChange={(event) => setPicked({ ...picked, [kind]: event.currentTarget.checked ? [...picked[kind], name] : picked[kind].filter((one) => one !== name) })} /> {title}</label>))}</fieldset>);
  return (
    <Form label={words.add} cancel={close} send={async ({ title = "" }) => {
      if (!picked.tasks.length || !picked.cases.length) throw new Error(words.chooseTasks);
      const { exam } = await app.api.post<{ exam: Exam }>("/exams", { course, trainee: who, title: title.trim(), tasks: picked.tasks, cases: picked.cases, raters: picked.raters });
      close();
      location.hash = routeTo("exams", [exam.id]);
    }}>
      <Field label={words.name}><input name="title" maxLength={63} /></Field>
      <Field label={words.course}><Select name="course" options={choices.courses.map((one) => [one, one])} value={course} onChoose={setCourse} /></Field>
      <Field label={words.trainee}><Select name="trainee" options={(people.value ?? []).map(({ name, full_name }) => [name, full_name ?? name])} value={who} onChoose={setTrainee} /></Field>
      {boxes("tasks", words.tasks, choices.tasks.map(({ name, title }) => [name, title]))}
      {boxes("cases", words.cases, choices.cases.map((one) => [one, one]))}
      {boxes("raters", words.raters, choices.raters.map((one) => [one, one]))}
    </Form>
  );
}

// ---- one exam ---------------------------------------------------------------------------------------------------

function One({ app, id }: { app: App; id: string }) {
  const words = text.teach.exam;
  const loaded = useLoaded(async () => (await app.api.get<{ exam: Exam }>(`/exams/${part(id)}`)).exam, [id]);
  return <Await of={loaded}>{(exam) => {
    app.title(exam.title);
    return <>
      <Head title={exam.title} hint={[exam.trainee ?? words.anybody, exam.course, exam.seed === undefined ? "" : words.seed(exam.seed)].filter(Boolean).join(" · ")}>
        <State exam={exam} /><a class="button" href={routeTo("exams")}>{words.back}</a>
        {exam.state === "begun" && <Button onClick={() => intervene(app, exam, loaded.reload)}>{words.intervene}</Button>}
        {(exam.state === "begun" || exam.state === "done") && <Button kind={exam.state === "done" ? "primary" : "plain"} onClick={() => release(app, exam, loaded.reload)}>{exam.state === "done" ? words.release : words.incomplete}</Button>}
      </Head>
      {exam.state === "planned" && <Checklist app={app} exam={exam} reload={loaded.reload} />}
      <Items app={app} exam={exam} />
      {exam.interventions.length > 0 && <section class="panel exam-part"><h2>{words.flagged}</h2><ul>{exam.interventions.map(({ utc_s, reason }) => <li key={utc_s}><span class="number">{format.time(utc_s * 1000)}</span>: {reason}</li>)}</ul></section>}
      {exam.result && <Result exam={exam} />}
    </>;
  }}</Await>;
}

function Checklist({ app, exam, reload }: { app: App; exam: Exam; reload: () => void }) {
  const words = text.teach.exam;
  const [ticked, setTicked] = useState({ who: false, station_check: false, case_hash: false });
  const [drift, setDrift] = useState("");
  const [fault, setFault] = useState("");
  const labels = { who: words.who, station_check: words.stationCheck, case_hash: words.caseHash };
  const ready = Object.values(ticked).every(Boolean) && drift !== "";
  const begin = (): void => void app.api.post(`/exams/${part(exam.id)}/begin`, { ...ticked, drift_mm: Number(drift) }).then(reload, (error: unknown) => setFault(explain(error)));
  return (
    <section class="panel exam-part"><h2>{words.checklist}</h2>
      {(Object.keys(labels) as (keyof typeof labels)[]).map((key) => <label key={key} class="exam-check"><input type="checkbox" checked={ticked[key]} onChange={(event) => setTicked({ ...ticked, [key]: event.currentTarget.checked })} /> {labels[key]}</label>)}
      <Field label={words.drift}><input type="number" min={0} max={10} step={0.1} value={drift} onInput={(event) => setDrift(event.currentTarget.value)} /></Field>
      <p class="quiet-text">{words.beginHint}</p><p class="fault" role="alert">{fault}</p>
      <Button kind="primary" disabled={!ready} onClick={begin}>{words.begin}</Button>
    </section>
  );
}

function Items({ app, exam }: { app: App; exam: Exam }) {
  const words = text.teach.exam;
  const begun = exam.state === "begun";
  return (
    <section class="panel exam-part"><h2>{words.items}{begun && <> <Badge kind="act" icon="act">{words.sealed}</Badge></>}</h2>
      <Table caption={words.items} rows={exam.items} keyOf={({ task, case: knee }) => `${task} ${knee}`} columns={[
        { label: words.task, cell: ({ task }) => nameInWords(task) },
        { label: words.case, cell: ({ case: knee }) => knee },
        { label: words.hand, cell: ({ hand }) => (hand ? text.teach.progress.handShort[hand] : format.none) },
        { label: words.verdict, cell: ({ number, verdict }) => (number === null ? format.none : <VerdictBadge verdict={verdict} />) },
        { label: words.start, hidden: true, cell: (item) => <span class="row-actions">{item.session !== null && item.number !== null
          ? <a class="button quiet small" href={routeTo("rate", [item.session, String(item.number)])}>{words.rate}</a>
          : begun && <Button kind="quiet" class="small" onClick={() => start(app, item)}>{words.start}</Button>}</span> },
      ]} />
    </section>
  );
}

/** The examiner begins each attempt at the trainee's station. */
function start(app: App, item: ExamItem): void {
  openDialog({ title: text.teach.exam.start, body: (close) => <Start app={app} item={item} close={close} /> });
}

function Start({ app, item, close }: { app: App; item: ExamItem; close: () => void }) {
  const words = text.teach.exam;
  useWatch(app.feed, "wall", () => ({ what: Watch_What.WALL, rateHz: 1 }));
  const stations = useStations(app.feed).value.filter(({ place }) => place?.info?.connected).map(nameOf);
  return (
    <Form label={words.start} cancel={close} send={async ({ station = "" }) => {
      const reply = await app.feed.command(beginCommand(station, item.task, "exam", item.hand ?? "right"));
      if (!reply.ok) throw new Error(reply.text);
      toast(words.started);
      close();
    }}><Field label={words.station}><Select name="station" options={stations.map((one) => [one, one])} /></Field></Form>
  );
}

function intervene(app: App, exam: Exam, reload: () => void): void {
  const words = text.teach.exam;
  openForm(words.intervene, words.intervene, <Field label={words.reason} hint={words.reasonHint}><textarea name="reason" maxLength={240} rows={2} /></Field>,
    async ({ reason = "" }) => {
      await app.api.post(`/exams/${part(exam.id)}/interventions`, { reason: reason.trim() });
      return reload;
    }, ({ reason = "" }) => ({ reason: reason.trim().length < 3 ? words.reasonNeeded : "" }));
}

function release(app: App, exam: Exam, reload: () => void): void {
  const words = text.teach.exam;
  confirm(words.releaseTitle, words.releaseHint, words.release, async () => {
    await app.api.post(`/exams/${part(exam.id)}/release`, exam.state === "begun" ? { incomplete: true } : {});
    toast(words.released);
    return reload;
  });
}

function Result({ exam }: { exam: Exam }) {
  const words = text.teach.exam;
  const result = exam.result!;
  return (
    <section class="panel exam-part"><h2><Icon name="quiet" /> {words.result}</h2>
      <VerdictBadge verdict={exam.verdict} />
      <dl class="exam-signed"><dt>{words.signedBy}</dt><dd>{result.signed_by}</dd><dt>{words.hash}</dt><dd><code>{result.hash}</code></dd><dt>{words.signature}</dt><dd><code>{result.signature}</code></dd></dl>
    </section>
  );
}
