// What was cut away, for the plot of it.
import type { TimedResection, Source } from "./source";

const REMOVED_GROUPS = ["meniscus_medial", "meniscus_lateral"];

interface RemovedAt {
  time: number;
  mm3: number;
}

/** The volume removed over time: of the medial meniscus, of the lateral one, of all other groups together. */
export class Removed {
  private readonly found: RemovedAt[][] = [[], [], []];
  private readonly newest = new Map<string, number>(); // mm³ of each group
  private taken: readonly TimedResection[] = []; // another session has another list
  private count = 0; // of the resections that are in it

  constructor(private readonly source: Source) {}

  of(trace: number): readonly RemovedAt[] {
    const { resections } = this.source;
    if (resections !== this.taken) {
      for (const list of this.found) list.length = 0;
      this.newest.clear();
      this.taken = resections;
      this.count = 0;
    }
    for (; this.count < resections.length; this.count++) {
      const { time, resection: { group, removedMm3, piecesMm3 } } = resections[this.count]!;
      this.newest.set(group, removedMm3 + piecesMm3);
      const known = REMOVED_GROUPS.indexOf(group);
      if (known >= 0) this.found[known]!.push({ time, mm3: removedMm3 + piecesMm3 });
      else this.found[REMOVED_GROUPS.length]!.push({ time, mm3: this.ofOthers() });
    }
    return this.found[trace]!;
  }

  private ofOthers(): number {
    return [...this.newest].reduce((sum, [group, mm3]) => (REMOVED_GROUPS.includes(group) ? sum : sum + mm3), 0);
  }
}
