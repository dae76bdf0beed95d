// A session through its scope at any time: what the trainee saw then.
import { newRow } from "./history";
import { loadKnee } from "./scene/anatomy";
import { Arthroscope } from "./scene/arthroscope";
import { Joint } from "./scene/joint";
import { USUAL_OPTIC, notchAngle, type Optic } from "./scene/optic";
import { NoWebGl } from "./scene/view3d";
import { markerAt, type Source } from "./source";
import { text } from "./text";
import { broken, empty, loading } from "./ui";
import { Picture } from "./views/scope_picture";

export class ScopeReplay {
  private readonly picture: Picture;
  private shown: { joint: Joint; optic: Arthroscope } | undefined;
  private knee = "";
  private time = 0;
  private pending = 0;
  private readonly row = newRow();
  private readonly ends: (() => void)[];

  constructor(private readonly root: HTMLElement, private readonly source: Source) {
    root.classList.add("scope-replay");
    this.picture = new Picture(root, text.teach.replay.scope, "h3");
    this.picture.onSide = (side) => {
      this.shown?.optic.setSide(side);
      this.soon();
    };
    this.ends = [source.onChange((change) => {
      if (change === "session") this.load();
      if (change !== "moment") this.soon();
    })];
    this.load();
  }

  close(): void {
    for (const end of this.ends) end();
    cancelAnimationFrame(this.pending);
    this.picture.close();
    this.drop();
  }

  setTime(time: number): void {
    this.time = time;
    this.soon();
  }

  private drop(): void {
    this.shown?.optic.close();
    this.shown?.joint.dispose();
    this.shown = undefined;
  }

  private load(): void {
    const { session } = this.source;
    if (!session) return;
    const key = `${session.caseName} ${session.caseHash}`;
    if (key === this.knee) return;
    this.knee = key;
    this.picture.say(loading(text.session.loadingCase(session.caseName)));
    loadKnee(session.caseName, key, session.groups).then((knee) => {
      if (this.knee !== key || !this.root.isConnected) return;
      this.drop();
      this.picture.fresh();
      const optic: Optic = session.opticViewDeg ? { tiltDeg: session.opticDeg, fieldDeg: session.opticViewDeg, postDeg: 0 } : USUAL_OPTIC;
      try {
        const joint = new Joint(knee, true);
        this.shown = { joint, optic: new Arthroscope(this.picture.canvas, joint, optic) };
      } catch (error) {
        if (!(error instanceof NoWebGl)) throw error;
        this.picture.say(broken(text.session.noScene, text.session.noSceneHint));
        return;
      }
      this.picture.turnNotch(notchAngle(optic));
      this.shown.optic.setSide(this.picture.side);
      this.soon();
    }, () => this.knee === key && this.picture.say(broken(text.session.noCase, "")));
  }

  private soon(): void {
    this.pending ||= requestAnimationFrame((now) => {
      this.pending = 0;
      if (this.shown) this.draw(now, this.shown);
    });
  }

  private draw(now: number, { joint, optic }: { joint: Joint; optic: Arthroscope }): void {
    const { source } = this;
    const at = source.history.indexAt(this.time);
    if (at < 0) return;
    source.history.read(at, this.row);
    for (const group of source.groups()) {
      const tissue = source.tissue(group, this.time);
      if (tissue) joint.setTissue(group, tissue);
    }
    const marker = markerAt(source, this.time);
    joint.setMarker(marker?.point && { body: marker.body, point: marker.point });
    const more = joint.paint(now);
    optic.setInstruments(source.history.instruments);
    const seen = optic.draw(this.row, this.time);
    this.picture.say(seen ? undefined : empty(text.scope.noScope));
    this.picture.canvas.dataset.time = this.time.toFixed(2);
    if (more || (seen && !optic.settled)) this.soon();
  }
}
