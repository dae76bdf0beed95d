// When the attention rail tells of a trainee: the limits of its rules for a task, as sentences.
import { useState } from "preact/hooks";
import type { App } from "../app";
import { Button, Field, Form, openDialog, Select } from "../kit";
import { isLimit, keepLimits, limitsOf } from "../teach/limits";
import type { Task } from "../teach/model";
import { USUAL_LIMITS, type Limits } from "../teach/rules";
import { text } from "../text";

const SHOWN: Readonly<Partial<Record<keyof Limits, number>>> = { beyondShare: 100 }; // times, in the sentence: percent
const STEPS: Readonly<Partial<Record<keyof Limits, number>>> = { deepMm: 0.1, slowTimes: 0.1 };
const NAMES = Object.keys(USUAL_LIMITS) as (keyof Limits)[];

const shown = (name: keyof Limits, limits: Limits): string => String(Number((limits[name] * (SHOWN[name] ?? 1)).toFixed(3)));
const taken = (name: keyof Limits, value: string | undefined): number => (value ? Number(value) / (SHOWN[name] ?? 1) : NaN);

/** Asks for the limits of one of the tasks, that of `first` at the start. */
export async function askLimits(app: App, first: string | undefined): Promise<void> {
  const { tasks } = await app.api.get<{ tasks: Task[] }>("/tasks");
  openDialog({ title: text.teach.attention.limitsTitle, body: (close) => <Limiting tasks={tasks} first={first ?? tasks[0]?.name ?? ""} close={close} /> });
}

function Limiting({ tasks, first, close }: { tasks: readonly Task[]; first: string; close: () => void }) {
  const words = text.teach.attention;
  const [task, setTask] = useState(first);
  const [limits, setLimits] = useState(() => limitsOf(first));
  const choose = (name: string): void => {
    setTask(name);
    setLimits(limitsOf(name));
  };
  return (
    <Form label={text.save} cancel={close}
      check={(values) => Object.fromEntries(NAMES.map((name) => [name, isLimit(name, taken(name, values[name])) ? "" : words.limitWrong]))}
      send={async (values) => {
        keepLimits(task, Object.fromEntries(NAMES.map((name) => [name, taken(name, values[name])])) as unknown as Limits);
        close();
      }}>
      <Field label={words.limitsTask} hint={words.limitsHint}><Select name="task" options={tasks.map(({ name, title }) => [name, title])} value={task} onChoose={choose} /></Field>
      {NAMES.map((name) => <Field key={`${task} ${name}`} label={words.limits[name]}>
        <input name={name} type="number" step={STEPS[name] ?? 1} value={shown(name, limits)} /></Field>)}
      <Button class="small" onClick={() => setLimits({ ...USUAL_LIMITS })}>{words.limitsUsual}</Button>
    </Form>
  );
}
