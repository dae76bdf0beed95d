// The limits of the attention rail's rules for each task, as this browser keeps them. What is not kept is usual.
import { USUAL_LIMITS, type Limits } from "./rules";

const KEY = "attention-limits";
/** What a person may choose, in the units of `Limits`. */
export const RANGES: Readonly<Record<keyof Limits, readonly [least: number, most: number]>> = {
  outerMm3: [0, 500], beyondShare: [0, 2], unseenS: [1, 600], stuckS: [10, 3600], deepMm: [0.1, 10], deepS: [0, 60], slowTimes: [1, 10],
};

type Kept = Partial<Record<string, Partial<Limits>>>;

function read(): Kept {
  try {
    return (JSON.parse(localStorage.getItem(KEY) ?? "{}") as Kept | null) ?? {};
  } catch {
    return {};
  }
}

export const isLimit = (name: keyof Limits, value: unknown): value is number =>
  typeof value === "number" && value >= RANGES[name][0] && value <= RANGES[name][1];

export function limitsOf(task: string): Limits {
  const kept = read()[task] ?? {};
  const names = Object.keys(USUAL_LIMITS) as (keyof Limits)[];
  return Object.fromEntries(names.map((name) => [name, isLimit(name, kept[name]) ? kept[name] : USUAL_LIMITS[name]])) as unknown as Limits;
}

export function keepLimits(task: string, limits: Limits): void {
  localStorage.setItem(KEY, JSON.stringify({ ...read(), [task]: limits }));
}
