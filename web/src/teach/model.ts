// Tasks, attempts, courses and exams as the pages hold them. Rows of the API keep its names.

export type Verdict = "open" | "passed" | "not yet";
export type Purpose = "practice" | "exam";
export type Hand = "right" | "left";

export interface PassMark {
  time_s: number;
  errors: number;
}

export interface Goal {
  name: string;
  met_s: number | null; // since the attempt began
}

export interface ErrorCount {
  name: string;
  count: number;
  sentinel: boolean;
}

/** One time that an error was made. */
export interface Occurrence {
  error: string;
  tool: string;
  step: number; // of the session
  time_s: number; // since the attempt began
}

/** An attempt of a session, as it runs and after its end. Of an exam a trainee is told no goals and no errors. */
export interface Attempt {
  number: number; // within the session, from 1
  task: string;
  version: number;
  title: string;
  purpose: Purpose;
  hand: Hand;
  begun_step: number;
  time_s: number;
  limit_s: number;
  goals: Goal[];
  errors: ErrorCount[];
  occurrences: Occurrence[];
  end: string; // "": it runs
  verdict: Verdict;
  pass: PassMark;
}

export const errorsOf = (attempt: Pick<Attempt, "errors">): number => attempt.errors.reduce((sum, { count }) => sum + count, 0);
export const goalsMet = (attempt: Pick<Attempt, "goals">): number => attempt.goals.filter(({ met_s }) => met_s !== null).length;

const BEFORE_S = 4;
const CLIP_S = 6;

/** The six seconds around an occurrence, in the session's time. */
export function clipAround(time: number, start: number, end: number): { from: number; to: number } {
  const from = Math.max(start, Math.min(time - BEFORE_S, end - CLIP_S));
  return { from, to: Math.min(end, from + CLIP_S) };
}

/** The six seconds up to a time, and what is left of them before the start after it. */
export function clipUntil(time: number, start: number, end: number): { from: number; to: number } {
  const from = Math.max(start, Math.min(time, end) - CLIP_S);
  return { from, to: Math.min(end, from + CLIP_S) };
}

/** The goal that was pursued at a time of the attempt: the one met next, else the first that was not met. */
export function pursued({ goals }: Pick<Attempt, "goals">, time_s: number): string | undefined {
  const later = goals.filter(({ met_s }) => met_s !== null && met_s >= time_s).sort((a, b) => a.met_s! - b.met_s!);
  return (later[0] ?? goals.find(({ met_s }) => met_s === null) ?? goals.at(-1))?.name;
}

/** The errors to look at first: sentinels, then one of each error, the most frequent first; ascending in time among equals. */
export function worst(attempt: Pick<Attempt, "errors" | "occurrences">, most = 3): Occurrence[] {
  const rank = new Map(attempt.errors.map(({ name, count, sentinel }) => [name, (sentinel ? 1e6 : 0) + count]));
  const seen = new Map<string, number>();
  const keyed = attempt.occurrences.map((one) => {
    const before = seen.get(one.error) ?? 0;
    seen.set(one.error, before + 1);
    return { one, before, rank: rank.get(one.error) ?? 0 };
  });
  keyed.sort((a, b) => a.before - b.before || b.rank - a.rank || a.one.time_s - b.one.time_s);
  return keyed.slice(0, most).map(({ one }) => one);
}

/** Steps and their times as moments tell them, so that an error's step can be gone to. */
export class StepTimes {
  private steps: number[] = [];
  private times: number[] = [];

  clear(): void {
    this.steps = [];
    this.times = [];
  }

  add(step: number, time: number): void {
    if (this.steps.length && step <= this.steps.at(-1)!) return;
    this.steps.push(step);
    this.times.push(time);
  }

  /** The session's time at a step, between moments in proportion; NaN where none is known. */
  at(step: number): number {
    const { steps, times } = this;
    const after = steps.findIndex((one) => one >= step);
    if (after < 0) return times.at(-1) ?? NaN;
    if (after === 0) return times[0]!;
    const share = (step - steps[after - 1]!) / (steps[after]! - steps[after - 1]!);
    return times[after - 1]! + share * (times[after]! - times[after - 1]!);
  }
}

// ---- what the API tells --------------------------------------------------------------------------------

export interface Mark {
  version: number; // 0: the task file's
  kind: "task file" | "by hand" | "contrasting groups" | "published";
  source: string;
  time_s: number;
  errors: number;
  created_utc_s: number | null;
  task_version: number;
}

/** Numbers of a task's file, by its keys. */
export type Limits = Readonly<Record<string, number>>;

export interface Task {
  name: string;
  title: string;
  briefing: string;
  version: number;
  limit_s: number;
  in_order: boolean;
  goals: string[];
  limits: Limits[]; // of each goal
  errors: { name: string; sentinel: boolean; limits: Limits }[];
  tools?: string[];
  mark: Mark;
}

interface HandState {
  in_row: number;
  passed: boolean;
}

/** A task of a curriculum. */
export interface Item {
  task: string;
  title: string | null;
  week: number;
  passes: number;
  hands: "each" | "one";
  due_utc_s: number | null;
  cases: string[];
  after: string[];
}

export interface Step extends Item {
  state: "locked" | "open" | "passed";
  overdue: boolean;
  right?: HandState;
  left?: HandState;
  either?: HandState;
  hand: Hand | "either"; // to do it with next
  passes_done: number;
  attempts: number;
}

export interface CourseToday {
  course: string;
  version: number;
  next: Step | null;
  passed: number;
  tasks: number;
  behind: boolean;
  steps: Step[];
}

export interface Today {
  courses: CourseToday[];
  exams: { id: string; course: string; title: string; state: string }[];
}

/** The cases on which a task counts for the courses of today; none: all of them. */
export function casesOf({ courses }: Today, task: string): string[] {
  const asked = courses.flatMap(({ steps }) => steps.filter((step) => step.task === task).map(({ cases }) => cases));
  return asked.some((cases) => cases.length === 0) ? [] : [...new Set(asked.flat())];
}

export interface Curriculum {
  version: number;
  state: "draft" | "published" | "frozen";
  changed_utc_s: number;
  tasks: Item[];
}

export interface Curricula {
  curriculum: Curriculum | null;
  draft: Curriculum | null;
  version: number;
}

/** A recorded attempt. What is withheld is null. */
export interface AttemptRow {
  session: string;
  number: number;
  station: string;
  trainee: string | null;
  task: string;
  task_version: number;
  title: string;
  case: string;
  purpose: Purpose;
  hand: Hand;
  first_step: number;
  last_step: number;
  begun_utc_s: number;
  time_s: number | null;
  goals: number;
  goals_met: number | null;
  errors: number | null;
  sentinel: boolean | null;
  verdict: "passed" | "not yet" | null;
  end: string | null;
  pass: PassMark;
  mark_version: number;
  exam: string | null;
  withheld: boolean;
}

export interface Curve {
  task: string;
  trainee?: string;
  mark: Mark;
  attempts: { session: string; number: number; begun_utc_s: number; time_s: number; errors: number; verdict: "passed" | "not yet"; hand: Hand }[];
  cusum: { p0: number; p1: number; h: number; scores: number[]; competent_at: number | null; relapses: number[] } | null;
  course: { attempt: number; trainees: number; quartiles: [number, number, number] }[];
}

export interface ExamItem {
  task: string;
  case: string;
  case_hash: string | null;
  hand: Hand | null;
  session: string | null;
  number: number | null;
  verdict: "passed" | "not yet" | null;
}

export interface Exam {
  id: string;
  course: string;
  trainee: string | null;
  title: string;
  state: "planned" | "begun" | "done" | "released";
  seed?: number;
  created_utc_s: number;
  begun_utc_s: number | null;
  released_utc_s: number | null;
  flagged: boolean;
  checklist: { who: boolean; station_check: boolean; case_hash: boolean; drift_mm: number } | null;
  items: ExamItem[];
  interventions: { utc_s: number; reason: string }[];
  raters: { account: string | null; rated: boolean }[];
  verdict: "passed" | "not yet" | null;
  result: { text: string; hash: string; certificate: string; signature: string; signed_by: string } | null;
}
