// #/research: the attempts of a course by task, time and purpose; all about them as one archive.
import { useState } from "preact/hooks";
import { part } from "../api";
import type { App } from "../app";
import { Await, Empty, Field, Head, Icon, Listing, Select, useLoaded, view, type ViewProps } from "../kit";
import { routeTo } from "../router";
import type { AttemptRow, Task } from "../teach/model";
import { format, text } from "../text";
import { VerdictBadge } from "./verdict";

const LIMIT = 500;

interface Question {
  course: string;
  task: string;
  from: string;
  to: string;
  purpose: string;
}

export const research = view(({ app }: ViewProps) => {
  const words = text.teach.research;
  app.title(words.title);
  const loaded = useLoaded(async () => {
    const [{ courses }, { tasks }] = await Promise.all([app.api.get<{ courses: { name: string }[] }>("/courses"), app.api.get<{ tasks: Task[] }>("/tasks")]);
    return { courses: courses.map(({ name }) => name), tasks };
  });
  return <>
    <Head title={words.title} hint={words.hint} />
    <Await of={loaded}>{({ courses, tasks }) => courses.length === 0 ? <Empty title={text.teach.courses.none} hint={text.teach.courses.noneHint} /> : <Query app={app} courses={courses} tasks={tasks} />}</Await>
  </>;
});

const seconds = (day: string, end: boolean): number | undefined => (day ? Date.parse(`${day}T${end ? "23:59:59" : "00:00:00"}`) / 1000 : undefined);

/** All attempts of the course; the dates of the question narrow them. */
function archiveOf({ course, task, from, to }: Question): string {
  const narrowed = Object.entries({ task, from: seconds(from, false), to: seconds(to, true) }).filter(([, value]) => value !== undefined && value !== "");
  const search = narrowed.length ? `?${new URLSearchParams(narrowed.map(([key, value]) => [key, String(value)]))}` : "";
  return `/api/v1/courses/${part(course)}/export${search}`;
}

function Query({ app, courses, tasks }: { app: App; courses: readonly string[]; tasks: readonly Task[] }) {
  const words = text.teach.research;
  const [asked, setAsked] = useState<Question>({ course: courses[0]!, task: "", from: "", to: "", purpose: "" });
  const set = (of: Partial<Question>): void => setAsked({ ...asked, ...of });
  const [more, setMore] = useState(false);
  const rows = useLoaded(async () => {
    const found = await app.api.get<{ attempts: AttemptRow[]; next: string | null }>("/attempts",
      { course: asked.course, task: asked.task, from: seconds(asked.from, false), to: seconds(asked.to, true), purpose: asked.purpose, limit: LIMIT });
    setMore(found.next !== null);
    return found.attempts;
  }, [asked]);
  return <>
    <div class="panel query">
      <Field label={words.course}><Select options={courses.map((one) => [one, one])} value={asked.course} onChoose={(course) => set({ course })} /></Field>
      <Field label={words.task}><Select options={[["", words.allTasks], ...tasks.map(({ name, title }): [string, string] => [name, title])]} value={asked.task} onChoose={(task) => set({ task })} /></Field>
      <Field label={words.purpose}><Select options={Object.entries(words.purposes)} value={asked.purpose} onChoose={(purpose) => set({ purpose })} /></Field>
      <Field label={words.from}><input type="date" value={asked.from} onInput={(event) => set({ from: event.currentTarget.value })} /></Field>
      <Field label={words.to}><input type="date" value={asked.to} onInput={(event) => set({ to: event.currentTarget.value })} /></Field>
      <div class="query-do"><a class="button primary" href={archiveOf(asked)} download><Icon name="file" />{words.download}</a><p class="hint">{words.archiveHint}</p></div>
    </div>
    <p class="number" role="status">{rows.value ? words.found(rows.value.length, more) : ""}</p>
    <Listing caption={words.title} of={rows} keyOf={({ session, number }) => `${session} ${number}`} none={<Empty title={words.none} />} columns={[
      { label: words.columns.when, cell: (row) => <a class="number" href={routeTo("session", [row.session], { attempt: String(row.number) })}>{format.time(row.begun_utc_s * 1000)}</a> },
      { label: words.columns.trainee, cell: ({ trainee }) => trainee ?? format.none },
      { label: words.columns.task, cell: ({ title }) => title },
      { label: words.columns.hand, wide: true, cell: ({ hand }) => text.teach.progress.handShort[hand] },
      { label: words.columns.goals, number: true, wide: true, cell: ({ goals, goals_met }) => (goals_met === null ? format.none : `${goals_met}/${goals}`) },
      { label: words.columns.time, number: true, cell: ({ time_s }) => (time_s === null ? format.none : format.clock(time_s)) },
      { label: words.columns.errors, number: true, cell: ({ errors }) => format.number(errors ?? undefined) },
      { label: words.columns.verdict, cell: ({ verdict }) => <VerdictBadge verdict={verdict} /> },
    ]} />
  </>;
}
