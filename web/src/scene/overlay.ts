// The hands of another session in this one's picture: instruments and trails, in one colour. They go with
// a bone of the patient: each is where it was on that bone, also where this joint is bent otherwise.
import { Group, Matrix4, Vector3, type Line, type Mesh } from "three";
import { bodyAt, BUTTONS, HAS_WARPED, INSTRUMENTS, LOST, newRow, OPENING, SEEN, toolAt, WARPED, type History } from "../history";
import { runs } from "../instruments";
import { shapeOf, type Shape } from "./instruments";
import { poseMatrix, trail, TRAIL_POINTS, TRAIL_S } from "./joint";
import { steelMaterial } from "./materials";

export const COMPANION = 0xd6249f;
const TIBIA = 1;

const bone = new Matrix4();
const pose = new Matrix4();
const point = new Vector3();

export class Overlay {
  readonly root = new Group();
  readonly body = TIBIA;
  ahead = 0; // its time less this session's, s

  private readonly row = newRow();
  private readonly tools: ({ shape: Shape; trail: Line } | undefined)[] = Array.from({ length: INSTRUMENTS });

  constructor(private readonly history: History) {}

  /** As it was at this session's time. */
  setTime(time: number, trails: boolean): void {
    const last = this.history.indexAt(time + this.ahead);
    this.root.visible = last >= 0;
    if (last < 0) return;
    this.history.read(last, this.row);
    poseMatrix(this.row, bodyAt(TIBIA, true), bone).invert();
    for (let instrument = 0; instrument < this.history.instruments.length; instrument++) this.move(instrument, this.history.time(last));
    if (trails) this.setTrails(last);
    for (const tool of this.tools) if (tool) tool.trail.visible = trails;
  }

  dispose(): void {
    this.root.traverse((node) => {
      const { geometry, material } = node as Partial<Mesh>;
      geometry?.dispose();
      if (material && !Array.isArray(material)) material.dispose();
    });
  }

  private there(index: number, at: number): boolean {
    const seen = this.history.value(index, at + SEEN);
    return seen > 0 && seen - 1 !== LOST && this.history.value(index, at + HAS_WARPED) === 1;
  }

  private move(instrument: number, time: number): void {
    const { row } = this;
    const at = toolAt(instrument);
    if (row[at + SEEN] === 0) return;
    const { shape } = (this.tools[instrument] ??= this.newTool(instrument));
    shape.root.visible = row[at + SEEN]! - 1 !== LOST && row[at + HAS_WARPED] === 1;
    shape.root.matrix.multiplyMatrices(bone, poseMatrix(row, at + WARPED, pose));
    shape.root.matrixWorldNeedsUpdate = true;
    shape.move(row[at + OPENING]!, runs(this.history.instruments[instrument], row[at + BUTTONS]!), time);
  }

  private newTool(instrument: number): { shape: Shape; trail: Line } {
    const steel = steelMaterial(COMPANION, 0.35);
    const shape = shapeOf(this.history.instruments[instrument]!, steel, steel);
    shape.root.matrixAutoUpdate = false;
    shape.root.renderOrder = 4;
    const line = trail(COMPANION, 0.9);
    this.root.add(shape.root, line);
    return { shape, trail: line };
  }

  // Each point by where the bone was then.
  private setTrails(last: number): void {
    const first = Math.max(0, this.history.indexAt(this.history.time(last) - TRAIL_S), last - TRAIL_POINTS + 1);
    this.tools.forEach((tool) => tool?.trail.geometry.setDrawRange(0, 0));
    const counts = this.tools.map(() => 0);
    const broken = this.tools.map((tool) => !tool);
    for (let i = last; i >= first; i--) {
      this.history.read(i, this.row);
      poseMatrix(this.row, bodyAt(TIBIA, true), bone).invert();
      this.tools.forEach((tool, instrument) => {
        const at = toolAt(instrument);
        broken[instrument] ||= !this.there(i, at);
        if (broken[instrument]) return;
        point.set(this.row[at + WARPED + 4]!, this.row[at + WARPED + 5]!, this.row[at + WARPED + 6]!).applyMatrix4(bone);
        point.toArray(tool!.trail.geometry.getAttribute("position").array, 3 * counts[instrument]!++);
      });
    }
    this.tools.forEach((tool, instrument) => {
      if (!tool) return;
      tool.trail.geometry.setDrawRange(0, counts[instrument]!);
      tool.trail.geometry.getAttribute("position").needsUpdate = true;
    });
  }
}
