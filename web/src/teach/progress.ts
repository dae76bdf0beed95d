// The table of residents by tasks.

interface Hand {
  in_row: number;
  passed: boolean;
}

export interface Cell {
  state: "empty" | "trying" | "passed";
  locked: boolean;
  overdue: boolean;
  attempts: number;
  right?: Hand;
  left?: Hand;
  either?: Hand;
  best_s: number | null;
  exam: null | "planned" | "begun" | "done" | "released";
}

export interface ProgressRow {
  name: string;
  full_name: string | null;
  behind: boolean;
  cells: Cell[];
}

export interface Progress {
  version: number;
  behind: number;
  tasks: { task: string; title: string | null; week: number; due_utc_s: number | null }[];
  trainees: ProgressRow[];
}

export type CellState = "empty" | "trying" | "passed" | "overdue" | "exam";
/** A shape for each: colour is never the only sign. */
export const SHAPES: Record<CellState, string> = { empty: "M8 8h.01", trying: "M8 3a5 5 0 1 0 0 10Z", passed: "M3 8.500 6.500 12 13 4.500", overdue: "M8 2.500 14 13.500H2Z", exam: "M8 2 14 8 8 14 2 8Z" };

/** An exam goes before all, and what is overdue before what is tried. */
export function stateOf(cell: Cell): CellState {
  if (cell.exam) return "exam";
  return cell.overdue && cell.state !== "passed" ? "overdue" : cell.state;
}
