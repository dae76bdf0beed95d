// What a task's goals ask and which errors it counts, in sentences.
import { nameInWords } from "../groups";
import { text } from "../text";
import type { Limits, Task } from "./model";

/** One sentence for each number that has one. */
export function sentencesOf(limits: Limits, words = text.teach.limits): string[] {
  return Object.keys(words).flatMap((name) => (limits[name] === undefined ? [] : [words[name]!(limits[name], limits)]));
}

export function Goals({ task }: { task: Task }) {
  return (
    <ol class="goals" tabIndex={0}>{task.goals.map((name, at) => (
      <li key={name}>{nameInWords(name)}<Sentences all={sentencesOf(task.limits[at] ?? {})} /></li>))}</ol>
  );
}

export function Errors({ task }: { task: Task }) {
  return (
    <ul class="goals">{task.errors.map(({ name, sentinel, limits }) => (
      <li key={name}>{nameInWords(name)}{sentinel && ` (${text.teach.grave})`}<Sentences all={sentencesOf(limits, text.teach.errorLimits)} /></li>))}</ul>
  );
}

function Sentences({ all }: { all: readonly string[] }) {
  return all.length > 0 ? <span class="goal-limits">{all.join(" · ")}</span> : null;
}
