// A curriculum as it is edited: its tasks by weeks.
import type { Item } from "./model";

const PASSES = 2; // in a row

/** With the task at the end of a week. It opens after the one before it in the plan. */
export function add(items: readonly Item[], task: string, week: number): Item[] {
  const before = [...items].sort((a, b) => a.week - b.week).filter((one) => one.week <= week).at(-1);
  return [...items, { task, title: null, week, passes: PASSES, hands: "each", due_utc_s: null, cases: [], after: before ? [before.task] : [] }];
}

/** Without it, and nothing waits for it any more. */
export function remove(items: readonly Item[], task: string): Item[] {
  return items.filter((one) => one.task !== task).map((one) => ({ ...one, after: one.after.filter((other) => other !== task) }));
}

export function move(items: readonly Item[], task: string, by: number, weeks: number): Item[] {
  return items.map((one) => (one.task === task ? { ...one, week: Math.min(weeks, Math.max(1, one.week + by)) } : one));
}

export function weeksOf(items: readonly Item[], weeks: number): { week: number; tasks: Item[] }[] {
  return Array.from({ length: weeks }, (_, i) => ({ week: i + 1, tasks: items.filter(({ week }) => week === i + 1) }));
}

/** As the server takes it. */
export const ready = ({ task, week, passes, hands, due_utc_s, cases, after }: Item): object => ({ task, week, passes, hands, due_utc_s, cases, after });
