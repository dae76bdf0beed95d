// The editor of a course: the library left, weeks as columns, the chosen task right.
import { useEffect, useState } from "preact/hooks";
import { part } from "../api";
import type { App } from "../app";
import { explain } from "../explain";
import { nameInWords } from "../groups";
import { Await, Badge, Button, confirm, Empty, Field, Head, openDialog, Select, toast, toastFault, useLoaded } from "../kit";
import { routeTo } from "../router";
import type { Curricula, Item, Mark, Task } from "../teach/model";
import { Errors, Goals } from "../teach/limits_words";
import { add, move, ready, remove, weeksOf } from "../teach/plan";
import { format, text } from "../text";

export function Plan({ app, course }: { app: App; course: string }) {
  const words = text.teach.plan;
  app.title(words.title(course));
  const loaded = useLoaded(async () => {
    const [{ tasks }, plan, { courses }] = await Promise.all([app.api.get<{ tasks: Task[] }>("/tasks"),
      app.api.get<Curricula>(`/courses/${part(course)}/curriculum`), app.api.get<{ courses: { name: string }[] }>("/courses")]);
    return { tasks, plan, courses: courses.map(({ name }) => name) };
  }, [course]);
  return <Await of={loaded}>{({ tasks, plan, courses }) => <Editor key={plan.version} app={app} course={course} courses={courses} library={tasks} plan={plan} />}</Await>;
}

interface EditorProps {
  app: App;
  course: string;
  courses: readonly string[];
  library: readonly Task[];
  plan: Curricula;
}

function Editor({ app, course, courses, library, plan }: EditorProps) {
  const words = text.teach.plan;
  const from = plan.draft ?? plan.curriculum;
  const [items, setItems] = useState<Item[]>(from?.tasks ?? []);
  const [version, setVersion] = useState(plan.version);
  const [state, setState] = useState<string>(from?.state ?? "none");
  const [weeks, setWeeks] = useState(Math.max(4, ...items.map(({ week }) => week)));
  const [chosen, setChosen] = useState<string>();
  const frozen = state === "frozen";
  const save = async (next: "draft" | "published" | "frozen", said: string): Promise<void> => {
    const answer = await app.api.put<Curricula>(`/courses/${part(course)}/curriculum`, { version, state: next, ...(next === "frozen" ? {} : { tasks: items.map(ready) }) });
    setVersion(answer.version);
    setState(next);
    toast(said);
  };
  const change = (next: Item[]): void => {
    setItems(next);
    if (state === "published") setState("draft");
  };
  const item = items.find(({ task }) => task === chosen);
  const titleOf = (name: string): string => library.find((task) => task.name === name)?.title ?? nameInWords(name);
  return <>
    <Head title={words.title(course)}>
      <Badge kind={state === "published" || frozen ? "good" : "look"}>{words.states[state] ?? state}</Badge>
      <a class="button" href={routeTo("courses", [course])}>{text.teach.courses.progress}</a>
      <Button onClick={() => preview(items, titleOf)}>{words.preview}</Button>
      {!frozen && <Button disabled={!items.length} onClick={() => void save("draft", words.saved).catch(toastFault)}>{words.save}</Button>}
      {!frozen && <Button kind="primary" disabled={!items.length} onClick={() => confirm(words.publishTitle, words.publishHint, words.publish, () => save("published", words.published))}>{words.publish}</Button>}
      {state === "published" && <Button onClick={() => confirm(words.freezeTitle, words.freezeHint, words.freeze, () => save("frozen", words.frozen))}>{words.freeze}</Button>}
    </Head>
    <div class="plan">
      <section class="panel plan-library" aria-label={words.library}><h2>{words.library}</h2>
        <ul>{library.filter(({ name }) => !items.some(({ task }) => task === name)).map(({ name, title }) => (
          <li key={name}><span>{title}</span><Button class="small" icon="plus" disabled={frozen} aria-label={words.addTo(title, 1)} onClick={() => {
            change(add(items, name, 1));
            setChosen(name);
          }}>{words.add}</Button></li>))}</ul>
      </section>
      <section class="plan-weeks" aria-label={words.weeks} tabIndex={0}>
        {weeksOf(items, weeks).map(({ week, tasks }) => (
          <div key={week} class="panel plan-week"><h2>{words.week(week)}</h2>
            <ol>{tasks.map(({ task, passes }) => <li key={task}><button type="button" class="plan-task" aria-pressed={task === chosen} onClick={() => setChosen(task)}><b>{titleOf(task)}</b><span class="quiet-text">{words.inRow(passes)}</span></button></li>)}</ol></div>))}
        {!frozen && <Button onClick={() => setWeeks(weeks + 1)}>{words.addWeek}</Button>}
        {items.length === 0 && <p class="quiet-text">{words.empty}</p>}
      </section>
      <section class="panel plan-inspector" aria-label={words.inspector}>
        {item ? <Inspector key={item.task} app={app} course={course} courses={courses} item={item} task={library.find(({ name }) => name === item.task)} title={titleOf(item.task)} others={items.filter(({ task }) => task !== item.task).map(({ task }) => task)}
          frozen={frozen} titleOf={titleOf} change={(changed) => change(items.map((one) => (one.task === changed.task ? changed : one)))}
          move={(by) => change(move(items, item.task, by, weeks))} remove={() => change(remove(items, item.task))} />
          : <p class="quiet-text">{words.choose}</p>}
      </section>
    </div>
  </>;
}

function preview(items: readonly Item[], titleOf: (task: string) => string): void {
  const words = text.teach;
  openDialog({ title: words.plan.previewTitle, body: () => items.length === 0 ? <Empty title={words.plan.empty} /> : (
    <ol class="plan-preview">{[...items].sort((a, b) => a.week - b.week).map(({ task, week, passes, hands }) => (
      <li key={task}><b>{titleOf(task)}</b><span class="quiet-text">{[words.course.week(week), words.train.passes(0, passes), words.plan.handsOf[hands]].join(" · ")}</span></li>))}</ol>) });
}

interface InspectorProps {
  app: App;
  course: string;
  courses: readonly string[];
  item: Item;
  task: Task | undefined;
  title: string;
  others: readonly string[];
  frozen: boolean;
  titleOf(task: string): string;
  change(item: Item): void;
  move(by: number): void;
  remove(): void;
}

const day = (utc: number | null): string => (utc === null ? "" : new Date(utc * 1000).toISOString().slice(0, 10));

function Inspector({ app, course, courses, item, task, title, others, frozen, titleOf, change, move: moveBy, remove: drop }: InspectorProps) {
  const words = text.teach.plan;
  return <>
    <h2>{title}</h2>
    {!frozen && <div class="plan-move"><Button class="small" icon="previous" onClick={() => moveBy(-1)}>{words.earlier}</Button><Button class="small" icon="next" onClick={() => moveBy(1)}>{words.later}</Button></div>}
    <Field label={words.passes}><input type="number" min={1} max={10} disabled={frozen} value={item.passes} onInput={(event) => change({ ...item, passes: Math.min(10, Math.max(1, Math.round(event.currentTarget.valueAsNumber || 1))) })} /></Field>
    <Field label={words.hands}><Select options={[["each", words.handsOf.each!], ["one", words.handsOf.one!]]} value={item.hands} disabled={frozen} onChoose={(hands) => change({ ...item, hands: hands as Item["hands"] })} /></Field>
    <Field label={words.due}><input type="date" disabled={frozen} value={day(item.due_utc_s)} onInput={(event) => change({ ...item, due_utc_s: event.currentTarget.value ? Date.parse(`${event.currentTarget.value}T23:59:59`) / 1000 : null })} /></Field>
    {others.length > 0 && <fieldset class="plan-after" disabled={frozen}><legend>{words.after}</legend>{others.map((task) => (
      <label key={task}><input type="checkbox" checked={item.after.includes(task)} onChange={(event) => change({ ...item, after: event.currentTarget.checked ? [...item.after, task] : item.after.filter((one) => one !== task) })} /> {titleOf(task)}</label>))}</fieldset>}
    {!frozen && <Button class="small" onClick={drop}>{words.remove}</Button>}
    <MarkEditor app={app} course={course} courses={courses} task={item.task} />
    {task && <details class="plan-groups"><summary>{text.teach.goalsAsk}</summary><Goals task={task} /></details>}
    {task && <details class="plan-groups"><summary>{text.teach.errorsCount}</summary><Errors task={task} /></details>}
  </>;
}

// ---- the pass mark ----------------------------------------------------------------------------------------------

interface Trials {
  attempts: number;
  would_pass: number;
  bins: { from_s: number; to_s: number; count: number }[];
}

interface Contrast {
  cut_s: number | null;
  upper_fail_share: number | null;
  lower_pass_share: number | null;
}

function MarkEditor({ app, course, courses, task }: { app: App; course: string; courses: readonly string[]; task: string }) {
  const loaded = useLoaded(async () => (await app.api.get<{ mark: Mark }>(`/tasks/${part(task)}/mark`)).mark, [task]);
  return <Await of={loaded}>{(mark) => <MarkForm key={mark.version} app={app} course={course} courses={courses} task={task} mark={mark} reload={loaded.reload} />}</Await>;
}

function MarkForm({ app, course, courses, task, mark, reload }: { app: App; course: string; courses: readonly string[]; task: string; mark: Mark; reload: () => void }) {
  const words = text.teach.plan;
  const [time, setTime] = useState(mark.time_s);
  const [errors, setErrors] = useState(mark.errors);
  const [kind, setKind] = useState(mark.kind === "task file" ? "by hand" : mark.kind);
  const [source, setSource] = useState("");
  const [fault, setFault] = useState("");
  const [trials, setTrials] = useState<Trials>();
  useEffect(() => {
    let ended = false;
    const timer = setTimeout(() => void app.api.get<Trials>(`/tasks/${part(task)}/trials`, { time_s: time, errors }).then((found) => !ended && setTrials(found), () => undefined), 150);
    return () => {
      ended = true;
      clearTimeout(timer);
    };
  }, [task, time, errors]);
  const save = async (): Promise<void> => {
    if (!source.trim()) {
      setFault(words.sourceNeeded);
      return;
    }
    try {
      const { mark: saved } = await app.api.put<{ mark: Mark }>(`/tasks/${part(task)}/mark`, { kind, source: source.trim(), time_s: time, errors, version: mark.version });
      toast(words.markSaved(saved.version));
      reload();
    } catch (error) {
      setFault(explain(error));
    }
  };
  return (
    <section class="plan-mark" aria-label={words.markTitle}><h3>{words.markTitle}</h3>
      <p class="quiet-text">{words.markVersion(mark.version, mark.source)}</p>
      <label class="sentence">{words.timeBefore} <input type="number" min={1} max={3600} value={time} onInput={(event) => setTime(Math.max(1, event.currentTarget.valueAsNumber || 1))} /> {words.timeAfter}</label>
      {trials && <Histogram trials={trials} time={time} />}
      <input class="range plan-range" type="range" aria-label={words.markSlider} min={1} max={Math.max(60, mark.time_s * 2, trials?.bins.at(-1)?.to_s ?? 0)} step={1} value={time} onInput={(event) => setTime(event.currentTarget.valueAsNumber)} />
      <label class="sentence">{words.errorsBefore} <input type="number" min={0} max={1000} value={errors} onInput={(event) => setErrors(Math.max(0, Math.round(event.currentTarget.valueAsNumber || 0)))} /> {words.errorsAfter}</label>
      {trials && <p class="would-pass number" role="status"><b>{words.wouldPass(trials.would_pass, trials.attempts)}</b></p>}
      <Groups app={app} task={task} courses={courses} course={course} take={(cut, from) => {
        setTime(Math.round(cut));
        setKind("contrasting groups");
        setSource(from);
      }} />
      <Field label={words.kind}><Select options={(["by hand", "contrasting groups", "published"] as const).map((one) => [one, words.kinds[one]!])} value={kind} onChoose={(one) => setKind(one as typeof kind)} /></Field>
      <Field label={words.source} hint={words.sourceHint}><input value={source} maxLength={200} onInput={(event) => {
        setSource(event.currentTarget.value);
        setFault("");
      }} /></Field>
      <p class="fault" role="alert">{fault}</p>
      <Button kind="primary" onClick={() => void save()}>{words.saveMark}</Button>
    </section>
  );
}

function Histogram({ trials, time }: { trials: Trials; time: number }) {
  const words = text.teach.plan;
  const { bins } = trials;
  if (!bins.length) return null;
  const most = Math.max(1, ...bins.map(({ count }) => count));
  const end = Math.max(bins.at(-1)!.to_s, time);
  return (
    <svg class="histogram" viewBox="0 0 100 40" preserveAspectRatio="none" role="img" aria-label={`${words.histogram}: ${bins.map(({ from_s, to_s, count }) => words.bin(format.clock(from_s), format.clock(to_s), count)).join("; ")}`}>
      {bins.map(({ from_s, to_s, count }) => <rect key={from_s} class={to_s <= time ? "in" : ""} x={(100 * from_s) / end} y={40 - (38 * count) / most} width={Math.max(0.5, (100 * (to_s - from_s)) / end - 0.5)} height={(38 * count) / most} />)}
      <line x1={(100 * time) / end} x2={(100 * time) / end} y1={0} y2={40} />
    </svg>
  );
}

function Groups({ app, task, courses, course, take }: { app: App; task: string; courses: readonly string[]; course: string; take: (cut: number, source: string) => void }) {
  const words = text.teach.plan;
  const [upper, setUpper] = useState(courses.find((one) => one !== course) ?? course);
  const [lower, setLower] = useState(course);
  const [said, setSaid] = useState("");
  if (courses.length < 2) return null;
  const options = courses.map((one): [string, string] => [one, one]);
  const suggest = async (): Promise<void> => {
    try {
      const found = await app.api.get<Contrast>(`/tasks/${part(task)}/contrast`, { upper, lower });
      if (found.cut_s === null) {
        setSaid(words.noCut);
        return;
      }
      take(found.cut_s, `${words.kinds["contrasting groups"]!}: ${upper}, ${lower}`);
      setSaid(words.suggested(format.clock(found.cut_s), format.percent(found.upper_fail_share ?? undefined, 0), format.percent(found.lower_pass_share ?? undefined, 0)));
    } catch (error) {
      setSaid(explain(error));
    }
  };
  return (
    <details class="plan-groups"><summary>{words.groups}</summary>
      <Field label={words.upper}><Select options={options} value={upper} onChoose={setUpper} /></Field>
      <Field label={words.lower}><Select options={options} value={lower} onChoose={setLower} /></Field>
      <Button class="small" onClick={() => void suggest()}>{words.suggest}</Button><p class="hint" role="status">{said}</p>
    </details>
  );
}
