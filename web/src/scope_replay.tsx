// A session through its scope at any time: what the trainee saw then.
import { useEffect, useLayoutEffect, useMemo } from "preact/hooks";
import { newRow } from "./history";
import { Empty } from "./kit";
import { opticOf, ScopeFrame, ScopeStage } from "./scope_stage";
import { markerAt, type Source } from "./source";
import { text } from "./text";

class Replay {
  readonly stage: ScopeStage;
  private time = 0;
  private pending = 0;
  private moved = false; // since the last picture; else light alone goes on settling
  private readonly row = newRow();

  constructor(private readonly source: Source) {
    this.stage = new ScopeStage(opticOf(source.session), () => this.soon());
  }

  /** Returns what ends it. */
  open(): () => void {
    const end = this.source.onChange((change) => {
      if (change === "session") this.load();
      if (change !== "moment") this.soon();
    });
    this.load();
    return () => {
      end();
      cancelAnimationFrame(this.pending);
    };
  }

  setTime(time: number): void {
    this.time = time;
    this.soon();
  }

  private load(): void {
    const { session } = this.source;
    if (!session) return;
    this.stage.setOptic(opticOf(session));
    this.stage.load(session);
  }

  private soon(moved = true): void {
    this.moved ||= moved;
    this.pending ||= requestAnimationFrame((now) => {
      this.pending = 0;
      this.draw(now);
    });
  }

  private draw(now: number): void {
    if (this.moved) this.stage.shown?.optic.resolution.move();
    this.moved = false;
    this.render(now);
  }

  private render(now: number): void {
    const { source, stage: { shown } } = this;
    const at = source.history.indexAt(this.time);
    if (at < 0 || !shown) return;
    const { joint, optic } = shown;
    source.history.read(at, this.row);
    for (const group of source.groups()) {
      const tissue = source.tissue(group, this.time);
      if (tissue) joint.setTissue(group, tissue);
    }
    const marker = markerAt(source, this.time);
    joint.setMarker(marker?.point && { body: marker.body, point: marker.point });
    joint.setLoose(source.session?.loose ?? []);
    const more = joint.paint(now);
    optic.setInstruments(source.history.instruments);
    const seen = optic.draw(this.row, this.time);
    if (seen) this.stage.showPicture();
    else this.stage.say("no scope", () => <Empty title={text.scope.noScope} />);
    this.stage.canvas.dataset.time = this.time.toFixed(2);
    optic.resolution.drawn(now);
    if (more || (seen && !optic.settled)) this.soon(more);
    else optic.resolution.rest(() => this.render(performance.now()));
  }
}

/** The source at a time, through its scope, as large as the element that it is in. */
export function ScopeReplay({ source, time }: { source: Source; time: number }) {
  const replay = useMemo(() => new Replay(source), [source]);
  useLayoutEffect(() => replay.open(), [replay]);
  useEffect(() => replay.setTime(time), [replay, time]);
  return <div class="scope-replay" role="group" aria-label={text.teach.replay.scope}><ScopeFrame stage={replay.stage} /></div>;
}
