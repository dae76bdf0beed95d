// What a trainee does next: at the station that runs itself, and on the own pages.
import type { ComponentChildren } from "preact";
import type { App } from "../app";
import { nameInWords } from "../groups";
import { Await, Badge, Empty, useLoaded } from "../kit";
import { text } from "../text";
import type { Step, Task, Today } from "./model";

interface Props {
  app: App;
  more(next: Step, task: Task | undefined): ComponentChildren; // in the card of the next task
  others?(tasks: Task[], free: boolean): ComponentChildren;
}

export function Next({ app, more, others }: Props) {
  const words = text.teach.train;
  const loaded = useLoaded(async () => {
    const [today, { tasks }] = await Promise.all([app.api.get<Today>("/trainees/me/today"), app.api.get<{ tasks: Task[] }>("/tasks")]);
    return { today, tasks };
  });
  return (
    <Await of={loaded}>{({ today, tasks }) => {
      const course = today.courses.find(({ next }) => next) ?? today.courses[0];
      const next = course?.next ?? undefined;
      const task = tasks.find(({ name }) => name === next?.task);
      return <>
        {course?.behind && <Badge kind="act" icon="act">{words.behind}</Badge>}
        {today.exams.map((exam) => <Badge key={exam.id} kind="look" icon="look">{words.exam(exam.title)}</Badge>)}
        {next ? <Card step={next} task={task}>{more(next, task)}</Card>
          : <Empty title={course ? words.nothing : words.noCourse} hint={course ? words.nothingHint : words.noCourseHint} />}
        {others?.(tasks, !next)}
      </>;
    }}</Await>
  );
}

function Card({ step, task, children }: { step: Step; task: Task | undefined; children: ComponentChildren }) {
  const words = text.teach.train;
  const facts = [words.passes(step.passes_done, step.passes), task && words.minutes(task.mark.time_s), text.teach.hands[step.hand]];
  return (
    <div class="next-card">
      <p class="next-title">{words.next(step.title ?? nameInWords(step.task))}</p>
      <p class="next-facts">{facts.filter(Boolean).join(" · ")}</p>
      {children}
    </div>
  );
}
