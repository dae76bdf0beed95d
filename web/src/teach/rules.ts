// Which trainees need an instructor, and since when. A rule holds once its condition has held for some time, and ends
// once it has not for some time: no row flickers.

export type Group = "asks" | "struggles" | "finished";
export type RuleName = "help" | "outer" | "beyond" | "unseen" | "stuck" | "deep" | "slow" | "finished";

/** What is known of a station at one time. What is undefined is unknown, and meets no rule. */
export interface Observed {
  station: string;
  trainee: string;
  attempt?: {
    number: number;
    exam?: boolean;
    task: string;
    title: string;
    ended: boolean;
    passed?: boolean; // undefined: withheld
    time_s: number;
    met: number; // goals
    medianS?: number; // of the course
  };
  paused: boolean;
  helpAsked: boolean;
  unseen?: boolean; // a tool works out of the picture
  deepMm?: number; // an instrument in cartilage or bone
  beyondShare?: number; // removed beyond the plan, of the plan
  outerMm3?: number; // removed from the outer third of the menisci
}

export interface Limits {
  outerMm3: number;
  beyondShare: number;
  unseenS: number;
  stuckS: number;
  deepMm: number;
  deepS: number;
  slowTimes: number;
}

export const USUAL_LIMITS: Limits = { outerMm3: 2, beyondShare: 0.2, unseenS: 30, stuckS: 180, deepMm: 1, deepS: 2, slowTimes: 1.5 };
export const SNOOZE_MS = 5 * 60_000;
const KEPT = 100; // rows of the history

export interface AttentionRow {
  key: string; // the same as long as it is the same row
  group: Group;
  rule: RuleName;
  station: string;
  trainee: string;
  exam: boolean; // nobody helps
  title: string; // of the task
  value: number; // what the sentence tells
  passed?: boolean | undefined;
  since: number; // ms
  until?: number; // in the history
}

interface Watch {
  row: AttentionRow;
  metSince: number | undefined;
  shown: boolean;
  missedSince: number | undefined;
}

interface Met {
  rule: RuleName;
  group: Group;
  holdMs: number; // before it shows
  clearMs: number; // before it goes
  value: number;
  met: boolean;
}

/** Since when an attempt has made no progress. */
interface Progress {
  number: number;
  met: number;
  atS: number;
}

export class Attention {
  readonly history: AttentionRow[] = []; // newest first
  private readonly watches = new Map<string, Watch>();
  private readonly snoozed = new Map<string, number>(); // key: until
  private readonly progress = new Map<string, Progress>();

  constructor(private readonly limitsOf: (task: string) => Limits = () => USUAL_LIMITS) {}

  snooze(key: string, now: number): void {
    this.snoozed.set(key, now + SNOOZE_MS);
  }

  /** All rows at a time, asks first, the oldest first within a group. */
  update(now: number, stations: readonly Observed[]): AttentionRow[] {
    const seen = new Set<string>();
    for (const observed of stations)
      for (const condition of this.conditions(observed)) {
        const key = `${observed.station} ${condition.rule} ${observed.attempt?.number ?? 0}`;
        seen.add(key);
        this.step(key, condition, observed, now);
      }
    for (const [key, watch] of this.watches) if (!seen.has(key)) this.end(key, watch, now);
    const order: Group[] = ["asks", "struggles", "finished"];
    return [...this.watches.values()].filter(({ shown, row }) => shown && (this.snoozed.get(row.key) ?? 0) <= now).map(({ row }) => row)
      .sort((a, b) => order.indexOf(a.group) - order.indexOf(b.group) || a.since - b.since || a.key.localeCompare(b.key));
  }

  private step(key: string, { rule, group, holdMs, clearMs, value, met }: Met, { station, trainee, attempt }: Observed, now: number): void {
    let watch = this.watches.get(key);
    if (!watch) {
      if (!met) return;
      const row = { key, group, rule, station, trainee, exam: attempt?.exam ?? false, title: attempt?.title ?? "", value, passed: attempt?.passed, since: now };
      this.watches.set(key, (watch = { row, metSince: undefined, shown: false, missedSince: undefined }));
    }
    if (met) {
      watch.missedSince = undefined;
      watch.metSince ??= now;
      watch.row.value = rule === "deep" || rule === "beyond" || rule === "outer" ? Math.max(watch.row.value, value) : value;
      watch.row.passed = attempt?.passed;
      if (now - watch.metSince >= holdMs) watch.shown = true;
      return;
    }
    watch.missedSince ??= now;
    if (!watch.shown || now - watch.missedSince >= clearMs) this.end(key, watch, now);
  }

  private end(key: string, watch: Watch, now: number): void {
    this.watches.delete(key);
    this.snoozed.delete(key);
    if (!watch.shown) return;
    this.history.unshift({ ...watch.row, until: now });
    this.history.length = Math.min(this.history.length, KEPT);
  }

  private conditions(observed: Observed): Met[] {
    const { attempt } = observed;
    const help: Met = { rule: "help", group: "asks", holdMs: 0, clearMs: 0, value: 0, met: observed.helpAsked };
    if (!attempt) return [help];
    const limits = this.limitsOf(attempt.task);
    const runs = !attempt.ended && !observed.paused;
    const still = this.stillFor(observed.station, attempt);
    const slow = attempt.medianS === undefined ? 0 : attempt.time_s / attempt.medianS;
    const struggle = (rule: RuleName, value: number, met: boolean, holdMs = 0, clearMs = 5000): Met =>
      ({ rule, group: "struggles", holdMs, clearMs, value, met: runs && met });
    return [
      help,
      struggle("deep", observed.deepMm ?? 0, (observed.deepMm ?? 0) >= limits.deepMm, limits.deepS * 1000, 10_000),
      struggle("outer", observed.outerMm3 ?? 0, (observed.outerMm3 ?? 0) > limits.outerMm3),
      struggle("beyond", observed.beyondShare ?? 0, (observed.beyondShare ?? 0) > limits.beyondShare),
      struggle("unseen", limits.unseenS, observed.unseen === true, limits.unseenS * 1000, 3000),
      struggle("stuck", still, still >= limits.stuckS, 0, 1000),
      struggle("slow", slow, slow > limits.slowTimes),
      { rule: "finished", group: "finished", holdMs: 0, clearMs: 0, value: attempt.time_s, met: attempt.ended },
    ];
  }

  // Of the attempt's time, in which pauses do not count.
  private stillFor(station: string, { number, met, time_s }: NonNullable<Observed["attempt"]>): number {
    const before = this.progress.get(station);
    if (before && before.number === number && before.met === met && time_s >= before.atS) return time_s - before.atS;
    this.progress.set(station, { number, met, atS: time_s });
    return 0;
  }
}
