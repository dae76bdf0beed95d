// A recorded session's attempts beside its replay: what they came to, errors to jump to, and the picture of the scope.
import { render } from "preact";
import { useEffect, useMemo, useState } from "preact/hooks";
import type { App } from "../app";
import { part } from "../api";
import { nameInWords } from "../groups";
import { Button, Icon, useLoaded } from "../kit";
import { ScopeReplay } from "../scope_replay";
import type { FeedSource } from "../source";
import { StepTimes, type AttemptRow, type Occurrence } from "../teach/model";
import { format, text } from "../text";
import { h } from "../ui";
import { VerdictBadge } from "./verdict";

const BEFORE_S = 4; // what led to an error

interface Attempt {
  attempt: AttemptRow;
  occurrences: Occurrence[];
}

export interface DebriefAttempts {
  element: HTMLElement;
  scope: HTMLElement; // the picture, hidden at first
  setTime(time: number): void;
  close(): void;
}

export function debriefAttempts(app: App, session: string, source: FeedSource, chosen: number, seek: (time: number) => void): DebriefAttempts {
  const element = h("div", { class: "debrief-attempts" });
  const scope = h("div", { class: "debrief-scope", hidden: true });
  const steps = new StepTimes();
  const end = app.feed.on("moment", ({ step, timeNs }) => steps.add(Number(step), Number(timeNs) * 1e-9));
  let now = 0;
  const draw = (): void => render(scope.hidden ? null : <ScopeReplay source={source} time={now} />, scope);
  const through = (on: boolean): void => {
    scope.hidden = !on;
    scope.classList.toggle("other", on); // beside the joint
    draw();
  };
  render(<Attempts app={app} session={session} steps={steps} chosen={chosen} seek={seek} through={through} />, element);
  return {
    element, scope,
    setTime(time) {
      now = time;
      if (!scope.hidden) draw();
    },
    close() {
      end();
      through(false);
      render(null, element);
    },
  };
}

interface AttemptsProps {
  app: App;
  session: string;
  steps: StepTimes;
  chosen: number;
  seek(time: number): void;
  through(on: boolean): void;
}

function Attempts({ app, session, steps, chosen, seek, through }: AttemptsProps) {
  const words = text.teach.replay;
  const [scope, setScope] = useState(false);
  const loaded = useLoaded(async () => {
    const { attempts } = await app.api.get<{ attempts: AttemptRow[] }>("/attempts", { session, limit: 100 });
    return Promise.all(attempts.reverse().map(({ number }) => app.api.get<Attempt>(`/attempts/${part(session)}/${number}`)));
  }, [session]);
  const all = loaded.value ?? [];
  useEffect(() => through(scope), [scope]);
  return (
    <div class="debrief-attempts-row">
      <Button icon="look" aria-pressed={scope} onClick={() => setScope(!scope)}>{words.scope}</Button>
      {all.map((one) => <Outcome key={one.attempt.number} of={one} open={one.attempt.number === chosen || all.length === 1} steps={steps} seek={(time) => {
        setScope(true);
        seek(time);
      }} />)}
    </div>
  );
}

function Outcome({ of: { attempt, occurrences }, open, steps, seek }: { of: Attempt; open: boolean; steps: StepTimes; seek: (time: number) => void }) {
  const words = text.teach;
  const errors = useMemo(() => [...occurrences].sort((a, b) => a.step - b.step), [occurrences]);
  return (
    <details class="panel outcome" open={open}>
      <summary><b>{attempt.title}</b> <VerdictBadge verdict={attempt.verdict} /> <span class="number quiet-text">{attempt.time_s === null ? "" : `${format.clock(attempt.time_s)} · `}{attempt.errors === null ? "" : words.train.errors(attempt.errors)}</span></summary>
      <div class="outcome-errors">
        <Button class="small" onClick={() => seek(steps.at(attempt.first_step))}>{words.train.start}</Button>
        {errors.map((one) => <Button key={one.step} class="small" icon="act" aria-label={words.replay.goTo(nameInWords(one.error), format.clock(one.time_s))}
          onClick={() => seek(steps.at(one.step) - BEFORE_S)}>{words.train.clip(nameInWords(one.error), format.clock(one.time_s))}</Button>)}
        {errors.length === 0 && attempt.errors !== null && <span class="quiet-text"><Icon name="quiet" /> {words.train.errors(0)}</span>}
        <Button class="small" onClick={() => seek(steps.at(attempt.last_step))}>{words.replay.outcome}</Button>
      </div>
    </details>
  );
}
