// The joint in three dimensions: bones, menisci and ligaments as the patient has them, the mock-up's as a
// ghost, instruments as measured and as shown, their trails, the marker, colour maps. Millimetres, in the
// mock-up's frame: x to the patient's right, y anterior, z proximal.
import {
  BufferAttribute, BufferGeometry, Color, Group, Line, LineBasicMaterial, Matrix4, Mesh, MeshBasicMaterial, Object3D, Quaternion,
  RingGeometry, SphereGeometry, Vector3,
} from "three";
import { CaseGroup_Kind, type LooseBody } from "wire";
import {
  BODIES, bodyAt, BUTTONS, GAIN, HAS_WARPED, INSTRUMENTS, LOST, NEAREST, OPENING, PENETRATION, SEEN, TIP, toolAt, WARPED,
  type History, type Row,
} from "../history";
import { isSkin } from "../groups";
import { colourOf, isOptic, runs, USUAL, type Instruments } from "../instruments";
import type { Tissue } from "../mesh";
import type { Knee } from "./anatomy";
import { MAPS, scaledTo, type ColourMap, type MapName } from "./colours";
import { shapeOf, type Shape } from "./instruments";
import { LooseBodies } from "./loose";
import { DetachedPieces } from "./pieces";
import { steelMaterial } from "./materials";
import { Surface } from "./surface";
import { Shade } from "./touch";

export interface Show {
  ghost: boolean;
  raw: boolean;
  trails: boolean;
  femur: boolean;
  patella: boolean;
  ligaments: boolean;
  skin: boolean;
  seeThrough: boolean; // the bones that hide the work: femur and patella
  map: MapName;
}

export const USUAL_SHOW: Show = {
  ghost: false, raw: true, trails: true, femur: true, patella: true, ligaments: true, skin: false, seeThrough: true, map: "none",
};

export interface Marker {
  body: number;
  point: { x: number; y: number; z: number };
}

export const TRAIL_S = 8;
export const TRAIL_POINTS = 400;
const MARKER = 0x00a8ff;
const PAINT_MS = 250;
const PARKED_MM = 120; // from the joint's middle: no tip within the knee is so far
const MOVED_MM = 0.05; // of a body: displacements are measured again

interface Tool {
  shown: Shape;
  raw: Shape;
  trails: [shown: Line, raw: Line];
}

const position = new Vector3();
const rotation = new Quaternion();
const one = new Vector3(1, 1, 1);
const scratch = new Matrix4();

export function poseMatrix(row: Row, at: number, out: Matrix4): Matrix4 {
  rotation.set(row[at + 1]!, row[at + 2]!, row[at + 3]!, row[at]!).normalize();
  return out.compose(position.set(row[at + 4]!, row[at + 5]!, row[at + 6]!), rotation, one);
}

function setPose(node: Object3D, row: Row, at: number): void {
  poseMatrix(row, at, node.matrix);
  node.matrixWorldNeedsUpdate = true;
}

function fixed(): Group {
  const group = new Group();
  group.matrixAutoUpdate = false;
  return group;
}

function release(root: Object3D): void {
  root.traverse((node) => {
    const { geometry, material } = node as Partial<Mesh>;
    geometry?.dispose();
    if (material && !Array.isArray(material)) material.dispose();
  });
}

export class Joint {
  readonly root = new Group();
  readonly surfaces: Surface[];
  map: ColourMap | undefined; // as it is scaled now
  onMap: () => void = () => {};

  private readonly bodies = Array.from({ length: BODIES }, () => ({ physical: fixed(), virtual: fixed() }));
  private readonly tools: (Tool | undefined)[] = Array.from({ length: INSTRUMENTS });
  private instruments: Instruments = USUAL;
  private readonly marker: Group;
  private readonly pieces = new DetachedPieces();
  private readonly loose: LooseBodies;
  readonly shade = new Shade();
  private show: Show = { ...USUAL_SHOW };
  private stale = new Set<Surface>(); // to be painted anew
  private paintedAt = 0;
  private readonly displacedAt = Array.from({ length: 2 * BODIES }, () => new Matrix4());

  constructor(readonly knee: Knee, private readonly inScope = false) {
    this.surfaces = knee.groups.filter(({ body }) => body >= 0).map((group) => new Surface(group, inScope ? this.shade : undefined));
    for (const { physical, virtual } of this.bodies) this.root.add(physical, virtual);
    for (const surface of this.surfaces) this.bodies[surface.group.body]!.virtual.add(surface.shown);
    this.loose = new LooseBodies(inScope);
    this.root.add(this.loose.root);
    this.marker = markerShape();
    this.setShow(this.show);
  }

  dispose(): void {
    for (const surface of this.surfaces) surface.dispose();
    release(this.root);
  }

  /** Those of the session. What is shown of others goes. */
  setInstruments(instruments: Instruments): void {
    if (instruments === this.instruments) return;
    this.instruments = instruments;
    this.tools.forEach((tool, place) => {
      if (!tool) return;
      for (const node of [tool.shown.root, tool.raw.root, ...tool.trails]) {
        release(node);
        this.root.remove(node);
      }
      this.tools[place] = undefined;
    });
  }

  /** The loose bodies of the session's case. */
  setLoose(bodies: readonly LooseBody[]): void {
    this.loose.set(bodies);
  }

  setShow(show: Show): void {
    const repaint = show.map !== this.show.map;
    this.show = { ...show };
    for (const surface of this.surfaces) {
      const { about, bone, body, cuttable } = surface.group;
      const skin = isSkin(about);
      const always = bone || cuttable || about.kind === CaseGroup_Kind.MENISCUS;
      surface.shown.visible = bone && body === 0 ? show.femur : bone && body === 2 ? show.patella : skin ? show.skin : always || show.ligaments;
      surface.showGhost(show.ghost && surface.shown.visible && !skin, this.bodies[body]!.physical);
      if (!bone || body === 1) continue; // the tibia lies below the work
      const { material } = surface.shown;
      if (material.transparent !== show.seeThrough) material.needsUpdate = true; // compiled for one of the two
      material.transparent = show.seeThrough;
      material.opacity = show.seeThrough ? 0.28 : 1;
      material.depthWrite = !show.seeThrough;
      surface.shown.renderOrder = show.seeThrough ? 1 : 0;
    }
    for (const tool of this.tools) if (tool) for (const trail of tool.trails) trail.visible = show.trails;
    if (!repaint) return;
    this.displacedAt[0]!.elements[0] = NaN; // never displaced before
    for (const surface of this.surfaces) this.stale.add(surface);
    this.paintedAt = 0;
    this.map = show.map === "none" ? undefined : MAPS[show.map];
    if (show.map === "gain" || show.map === "contact") this.forget();
    this.onMap();
  }

  /** What was measured along the path so far is gone. */
  forget(): void {
    for (const surface of this.surfaces) {
      surface.forget();
      this.stale.add(surface);
    }
  }

  // ---- a moment -------------------------------------------------------------------------------------

  setRow(row: Row, time: number): void {
    for (let body = 0; body < BODIES; body++) {
      setPose(this.bodies[body]!.physical, row, bodyAt(body, false));
      setPose(this.bodies[body]!.virtual, row, bodyAt(body, true));
    }
    for (const surface of this.surfaces) {
      const { body, other } = surface.group;
      if (other < 0) continue;
      surface.other.copy(this.bodies[body]!.virtual.matrix).invert().multiply(this.bodies[other]!.virtual.matrix);
      surface.otherPhysical.copy(this.bodies[body]!.physical.matrix).invert().multiply(this.bodies[other]!.physical.matrix);
    }
    for (let instrument = 0; instrument < this.instruments.length; instrument++) this.moveTool(instrument, row, time);
    this.loose.move(row);
  }

  private moveTool(instrument: number, row: Row, time: number): void {
    const at = toolAt(instrument);
    const seen = row[at + SEEN]!;
    if (seen === 0) {
      const tool = this.tools[instrument];
      if (tool) tool.shown.root.visible = tool.raw.root.visible = false;
      return;
    }
    const tool = (this.tools[instrument] ??= this.newTool(instrument));
    const there = seen - 1 !== LOST;
    const inside = this.inScope && isOptic(this.instruments[instrument]);
    const away = Math.hypot(row[at + WARPED + 4]!, row[at + WARPED + 5]!, row[at + WARPED + 6]!);
    const parked = this.inScope && away > PARKED_MM;
    tool.shown.root.visible = there && row[at + HAS_WARPED] === 1 && !inside && !parked;
    tool.raw.root.visible = there && this.show.raw && !this.inScope;
    setPose(tool.shown.root, row, at + WARPED);
    setPose(tool.raw.root, row, at + TIP);
    const running = runs(this.instruments[instrument], row[at + BUTTONS]!);
    tool.shown.move(row[at + OPENING]!, running, time);
    tool.raw.move(row[at + OPENING]!, running, time);
  }

  private newTool(instrument: number): Tool {
    const described = this.instruments[instrument]!;
    const colour = colourOf(described, instrument);
    const bright = steelMaterial(0xe6ebef, 1, this.inScope);
    const steel = new Color(this.inScope ? 0xd8dfe4 : 0x9aa5ae).lerp(new Color(colour), this.inScope ? 0 : 0.25);
    const shown = shapeOf(described, steelMaterial(steel.getHex(), 1, this.inScope), bright);
    shown.root.traverse((node) => (node.castShadow = node.receiveShadow = true));
    const ghost = steelMaterial(colour, 0.22);
    const raw = shapeOf(described, ghost, ghost);
    for (const shape of [shown, raw]) {
      shape.root.matrixAutoUpdate = false;
      this.root.add(shape.root);
    }
    raw.root.renderOrder = 3;
    const trails: [Line, Line] = [trail(colour, 1), trail(colour, 0.4)];
    for (const line of trails) line.visible = this.show.trails && !this.inScope;
    this.root.add(...trails);
    return { shown, raw, trails };
  }

  /** In the scope tips dent what they press on, and shafts shade what is near. `toEye`: from the joint's frame to the camera's. */
  touch(toEye: Matrix4): void {
    this.shade.clear();
    for (const { dent } of this.surfaces) dent?.clear();
    this.tools.forEach((tool, place) => {
      if (!tool?.shown.root.visible) return;
      const { root: { matrix }, shaft } = tool.shown;
      this.shade.add(scratch.multiplyMatrices(toEye, matrix), shaft);
      if (this.instruments[place]!.cuts) return;
      for (const surface of this.surfaces) {
        scratch.copy(this.bodies[surface.group.body]!.virtual.matrix).invert();
        surface.yieldTo(position.setFromMatrixPosition(matrix).applyMatrix4(scratch));
      }
    });
  }

  /** The ways of the tips in the last seconds before a time. */
  setTrails(history: History, time: number): void {
    if (!this.show.trails) return;
    const last = history.indexAt(time);
    const first = Math.max(0, history.indexAt(time - TRAIL_S), last - TRAIL_POINTS + 1);
    this.tools.forEach((tool, instrument) => {
      if (!tool) return;
      fillTrail(tool.trails[0], history, first, last, toolAt(instrument), WARPED);
      fillTrail(tool.trails[1], history, first, last, toolAt(instrument), TIP);
      tool.trails[1].visible = this.show.raw;
    });
  }

  /** The mesh as it is cut. What came off on the way from the one that is shown is seen for a moment. */
  setTissue(group: string, tissue: Tissue): void {
    const surface = this.surfaces.find((of) => of.group.name === group);
    if (!surface) return;
    const { number } = surface;
    if (!surface.setTissue(tissue)) return;
    this.stale.add(surface);
    if (!number || number !== tissue.before) return;
    for (const piece of tissue.pieces) this.pieces.add(piece, surface.group.about, this.bodies[surface.group.body]!.virtual, this.inScope);
  }

  /** Shows something that goes with the patient's bone. */
  attach(body: number, node: Object3D): void {
    this.bodies[body]!.virtual.add(node);
  }

  // ---- maps -----------------------------------------------------------------------------------------

  /** What an instrument measured at that moment, for the map that is shown. Call with the bodies of the same row. */
  measure(row: Row): void {
    const { map } = this.show;
    if (map !== "gain" && map !== "contact") return;
    for (let instrument = 0; instrument < this.instruments.length; instrument++) {
      if (isOptic(this.instruments[instrument])) continue;
      const at = toolAt(instrument);
      if (row[at + SEEN]! !== 1 || row[at + HAS_WARPED] !== 1) continue;
      const value = map === "gain" ? row[at + GAIN]! : row[at + PENETRATION]!;
      const near = map === "gain" ? row[at + NEAREST]! >= 0 && row[at + NEAREST]! < 5 : value > 0.02;
      if (near) this.measureAt(map, row, at + WARPED + 4, value);
    }
  }

  private measureAt(map: MapName, row: Row, at: number, value: number): void {
    for (let body = 0; body < BODIES; body++) {
      poseMatrix(row, bodyAt(body, true), scratch).invert();
      const { x, y, z } = position.set(row[at]!, row[at + 1]!, row[at + 2]!).applyMatrix4(scratch);
      for (const surface of this.surfaces)
        if (surface.group.body === body && !isSkin(surface.group.about) && surface.measure(map, x, y, z, value)) this.stale.add(surface);
    }
  }

  /** Paints what has changed, some times a second, and moves what came off. True where a picture is needed again for it. */
  paint(now: number): boolean {
    const drifting = this.pieces.move(now);
    return this.paintStale(now) || drifting;
  }

  private paintStale(now: number): boolean {
    if (now - this.paintedAt < PAINT_MS) return this.stale.size > 0;
    if (this.show.map === "displacement") this.displace();
    if (!this.stale.size) return false;
    this.paintedAt = now;
    for (const surface of this.stale) surface.paint(this.show.map, this.map);
    this.stale.clear();
    return true;
  }

  private displace(): void {
    const moved = this.bodies.some(({ physical, virtual }, body) => {
      const shift = scratch.copy(virtual.matrix).invert().multiply(physical.matrix);
      return !near(shift, this.displacedAt[body]!);
    });
    if (!moved && !this.stale.size) return;
    this.bodies.forEach(({ physical, virtual }, body) => this.displacedAt[body]!.copy(virtual.matrix).invert().multiply(physical.matrix));
    let most = 0;
    for (const surface of this.surfaces) {
      const { physical, virtual } = this.bodies[surface.group.body]!;
      const greatest = surface.displace(physical.matrix, virtual.matrix);
      if (!isSkin(surface.group.about) && surface.group.other < 0) most = Math.max(most, greatest);
      this.stale.add(surface);
    }
    this.map = scaledTo(MAPS.displacement, most);
    this.onMap();
  }

  // ---- the marker -----------------------------------------------------------------------------------

  setMarker(marker: Marker | undefined): void {
    this.marker.removeFromParent();
    if (!marker) return;
    this.marker.position.set(marker.point.x, marker.point.y, marker.point.z);
    this.bodies[marker.body]?.virtual.add(this.marker);
  }

  /** The marker's ring turns to the eye. */
  faceMarker(eye: Quaternion): void {
    const { parent } = this.marker;
    if (parent) this.marker.quaternion.copy(parent.getWorldQuaternion(rotation).invert()).multiply(eye);
  }

  /** Where a point of the mock-up's frame lies on the nearest of the surfaces that are shown. */
  markerAt(point: Vector3): Marker | undefined {
    let best: Marker | undefined;
    let least = Infinity;
    for (const surface of this.touchable()) {
      const { body } = surface.group;
      const local = point.clone().applyMatrix4(scratch.copy(this.bodies[body]!.virtual.matrix).invert());
      const positions = surface.shown.geometry.getAttribute("position").array;
      const index = surface.shown.geometry.index!;
      const count = Math.min(surface.shown.geometry.drawRange.count, index.count);
      for (let i = 0; i < count; i++) {
        const at = 3 * index.array[i]!;
        const distance = Math.hypot(positions[at]! - local.x, positions[at + 1]! - local.y, positions[at + 2]! - local.z);
        if (distance < least) {
          least = distance;
          best = { body, point: { x: local.x, y: local.y, z: local.z } };
        }
      }
    }
    return best;
  }

  /** What a ray can hit. */
  targets(): Mesh[] {
    return this.touchable().map(({ shown }) => shown);
  }

  // The patient's surfaces that are shown, except the skin and what bends between two bodies.
  private touchable(): Surface[] {
    return this.surfaces.filter(({ shown, group }) => shown.visible && group.other < 0 && !isSkin(group.about));
  }

  /** The point of a hit in the frame of its body. */
  markerOf(mesh: Object3D, point: Vector3): Marker {
    const body = mesh.userData.body as number;
    const { x, y, z } = point.clone().applyMatrix4(scratch.copy(this.bodies[body]!.virtual.matrix).invert());
    return { body, point: { x, y, z } };
  }
}

function near(a: Matrix4, b: Matrix4): boolean {
  // A turn by 0.001 moves the joint's rim, 50 mm away, by as much as MOVED_MM.
  return a.elements.every((value, i) => Math.abs(value - b.elements[i]!) < (i < 12 ? MOVED_MM / 50 : MOVED_MM));
}

export function trail(colour: number, opacity: number): Line {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(3 * TRAIL_POINTS), 3));
  geometry.setDrawRange(0, 0);
  const line = new Line(geometry, new LineBasicMaterial({ color: colour, transparent: opacity < 1, opacity }));
  line.frustumCulled = false;
  return line;
}

function fillTrail(line: Line, history: History, first: number, last: number, tool: number, pose: number): void {
  const attribute = line.geometry.getAttribute("position");
  const points = attribute.array;
  let count = 0;
  for (let i = last; i >= first; i--) {
    const seen = history.value(i, tool + SEEN);
    if (seen === 0 || seen - 1 === LOST || (pose === WARPED && history.value(i, tool + HAS_WARPED) !== 1)) break;
    for (let k = 0; k < 3; k++) points[count++] = history.value(i, tool + pose + 4 + k);
  }
  line.geometry.setDrawRange(0, count / 3);
  attribute.needsUpdate = true;
}

function markerShape(): Group {
  const ball = new Mesh(new SphereGeometry(0.7, 16, 12), new MeshBasicMaterial({ color: MARKER, toneMapped: false }));
  const ring = new Mesh(new RingGeometry(1.9, 2.4, 32), new MeshBasicMaterial({ color: MARKER, transparent: true, opacity: 0.9, depthTest: false, depthWrite: false, toneMapped: false }));
  ring.renderOrder = 5;
  const group = new Group();
  group.add(ball, ring);
  return group;
}
