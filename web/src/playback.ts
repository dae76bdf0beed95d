// The clock of a replay, the times to jump to, and how two sessions are aligned.
import { STATE, type History } from "./history";
import type { EventName, TimedEvent } from "./source";

export const SPEEDS = [0.25, 0.5, 1, 2, 4, 8];

export class Player {
  time = 0; // s
  playing = false;
  speed = 1;
  waiting = false; // for what has not come yet
  atEnd = false; // and stays there as more comes

  /** After so many seconds of the wall's clock; `here`: up to where the record has come. */
  advance(seconds: number, here: number, complete: boolean): void {
    if (!this.playing) return;
    const wanted = this.time + seconds * this.speed;
    this.waiting = wanted >= here && !complete;
    if (wanted >= here && complete) this.playing = false;
    this.time = Math.max(this.time, Math.min(wanted, here));
  }

  /** From the beginning where it is at the end. */
  toggle(start: number, here: number, complete: boolean): void {
    this.playing = !this.playing;
    this.waiting = false;
    if (this.playing && (this.atEnd || (complete && this.time >= here))) this.time = start;
    this.atEnd = false;
  }

  seek(time: number, start: number, length: number): void {
    this.time = Math.min(Math.max(time, start), length);
    this.waiting = false;
    this.atEnd = false;
  }

  /** The end of what is here, and of what is still to come. */
  toEnd(here: number): void {
    this.time = here;
    this.playing = this.waiting = false;
    this.atEnd = true;
  }

  /** The next faster (1) or slower (-1) speed. */
  shift(way: number): void {
    const at = SPEEDS.indexOf(this.speed) + way;
    this.speed = SPEEDS[Math.min(Math.max(at, 0), SPEEDS.length - 1)]!;
  }
}

const TOUCHES: readonly EventName[] = ["contact", "release"];
const APART_S = 0.05; // two stops nearer to each other are one

/** Times to jump to, ascending: remarks and markers, and all events except touches. */
export function stopsOf(events: readonly TimedEvent[], said: readonly number[]): number[] {
  const times = [...events.filter(({ event }) => !TOUCHES.includes(event)).map(({ time }) => time), ...said].sort((a, b) => a - b);
  return times.filter((time, i) => i === 0 || time - times[i - 1]! > APART_S);
}

/** The next stop after a time (way 1) or before it (-1), if any. */
export function nextStop(stops: readonly number[], time: number, way: 1 | -1): number | undefined {
  return way === 1 ? stops.find((stop) => stop > time + APART_S) : [...stops].reverse().find((stop) => stop < time - APART_S);
}

export interface Band {
  from: number;
  to: number;
  state: number;
}

/** The session's states over time. */
export function bandsOf(history: History, events: readonly TimedEvent[]): Band[] {
  if (!history.count) return [];
  const changes = events.filter(({ event, time }) => event === "state" && time > history.start).map(({ time }) => time);
  const bounds = [history.start, ...changes, history.end];
  return bounds.slice(1).map((to, i) => ({ from: bounds[i]!, to, state: history.value(history.indexAt(bounds[i]!), STATE) }))
    .filter(({ from, to }) => to > from);
}

export type Step = "start" | "contact" | "cut";
export const STEPS: readonly Step[] = ["start", "contact", "cut"];

/** Time of the start, of the first touch or of the first cut, if any. */
export function firstOf(step: Step, history: History, events: readonly TimedEvent[]): number | undefined {
  if (step === "start") return history.count ? history.start : undefined;
  return events.find(({ event }) => event === step)?.time;
}
