import { Empty, Head, Listing, openDialog, RowButton, useLoaded } from "../../kit";
import { Errors, Goals } from "../../teach/limits_words";
import type { Task } from "../../teach/model";
import { format, text } from "../../text";
import type { Part } from "./part";

export const Tasks: Part = ({ app }) => {
  const t = text.admin.tasks;
  const list = useLoaded(async () => (await app.api.get<{ tasks: Task[] }>("/tasks")).tasks);
  return (
    <>
      <Head title={text.admin.parts.tasks} hint={t.hint} />
      <Listing caption={text.admin.parts.tasks} of={list} none={<Empty title={t.none} hint={t.noneHint} />} keyOf={({ name }) => name} columns={[
        { label: t.name, cell: ({ title }) => <b>{title}</b> },
        { label: t.goals, number: true, cell: ({ goals }) => format.number(goals.length) },
        { label: t.limit, number: true, cell: ({ limit_s }) => format.clock(limit_s) },
        { label: t.mark, number: true, cell: ({ mark }) => t.markOf(format.clock(mark.time_s), mark.errors) },
        { label: t.source, wide: true, cell: ({ mark }) => mark.source },
        { label: t.actions, hidden: true, cell: (task) => <RowButton onClick={() => show(task)}>{t.open}</RowButton> },
      ]} />
    </>
  );
};

const show = (task: Task): void => void openDialog({
  title: task.title, wide: true, body: () => (
    <div class="task-asks">
      <p>{task.briefing}</p>
      <h3>{text.teach.goalsAsk}</h3><Goals task={task} />
      {task.errors.length > 0 && <><h3>{text.teach.errorsCount}</h3><Errors task={task} /></>}
    </div>),
});
