// What an instructor does to a session. Each thing is shown as done only when the server says so; until
// then it is pending, and a refusal is shown as such.
import { signal, useSignal } from "@preact/signals";
import { useLayoutEffect, useRef } from "preact/hooks";
import { Command_Kind, SessionState, type Remark } from "wire";
import type { App } from "../app";
import { explain, whyOf } from "../explain";
import { Button, confirm, Drop, Field, openForm, Select, type ButtonProps } from "../kit";
import { NoAnswer, type CommandInit } from "../live";
import type { Marker } from "../scene/joint";
import { format, text } from "../text";

interface CaseRow {
  name: string;
  title?: string;
  grade?: string;
}

interface TraineeRow {
  name: string;
  full_name?: string;
}

export interface ControlsContext {
  station: string;
  case: () => string;
  strength: () => number;
  trainee: () => string;
}

interface Line {
  kind: "" | "pending" | "done" | "refused";
  words: string;
}

class Refused extends Error {}

/** What is known of the session, and the commands to it. */
export class SessionControls {
  readonly state = signal<SessionState | undefined>(undefined); // undefined: there is no session
  readonly marker = signal<Remark | undefined>(undefined);
  readonly reachable = signal(true); // the server; else nothing can be done
  readonly exam = signal(false); // an attempt of an exam runs: nobody helps, and whoever intervenes says why
  readonly picking = signal(false); // of the marker's place
  readonly line = signal<Line>({ kind: "", words: "" });
  readonly waiting = signal(0); // commands without an answer

  constructor(private readonly app: App, private readonly now: ControlsContext) {}

  setReachable(reachable: boolean): void {
    if (reachable === this.reachable.peek()) return;
    this.reachable.value = reachable;
    this.line.value = reachable ? { kind: "", words: "" } : { kind: "refused", words: text.station.disabled };
  }

  setPicking(on: boolean): void {
    this.picking.value = on;
    this.line.value = { kind: "", words: on ? text.station.markHint : "" };
  }

  /** Puts the marker there, in the place of the one before. */
  placeMarker(marker: Marker | undefined): void {
    if (!marker) {
      this.line.value = { kind: "refused", words: text.station.refused(text.station.mark, text.station.noProbe) };
      return;
    }
    this.setPicking(false);
    const number = this.marker.peek()?.number ?? 0n;
    this.do(text.station.mark, { kind: Command_Kind.NOTE, remark: { number, text: "", hasMarker: true, body: marker.body, point: marker.point } });
  }

  withdraw(): void {
    const { number, text: words, body, point } = this.marker.peek()!;
    this.do(text.station.unmark, { kind: Command_Kind.NOTE, remark: { number, text: words, hasMarker: true, body, point: point!, withdrawn: true } });
  }

  do(what: string, command: CommandInit): void {
    this.must(what, command).catch(() => {}); // the line shows it already
  }

  /** What changes an exam needs a reason, which the server writes into the exam's record. */
  act(what: string, command: CommandInit, otherwise = (): void => this.do(what, command)): void {
    if (!this.exam.peek()) {
      otherwise();
      return;
    }
    const words = text.teach.exam;
    openForm(words.interveneFirst(what), what, <Field label={words.reason} hint={words.reasonHint}><textarea name="reason" maxLength={240} rows={2} /></Field>,
      ({ reason = "" }) => this.must(what, { ...command, reason: reason.trim() }), ({ reason = "" }) => ({ reason: reason.trim().length < 3 ? words.reasonNeeded : "" }));
  }

  /** Rejects with what a person should read. */
  async must(what: string, command: CommandInit): Promise<void> {
    this.waiting.value++;
    this.line.value = { kind: "pending", words: text.station.pending(what) };
    try {
      const reply = await this.app.feed.command({ ...command, station: this.now.station });
      if (!reply.ok) throw new Refused(whyOf(reply.why, reply.text || text.station.refusedAnyhow));
      this.line.value = { kind: "done", words: reply.undone ? text.station.undone(what, reply.undone.cuts, reply.undone.volumeMm3) : text.station.done(what) };
    } catch (error) {
      const why = error instanceof Refused ? error.message : error instanceof NoAnswer && error.sent ? text.station.unanswered : explain(error);
      this.line.value = { kind: "refused", words: text.station.refused(what, why) };
      throw error;
    } finally {
      this.waiting.value--;
    }
  }

  // ---- dialogs -----------------------------------------------------------------------------------------

  async chooseCase(): Promise<void> {
    const t = text.station;
    const cases = await this.app.api.get<{ cases: CaseRow[] }>("/cases").then(({ cases: rows }) => rows, (): CaseRow[] => []);
    const here = this.now.case();
    if (!cases.some(({ name }) => name === here)) cases.unshift({ name: here });
    openForm(t.caseTitle, t.begin, <CaseFields cases={cases} here={here} strength={this.now.strength()} />, ({ case: caseName, strength }) =>
      this.must(t.case, { kind: Command_Kind.CASE, caseName: caseName!, strength: Number(strength) / 100 }));
  }

  note(): void {
    const t = text.station;
    openForm(t.noteTitle, t.send, <Field label={t.noteLabel} hint={t.noteHint}><textarea name="note" maxLength={240} rows={3} /></Field>,
      ({ note }) => this.must(t.noteName, { kind: Command_Kind.NOTE, remark: { text: note!.trim() } }),
      ({ note }) => ({ note: note!.trim() ? "" : t.noteNeeded }));
  }

  async assign(): Promise<void> {
    const t = text.station;
    const rows = await this.app.api.get<{ trainees: TraineeRow[] }>("/trainees").then(({ trainees }) => trainees, (): TraineeRow[] => []);
    const here = this.now.trainee();
    if (here && !rows.some(({ name }) => name === here)) rows.unshift({ name: here });
    const options = [["", t.nobodyChoice] as const, ...rows.map(({ name, full_name: full }) => [name, full ? `${full} (${name})` : name] as const)];
    openForm(t.assignTitle, t.assignSave, <Field label={t.trainee} hint={t.assignHint}><Select name="trainee" options={options} value={here} /></Field>,
      ({ trainee }) => this.must(t.trainee, { kind: Command_Kind.ASSIGN, trainee: trainee! }));
  }
}

function CaseFields({ cases, here, strength }: { cases: readonly CaseRow[]; here: string; strength: number }) {
  const t = text.station;
  const chosen = useSignal(here);
  const percent = useSignal(Math.round(100 * strength));
  return (
    <>
      <p class="quiet-text">{t.caseHint}</p>
      <Field label={t.case} hint={cases.find(({ name }) => name === chosen.value)?.title}>
        <Select name="case" options={cases.map(({ name, grade = "" }) => [name, t.caseLabel(name, text.admin.cases.grades[grade] ?? grade)])} value={chosen.value}
          onChoose={(name) => (chosen.value = name)} />
      </Field>
      <Field label={t.warp} hint={t.warpHint} shown={<output class="range-value number">{format.percent(percent.value / 100, 0)}</output>}>
        <input name="strength" type="range" min={0} max={100} step={5} value={percent.value} class="range" onInput={(event) => (percent.value = Number(event.currentTarget.value))} />
      </Field>
    </>
  );
}

// What the session's state does not allow is not there; what the server cannot be told now is greyed.
export function Controls({ of }: { of: SessionControls }) {
  const t = text.station;
  const element = useRef<HTMLDivElement>(null);
  const state = of.state.value;
  const open = state !== undefined && state !== SessionState.CLOSED;
  const helps = open && !of.exam.value;
  const one = (label: string, may: boolean, click: () => void, more: ButtonProps = {}) =>
    <Button hidden={!may} disabled={!of.reachable.value} onClick={click} {...more}>{label}</Button>;
  const start = state === SessionState.PAUSED ? t.resume : t.start;
  useLayoutEffect(() => {
    const focused = document.activeElement;
    if (focused instanceof HTMLButtonElement && focused.hidden && element.current!.contains(focused)) element.current!.querySelector<HTMLButtonElement>("button:not([hidden])")?.focus();
    if (!helps && of.picking.peek()) of.setPicking(false);
  }, [state, of.marker.value, of.exam.value]);
  return (
    <div class="controls" role="group" aria-label={t.controls} aria-busy={of.waiting.value > 0 ? true : undefined} ref={element}>
      <div class="controls-group">
        {one(start, state !== SessionState.RUNNING, () => of.do(start, { kind: Command_Kind.START }), { kind: "primary", icon: "running" })}
        {one(t.pause, state === SessionState.RUNNING, () => of.act(t.pause, { kind: Command_Kind.PAUSE }), { icon: "paused" })}
        {one(t.stop, open, () => of.act(t.stop, { kind: Command_Kind.STOP }, () => confirm(t.stopTitle, t.stopHint, t.stop, () => of.must(t.stop, { kind: Command_Kind.STOP }))), { icon: "closed" })}
      </div>
      <div class="controls-group">
        {one(t.undo, helps, () => of.do(t.undo, { kind: Command_Kind.UNDO }), { title: t.undoHint })}
        {one(t.mark, helps, () => of.setPicking(!of.picking.peek()), { "aria-pressed": of.picking.value, title: t.markHint })}
        {one(t.unmark, helps && of.marker.value !== undefined, () => of.withdraw())}
        {one(t.note, helps, () => of.note())}
      </div>
      <Drop label={t.more} class="more">
        {one(t.reset, open, () => of.act(t.reset, { kind: Command_Kind.RESET }, () => confirm(t.resetTitle, t.resetHint, t.reset, () => of.must(t.reset, { kind: Command_Kind.RESET }))))}
        {one(t.caseAndWarp, !of.exam.value, () => void of.chooseCase())}
        {one(t.assign, !of.exam.value, () => void of.assign(), { icon: "person" })}
      </Drop>
      <p class="controls-line" role="status" aria-live="polite" data-kind={of.line.value.kind || undefined}>{of.line.value.words}</p>
    </div>
  );
}
