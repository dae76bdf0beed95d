// A picture of a session in three dimensions, with what stands over it: the joint as it was at one moment
// of its source, live or recorded.
import { render, type ComponentChild } from "preact";
import { Vector3 } from "three";
import { LOST, newRow, SEEN, toolAt, WARPED, WORKING } from "./history";
import { Broken, Loading } from "./kit";
import { loadKnee, type Knee } from "./scene/anatomy";
import type { Overlay } from "./scene/overlay";
import { Joint, USUAL_SHOW, type Marker, type Show } from "./scene/joint";
import type { CameraState } from "./scene/orbit";
import { NoWebGl, View3D } from "./scene/view3d";
import { Toolbar } from "./scene_tools";
import { markerAt, type Change, type Source } from "./source";
import { text } from "./text";
import { h } from "./ui";

const MEASURED_MOST = 1500; // moments for the maps in one frame

export class Viewport {
  readonly element = h("div", { class: "viewport" });
  onMarker: (marker: Marker) => void = () => {}; // a point of the surface was chosen
  onCamera: (camera: CameraState) => void = () => {}; // before each picture
  picking = false; // a click on the surface chooses a point

  private readonly state = h("div", { class: "viewport-state" });
  private readonly toolbar: Toolbar;
  private readonly row = newRow();
  private readonly measuring = newRow();
  private time: number | undefined; // undefined: the newest
  private show: Show = { ...USUAL_SHOW };
  private view: View3D | undefined;
  private joint: Joint | undefined;
  private overlay: Overlay | undefined;
  private following = false; // the tip
  private knee = ""; // which one is shown, or asked for
  private measured = -Infinity; // time of the last moment that the maps have
  private readonly end: () => void;

  constructor(private readonly source: Source, private readonly name: string = text.session.scene) {
    this.toolbar = new Toolbar(this.show, {
      show: (show) => this.setShow(show),
      preset: (preset) => this.view?.orbit.preset(preset),
      follow: (on) => this.follow(on),
    });
    this.element.append(this.state, this.toolbar.element);
    this.end = source.onChange((change) => this.changed(change));
    this.begin();
  }

  close(): void {
    this.end();
    this.toolbar.close();
    this.dropScene();
    this.knee = "";
  }

  /** The moment to show; undefined: the newest. */
  setTime(time: number | undefined): void {
    this.time = time;
    this.draw();
  }

  draw(): void {
    this.view?.draw();
  }

  /** Where the eye is. */
  setCamera(camera: CameraState): void {
    this.view?.orbit.put(camera);
  }

  /** Hands of another session in this picture; undefined: none. */
  setOverlay(overlay: Overlay | undefined): void {
    this.overlay?.root.removeFromParent();
    this.overlay = overlay;
    if (overlay) this.joint?.attach(overlay.body, overlay.root);
    this.draw();
  }

  /** Where the working instrument's tip is shown, on the nearest surface; undefined: none is seen. */
  markerAtTip(): Marker | undefined {
    const tip = this.tip();
    return tip && this.joint?.markerAt(tip);
  }

  // ---- what changes ----------------------------------------------------------------------------------

  private changed(change: Change): void {
    if (change === "session") this.begin();
    if (this.concerned(change)) this.draw();
  }

  // What comes of a record is later than the moment that is shown.
  private concerned(change: Change): boolean {
    const { history, recorded } = this.source;
    if (this.time === undefined || change === "session" || history.count === 1) return true;
    return recorded ? change === "remark" || this.time >= history.end : change !== "moment";
  }

  private begin(): void {
    this.measured = -Infinity;
    this.joint?.forget();
    const session = this.source.session;
    if (!session) {
      this.dropScene();
      this.knee = "";
      this.say(<Loading what={text.session.waiting} />);
      return;
    }
    const key = `${session.caseName} ${session.caseHash}`;
    if (key === this.knee) return;
    this.knee = key;
    this.dropScene();
    this.say(<Loading what={text.session.loadingCase(session.caseName)} />);
    loadKnee(session.caseName, key, session.groups).then(
      (knee) => this.knee === key && this.setKnee(knee),
      () => this.knee === key && this.say(<Broken title={text.session.noCase} hint={text.session.noCaseHint} again={() => {
        this.knee = "";
        this.begin();
      }} />));
  }

  private say(words: ComponentChild): void {
    render(words, this.state);
  }

  private setKnee(knee: Knee): void {
    this.say(null);
    const joint = new Joint(knee);
    try {
      this.view = new View3D(this.element, joint, this.name);
    } catch (error) {
      if (!(error instanceof NoWebGl)) throw error;
      joint.dispose();
      this.say(<Broken title={text.session.noScene} hint={text.session.noSceneHint} />);
      return;
    }
    this.joint = joint;
    if (this.overlay) joint.attach(this.overlay.body, this.overlay.root);
    joint.onMap = () => this.toolbar.showLegend(this.show.map, joint.map);
    joint.setShow(this.show);
    this.view.onFrame = (now) => this.frame(now);
    this.view.onPick = (marker) => this.picking && this.onMarker(marker);
    this.view.orbit.onCamera = (camera) => this.onCamera(camera);
    this.measured = -Infinity;
    if (this.following) this.follow(true);
    this.draw();
  }

  private dropScene(): void {
    this.overlay?.root.removeFromParent();
    this.view?.close();
    this.joint?.dispose();
    this.view = undefined;
    this.joint = undefined;
  }

  private setShow(show: Show): void {
    if (show.map !== this.show.map) this.measured = -Infinity;
    this.show = show;
    this.joint?.setShow(show);
    this.draw();
  }

  private tip(): Vector3 | undefined {
    const at = toolAt(this.row[WORKING]!);
    if (this.row[WORKING]! < 0 || this.row[at + SEEN]! < 1 || this.row[at + SEEN]! - 1 === LOST) return undefined;
    return new Vector3(this.row[at + WARPED + 4], this.row[at + WARPED + 5], this.row[at + WARPED + 6]);
  }

  private follow(on: boolean): void {
    this.following = on;
    if (!this.view) return;
    this.view.orbit.follow = on ? () => this.tip() : undefined;
    this.view.orbit.closeUp(on);
  }

  // ---- a picture ---------------------------------------------------------------------------------------

  private frame(now: number): boolean {
    const { history } = this.source;
    const joint = this.joint!;
    const shown = this.time ?? history.end;
    const index = history.indexAt(shown);
    if (index < 0) return false;
    history.read(index, this.row);
    joint.setInstruments(history.instruments);
    joint.setLoose(this.source.session?.loose ?? []);
    this.toolbar.showTools(history.instruments, (instrument) => this.row[toolAt(instrument) + SEEN]! > 0);
    joint.setRow(this.row, history.time(index));
    joint.setTrails(history, history.time(index));
    this.overlay?.setTime(shown, this.show.trails);
    for (const group of this.source.groups()) {
      const tissue = this.source.tissue(group, shown);
      if (tissue) joint.setTissue(group, tissue);
    }
    joint.setMarker(markerOf(this.source, shown));
    const more = this.measure(index);
    return joint.paint(now) || more;
  }

  // The maps of what was measured: all moments up to the one that is shown, some in each frame.
  private measure(index: number): boolean {
    if (this.show.map !== "gain" && this.show.map !== "contact") return false;
    const { history } = this.source;
    if (history.time(index) < this.measured) {
      this.joint!.forget();
      this.measured = -Infinity;
    }
    const first = history.indexAt(this.measured) + 1;
    const last = Math.min(index, first + MEASURED_MOST - 1);
    for (let i = first; i <= last; i++) {
      history.read(i, this.measuring);
      this.joint!.measure(this.measuring);
    }
    this.measured = history.time(last);
    return last < index;
  }
}

function markerOf(source: Source, time: number): Marker | undefined {
  const remark = markerAt(source, time);
  return remark?.point && { body: remark.body, point: remark.point };
}
