// #/courses: all courses, and who is in them; #/courses/NAME: who has come how far; #/courses/NAME/plan: the editor.
import { useSignal } from "@preact/signals";
import { useRef } from "preact/hooks";
import { part } from "../api";
import type { App } from "../app";
import { Await, Button, confirm, Empty, Field, Head, Listing, openDialog, openForm, RowButton, Select, toastFault, useLoaded, view, type ViewProps } from "../kit";
import { routeTo } from "../router";
import { format, text } from "../text";
import { Plan } from "./plan";
import { CourseProgress } from "./progress";

interface Course {
  name: string;
  trainees: number;
  created_utc_s: number;
}

interface Person {
  name: string;
  full_name: string | null;
}

export const courses = view(({ route, app }: ViewProps) => {
  const [name, what] = route.args;
  if (!name) return <Courses app={app} />;
  return what === "plan" ? <Plan key={name} app={app} course={name} /> : <CourseProgress key={name} app={app} course={name} />;
});

const ROW_LINK = "button quiet small";

function Courses({ app }: { app: App }) {
  const t = text.teach.courses;
  app.title(text.views.courses);
  const list = useLoaded(async () => (await app.api.get<{ courses: Course[] }>("/courses")).courses);
  const remove = (course: Course): void => confirm(t.removeTitle(course.name), t.removeHint, t.remove, async () => {
    await app.api.delete(`/courses/${part(course.name)}`);
    list.reload();
  });
  return (
    <>
      <Head title={text.views.courses} hint={t.hint}>
        <a class="button" href={routeTo("exams")}>{t.exams}</a><a class="button" href={routeTo("research")}>{t.research}</a><Button kind="primary" icon="plus" onClick={() => make(app, list.reload)}>{t.add}</Button>
      </Head>
      <Listing caption={text.views.courses} of={list} none={<Empty title={t.none} hint={t.noneHint} />} keyOf={(course) => course.name} columns={[
        { label: t.name, cell: (course) => <a href={routeTo("courses", [course.name])}>{course.name}</a> },
        { label: t.trainees, number: true, cell: (course) => format.number(course.trainees) },
        { label: t.created, cell: (course) => <span class="number">{format.date(course.created_utc_s * 1000)}</span> },
        { label: t.actions, hidden: true, cell: (course) => (
          <span class="row-actions">
            <a class={ROW_LINK} href={routeTo("courses", [course.name])}>{t.progress}</a>
            <a class={ROW_LINK} href={routeTo("courses", [course.name, "plan"])}>{t.plan}</a>
            <RowButton onClick={() => people(app, course.name, list.reload)}>{t.people}</RowButton>
            <a class={ROW_LINK} href={routeTo("sessions", [], { course: course.name })}>{t.sessions}</a>
            <RowButton onClick={() => rename(app, course, list.reload)}>{t.rename}</RowButton>
            <RowButton onClick={() => remove(course)}>{t.remove}</RowButton>
          </span>) },
      ]} />
    </>
  );
}

function make(app: App, made: () => void): void {
  const t = text.teach.courses;
  openForm(t.add, t.add, <Field label={t.name} hint={t.nameHint}><input name="name" maxLength={63} autocomplete="off" /></Field>, async ({ name }) => {
    await app.api.post("/courses", { name: name!.trim() });
    made();
  });
}

function rename(app: App, course: Course, changed: () => void): void {
  const t = text.teach.courses;
  openForm(t.renameTitle(course.name), text.save, <Field label={t.name} hint={t.nameHint}><input name="name" defaultValue={course.name} maxLength={63} autocomplete="off" /></Field>,
    async ({ name }) => {
      if (name!.trim() !== course.name) await app.api.patch(`/courses/${part(course.name)}`, { name: name!.trim() });
      changed();
    });
}

function people(app: App, course: string, changed: () => void): void {
  let different = false;
  openDialog({
    title: text.teach.courses.peopleOf(course), body: () => <div class="people"><People app={app} course={course} changed={() => (different = true)} /></div>,
    closed: () => different && changed(),
  });
}

const called = (person: Person): string => (person.full_name ? `${person.full_name} (${person.name})` : person.name);

// The trainees of a course: add one, remove one.
function People({ app, course, changed }: { app: App; course: string; changed(): void }) {
  const t = text.teach.courses;
  const path = `/courses/${part(course)}`;
  const place = useRef<HTMLDivElement>(null);
  const chosen = useSignal("");
  const both = useLoaded(() => Promise.all([
    app.api.get<{ course: { trainees: Person[] } }>(path), app.api.get<{ trainees: (Person & { erased: boolean })[] }>("/trainees")]));
  const change = async (request: () => Promise<void>): Promise<void> => {
    try {
      await request();
      changed();
      chosen.value = "";
      both.reload();
      place.current?.querySelector("select")?.focus();
    } catch (error) {
      toastFault(error);
    }
  };
  return (
    <Await of={both}>{([{ course: { trainees: members } }, { trainees }]) => {
      const others = trainees.filter((one) => !one.erased && !members.some((member) => member.name === one.name));
      return (
        <>
          {members.length === 0 ? <Empty title={t.nobody} /> : (
            <ul class="names">{members.map((member) => (
              <li key={member.name}><span>{called(member)}</span>
                <RowButton aria-label={t.leaveLabel(called(member))} onClick={() => void change(() => app.api.delete(`${path}/trainees/${part(member.name)}`))}>{t.leave}</RowButton></li>))}
            </ul>)}
          <div class="enter" ref={place}>
            <Field label={t.enter}>
              <Select options={[["", t.choose], ...others.map((one) => [one.name, called(one)] as const)]} value={chosen.value} onChoose={(name) => (chosen.value = name)} />
            </Field>
            <Button kind="primary" onClick={() => void (chosen.value && change(() => app.api.post(`${path}/trainees`, { trainee: chosen.value })))}>{t.enter}</Button>
          </div>
        </>
      );
    }}</Await>
  );
}
