// #/course: a trainee's courses, week by week, with the own curve of each task.
import { useState } from "preact/hooks";
import type { App } from "../app";
import { nameInWords } from "../groups";
import { Await, Badge, Button, Empty, Head, useLoaded, view, type ViewProps } from "../kit";
import type { CourseToday, Step, Today } from "../teach/model";
import { format, text } from "../text";
import { CurveOf, Shape } from "./progress";

export const myCourse = view(({ app }: ViewProps) => {
  const words = text.teach.course;
  app.title(text.views.course);
  const loaded = useLoaded(() => app.api.get<Today>("/trainees/me/today"));
  return <>
    <Head title={text.views.course} />
    <Await of={loaded}>{({ courses }) => courses.length === 0 ? <Empty title={words.none} hint={words.noneHint} /> : <>{courses.map((course) => <Course key={course.course} app={app} course={course} />)}</>}</Await>
  </>;
});

const stateOf = ({ state, overdue, attempts }: Step): "passed" | "overdue" | "trying" | "empty" =>
  state === "passed" ? "passed" : overdue ? "overdue" : attempts > 0 ? "trying" : "empty";

function Course({ app, course }: { app: App; course: CourseToday }) {
  const words = text.teach.course;
  const weeks = [...new Set(course.steps.map(({ week }) => week))].sort((a, b) => a - b);
  return (
    <section class="my-course" aria-label={course.course}>
      <h2>{course.course} {course.behind && <Badge kind="act" icon="act">{words.overdue}</Badge>}</h2>
      <p class="quiet-text">{words.passed(course.passed, course.tasks)}</p>
      {weeks.map((week) => <div key={week} class="panel my-week"><h3>{words.week(week)}</h3>
        <ol>{course.steps.filter((step) => step.week === week).map((step) => <StepRow key={step.task} app={app} course={course.course} step={step} />)}</ol></div>)}
    </section>
  );
}

function StepRow({ app, course, step }: { app: App; course: string; step: Step }) {
  const words = text.teach.course;
  const [open, setOpen] = useState(false);
  const title = step.title ?? nameInWords(step.task);
  const facts = [step.state === "passed" || step.state === "locked" ? words.states[step.state] : text.teach.train.passes(step.passes_done, step.passes),
    step.overdue && words.overdue, step.due_utc_s !== null && words.due(format.date(step.due_utc_s * 1000)), step.attempts > 0 && words.attempts(step.attempts)];
  return (
    <li class="my-step">
      <Shape state={stateOf(step)} /><span class="my-title"><b>{title}</b><span class="quiet-text">{facts.filter(Boolean).join(" · ")}</span></span>
      {step.attempts > 0 && <Button class="small" aria-expanded={open} aria-label={`${words.curve}: ${title}`} onClick={() => setOpen(!open)}>{words.curve}</Button>}
      {open && <div class="my-curve"><CurveOf app={app} course={course} task={step.task} /></div>}
    </li>
  );
}
