// Attempts as the live connection tells them, and what a page asks of them.
import { AttemptState_End, AttemptState_Hand, AttemptState_Purpose, AttemptState_Verdict, Command_Kind, type AttemptState } from "wire";
import { FIRST_INSTRUMENT, nameOf, type Instruments } from "../instruments";
import type { CommandInit } from "../live";
import type { Attempt, Hand, Purpose, Verdict } from "./model";

const ENDS: Record<AttemptState_End, string> = {
  [AttemptState_End.RUNS]: "", [AttemptState_End.DONE]: "done", [AttemptState_End.TIME_OUT]: "time out",
  [AttemptState_End.SENTINEL]: "sentinel error", [AttemptState_End.LEFT]: "left",
  [AttemptState_End.STOPPED]: "stopped", [AttemptState_End.ENDED]: "ended",
};
const VERDICTS: Record<AttemptState_Verdict, Verdict> = {
  [AttemptState_Verdict.OPEN]: "open", [AttemptState_Verdict.PASSED]: "passed", [AttemptState_Verdict.NOT_YET]: "not yet",
};
const seconds = (ns: bigint): number => Number(ns) * 1e-9;

export function attemptOf(told: AttemptState, instruments: Instruments): Attempt {
  return {
    number: told.number, task: told.task, version: told.version, title: told.title,
    purpose: told.purpose === AttemptState_Purpose.EXAM ? "exam" : "practice",
    hand: told.hand === AttemptState_Hand.LEFT_HAND ? "left" : "right",
    begun_step: Number(told.begunStep), time_s: seconds(told.timeNs), limit_s: told.limitS,
    goals: told.goals.map(({ name, metNs }) => ({ name, met_s: metNs === undefined ? null : seconds(metNs) })),
    errors: told.errors.map(({ name, count, sentinel }) => ({ name, count, sentinel })),
    occurrences: told.occurrences.map(({ error, channel, step, timeNs }) => ({
      error: told.errors[error]?.name ?? "", tool: nameOf(instruments[channel - FIRST_INSTRUMENT]) ?? "", step: Number(step), time_s: seconds(timeNs) })),
    end: ENDS[told.end] ?? "left", verdict: VERDICTS[told.verdict] ?? "open",
    pass: { time_s: told.passTimeS, errors: told.passErrors },
  };
}

export const beginCommand = (station: string, task: string, purpose: Purpose, hand: Hand): CommandInit => ({
  kind: Command_Kind.BEGIN, station, task,
  purpose: purpose === "exam" ? AttemptState_Purpose.EXAM : AttemptState_Purpose.PRACTICE,
  hand: hand === "left" ? AttemptState_Hand.LEFT_HAND : AttemptState_Hand.RIGHT_HAND,
});
export const leaveCommand = (station: string): CommandInit => ({ kind: Command_Kind.LEAVE, station });

export const helpCommand = (station: string): CommandInit => ({ kind: Command_Kind.HELP, station });
/** The trainee's session begins at the station, where nobody else's runs. */
export const takeCommand = (station: string): CommandInit => ({ kind: Command_Kind.TAKE, station });
/** Ends the trainee's session; the station is then free for the next. */
export const stopCommand = (station: string): CommandInit => ({ kind: Command_Kind.STOP, station });
