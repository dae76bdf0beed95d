// What an instructor does to a session. Each thing is shown as done only when the server says so; until
// then it is pending, and a refusal is shown in the server's words.
import { Command_Kind, SessionState, type Remark } from "wire";
import type { App } from "../app";
import { explain } from "../explain";
import { NoAnswer, type CommandInit } from "../live";
import type { Marker } from "../scene/joint";
import { format, text } from "../text";
import { button, confirm, drop, field, formDialog, h, select, setFault, setHint, setText } from "../ui";

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

export class SessionControls {
  readonly element: HTMLElement;
  onPicking: (on: boolean) => void = () => {};
  private readonly line = h("p", { class: "controls-line", role: "status", "aria-live": "polite" });
  private readonly buttons: Record<"run" | "pause" | "stop" | "reset" | "undo" | "case" | "note" | "assign" | "mark" | "unmark", HTMLButtonElement>;
  private state: SessionState | undefined;
  private marker: Remark | undefined;
  private waiting = 0; // commands without an answer
  private reachable = true; // the server

  constructor(private readonly app: App, private readonly now: ControlsContext) {
    const words = text.station;
    this.buttons = {
      run: button(words.start, () => void this.do(this.buttons.run.lastChild!.textContent!, { kind: Command_Kind.START }), { kind: "primary", icon: "running" }),
      pause: button(words.pause, () => void this.do(words.pause, { kind: Command_Kind.PAUSE }), { icon: "paused" }),
      undo: button(words.undo, () => void this.do(words.undo, { kind: Command_Kind.UNDO }), { title: words.undoHint }),
      reset: button(words.reset, () => confirm(words.resetTitle, words.resetHint, words.reset, () => this.must(words.reset, { kind: Command_Kind.RESET }))),
      stop: button(words.stop, () => confirm(words.stopTitle, words.stopHint, words.stop, () => this.must(words.stop, { kind: Command_Kind.STOP })), { icon: "closed" }),
      case: button(words.caseAndWarp, () => void this.chooseCase()),
      assign: button(words.assign, () => void this.assign(), { icon: "person" }),
      note: button(words.note, () => this.note()),
      mark: button(words.mark, () => this.setPicking(this.buttons.mark.getAttribute("aria-pressed") !== "true"), { "aria-pressed": "false", title: words.markHint }),
      unmark: button(words.unmark, () => void this.withdraw()),
    };
    const { run, pause, undo, reset, stop, case: cases, assign, note, mark, unmark } = this.buttons;
    this.element = h("div", { class: "controls", role: "group", "aria-label": words.controls },
      h("div", { class: "controls-group" }, run, pause, stop), h("div", { class: "controls-group" }, undo, mark, unmark, note),
      drop(words.more, [reset, cases, assign], "more"), this.line);
    this.setState(undefined);
    this.setMarker(undefined);
  }

  /** The session's state; undefined: there is none. */
  setState(state: SessionState | undefined): void {
    if (state === this.state && this.state !== undefined) return;
    this.state = state;
    this.buttons.run.lastChild!.textContent = state === SessionState.PAUSED ? text.station.resume : text.station.start;
    this.enable();
  }

  setMarker(marker: Remark | undefined): void {
    this.marker = marker;
    this.enable();
  }

  /** False: the server is not there, and nothing can be done. */
  setReachable(reachable: boolean): void {
    if (reachable === this.reachable) return;
    this.reachable = reachable;
    this.enable();
    if (reachable) this.say("", "");
    else this.say("refused", text.station.disabled);
  }

  private enable(): void {
    const { state } = this;
    const open = state !== undefined && state !== SessionState.CLOSED;
    const { run, pause, stop, reset, undo, note, mark, unmark, case: cases, assign } = this.buttons;
    const focused = document.activeElement;
    // What the session's state does not allow is not there; what the server cannot be told now is greyed.
    const can = (button: HTMLButtonElement, may: boolean): void => {
      button.hidden = !may;
      button.disabled = !this.reachable;
    };
    can(run, state !== SessionState.RUNNING);
    can(pause, state === SessionState.RUNNING);
    for (const one of [stop, reset, undo, note, mark]) can(one, open);
    for (const one of [cases, assign]) can(one, true);
    can(unmark, open && this.marker !== undefined);
    if (!open && mark.getAttribute("aria-pressed") === "true") this.setPicking(false);
    if (focused instanceof HTMLButtonElement && focused.hidden && this.element.contains(focused)) [pause, run].find((one) => !one.hidden)!.focus();
  }

  setPicking(on: boolean): void {
    this.buttons.mark.setAttribute("aria-pressed", String(on));
    setText(this.line, on ? text.station.markHint : "");
    delete this.line.dataset.kind;
    this.onPicking(on);
  }

  /** Puts the marker there, in the place of the one before. */
  placeMarker(marker: Marker | undefined): void {
    if (!marker) {
      this.say("refused", text.station.refused(text.station.mark, text.station.noProbe));
      return;
    }
    this.setPicking(false);
    const number = this.marker?.number ?? 0n;
    void this.do(text.station.mark, { kind: Command_Kind.NOTE, remark: { number, text: "", hasMarker: true, body: marker.body, point: marker.point } });
  }

  private withdraw(): Promise<void> {
    const { number, text: words, body, point } = this.marker!;
    return this.do(text.station.unmark, { kind: Command_Kind.NOTE, remark: { number, text: words, hasMarker: true, body, point: point!, withdrawn: true } });
  }

  // ---- commands ----------------------------------------------------------------------------------------

  private say(kind: "" | "pending" | "done" | "refused", words: string): void {
    this.line.dataset.kind = kind;
    setText(this.line, words);
  }

  private async do(what: string, command: CommandInit): Promise<void> {
    await this.must(what, command).catch(() => {}); // the line shows it already
  }

  // Rejects with what a person should read.
  private async must(what: string, command: CommandInit): Promise<void> {
    this.waiting++;
    this.element.setAttribute("aria-busy", "true");
    this.say("pending", text.station.pending(what));
    try {
      const reply = await this.app.feed.command({ ...command, station: this.now.station });
      if (!reply.ok) throw new Refused(reply.text || text.station.refusedAnyhow);
      this.say("done", reply.undone ? text.station.undone(what, reply.undone.cuts, reply.undone.volumeMm3) : text.station.done(what));
    } catch (error) {
      const why = error instanceof Refused ? error.message : error instanceof NoAnswer && error.sent ? text.station.unanswered : explain(error);
      this.say("refused", text.station.refused(what, why));
      throw error;
    } finally {
      if (--this.waiting === 0) this.element.removeAttribute("aria-busy");
    }
  }

  // ---- dialogs -----------------------------------------------------------------------------------------

  private async chooseCase(): Promise<void> {
    const cases = await this.app.api.get<{ cases: CaseRow[] }>("/cases").then(({ cases: rows }) => rows, (): CaseRow[] => []);
    const here = this.now.case();
    if (!cases.some(({ name }) => name === here)) cases.unshift({ name: here });
    const titleOf = (name: string): string => cases.find((one) => one.name === name)?.title ?? "";
    const choice = select(cases.map(({ name, grade = "" }) => [name, text.station.caseLabel(name, text.admin.cases.grades[grade] ?? grade)]), here,
      { on: { change: () => setHint(choice, titleOf(choice.value)) } });
    const slider = h("input", { type: "range", min: 0, max: 100, step: 5, value: Math.round(100 * this.now.strength()), class: "range" });
    const shown = h("output", { class: "range-value number" }, format.percent(this.now.strength(), 0));
    slider.addEventListener("input", () => setText(shown, format.percent(Number(slider.value) / 100, 0)));
    const warp = field(text.station.warp, slider, text.station.warpHint);
    warp.querySelector("label")!.append(" ", shown);
    formDialog(text.station.caseTitle, [h("p", { class: "quiet-text" }, text.station.caseHint), field(text.station.case, choice, titleOf(here)), warp], text.station.begin, () =>
      this.must(text.station.case, { kind: Command_Kind.CASE, caseName: choice.value, strength: Number(slider.value) / 100 }));
  }

  private note(): void {
    const words = h("textarea", { maxlength: 240, rows: 3 });
    formDialog(text.station.noteTitle, [field(text.station.noteLabel, words, text.station.noteHint)], text.station.send, async () => {
      const empty = words.value.trim() === "";
      setFault(words, empty ? text.station.noteNeeded : "");
      if (empty) throw new Refused("");
      await this.must(text.station.noteName, { kind: Command_Kind.NOTE, remark: { text: words.value.trim() } });
    });
  }

  private async assign(): Promise<void> {
    const rows = await this.app.api.get<{ trainees: TraineeRow[] }>("/trainees").then(({ trainees }) => trainees, (): TraineeRow[] => []);
    const here = this.now.trainee();
    if (here && !rows.some(({ name }) => name === here)) rows.unshift({ name: here });
    const choice = select([["", text.station.nobodyChoice], ...rows.map(({ name, full_name: full }): [string, string] => [name, full ? `${full} (${name})` : name])], here);
    formDialog(text.station.assignTitle, [field(text.station.trainee, choice, text.station.assignHint)], text.station.assignSave, () =>
      this.must(text.station.trainee, { kind: Command_Kind.ASSIGN, trainee: choice.value }));
  }
}

class Refused extends Error {}

