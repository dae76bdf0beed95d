// An expert's hands at the same task, as the server computes them from the task's goals: nobody's, so nobody is known by
// them. They are shown beside a trainee's error, at the goal that was pursued then.
import { useEffect, useState } from "preact/hooks";
import { ApiError, part } from "../api";
import type { App } from "../app";
import { nameInWords } from "../groups";
import { FeedSource, type Source } from "../source";
import { text } from "../text";
import { Clip } from "./clip";
import { attemptOf } from "./live_attempt";
import { clipUntil, pursued, type Attempt } from "./model";

const TRIES = 20; // while the server computes others'
const RETRY_S = 2;

export interface Expert {
  source: Source;
  attempt: Attempt;
}

const path = (task: string): string => `/tasks/${part(task)}/expert`;

/** Lets the server begin to compute them, so that they are there when they are wanted. */
export function prepareExpert(app: App, task: string, caseName: string): void {
  app.api.bytes(path(task), { case: caseName }).catch(() => {}); // who wants them asks again
}

async function askFor(app: App, task: string, caseName: string, wanted: () => boolean): Promise<Expert | undefined> {
  for (let tried = 0; tried < TRIES && wanted(); tried++) {
    try {
      const said = FeedSource.batch(await app.api.bytes(path(task), { case: caseName }));
      return said?.attempt && { source: said.source, attempt: attemptOf(said.attempt, said.source.history.instruments) };
    } catch (error) {
      if (!(error instanceof ApiError) || error.status !== 503) return undefined;
      await new Promise((then) => setTimeout(then, 1000 * (error.retryAfterS || RETRY_S)));
    }
  }
  return undefined;
}

/** Undefined: there are none, or not yet. They are those of the attempt's version of the task, and of the session's case. */
export function useExpert(app: App, own: Attempt, session: Source["session"]): Expert | undefined {
  const [expert, setExpert] = useState<Expert>();
  useEffect(() => {
    let wanted = own.purpose === "practice" && session !== undefined;
    setExpert(undefined);
    if (wanted) void askFor(app, own.task, session!.caseName, () => wanted).then((found) => {
      if (wanted && found?.attempt.version === own.version && found.source.session?.caseHash === session!.caseHash) setExpert(found);
    });
    return () => void (wanted = false);
  }, [own.task, own.number, session?.caseName, session?.caseHash]);
  return expert;
}

/** Six seconds of the expert, up to the goal that the own attempt pursued at that time. */
export function ExpertClip({ expert, own, time_s }: { expert: Expert; own: Attempt; time_s: number }) {
  const words = text.teach.train;
  const goal = pursued(own, time_s);
  const met = expert.attempt.goals.find(({ name }) => name === goal)?.met_s;
  if (met === undefined || met === null) return null;
  const { start, end } = expert.source.history;
  return (
    <li class="expert"><p class="expert-title">{words.expert(nameInWords(goal!))}</p>
      <Clip source={expert.source} {...clipUntil(met, start, end)} still={met} playing label={words.expertOf} /></li>
  );
}
