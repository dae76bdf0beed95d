// What was cut away, for the plot of it.
import { shortLabelOf, type Groups } from "./groups";
import type { TimedResection, Source } from "./source";
import { text } from "./text";

export const REMOVED_TRACES = 3;

interface RemovedAt {
  time: number;
  mm3: number;
}

// The groups with a trace of their own: where they are more than there are traces, the last one is of all others.
function ownTraces(groups: Groups | undefined): string[] {
  const cuttable = (groups ?? []).filter((group) => group.cuttable).map(({ name }) => name);
  return cuttable.length > REMOVED_TRACES ? cuttable.slice(0, REMOVED_TRACES - 1) : cuttable;
}

/** What the traces are of; as many as there are. */
export function removedLabels(groups: Groups | undefined): string[] {
  const cuttable = (groups ?? []).filter((group) => group.cuttable);
  const own = ownTraces(groups);
  return [...cuttable.slice(0, own.length).map(shortLabelOf), ...(own.length < cuttable.length ? [text.session.otherGroups] : [])];
}

/** The volume removed over time: a trace for each of the case's groups that can be cut, the last one for all that are left. */
export class Removed {
  private readonly found: RemovedAt[][] = Array.from({ length: REMOVED_TRACES }, () => []);
  private readonly newest = new Map<string, number>(); // mm³ of each group
  private taken: readonly TimedResection[] = []; // another session has another list
  private count = 0; // of the resections that are in it
  private own: string[] = [];

  constructor(private readonly source: Source) {}

  of(trace: number): readonly RemovedAt[] {
    const { resections } = this.source;
    if (resections !== this.taken) {
      for (const list of this.found) list.length = 0;
      this.newest.clear();
      this.taken = resections;
      this.count = 0;
      this.own = ownTraces(this.source.session?.groups);
    }
    for (; this.count < resections.length; this.count++) {
      const { time, resection: { group, removedMm3, piecesMm3 } } = resections[this.count]!;
      this.newest.set(group, removedMm3 + piecesMm3);
      const known = this.own.indexOf(group);
      if (known >= 0) this.found[known]!.push({ time, mm3: removedMm3 + piecesMm3 });
      else this.found[REMOVED_TRACES - 1]!.push({ time, mm3: this.ofOthers() });
    }
    return this.found[trace]!;
  }

  private ofOthers(): number {
    return [...this.newest].reduce((sum, [group, mm3]) => (this.own.includes(group) ? sum : sum + mm3), 0);
  }
}
