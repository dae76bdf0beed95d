// One group's surfaces: the patient's, which may be cut, and on demand the mock-up's as a ghost.
import {
  BackSide, BufferAttribute, BufferGeometry, DynamicDrawUsage, FrontSide, Matrix4, Mesh, type MeshPhongMaterial, type Object3D, type Vector3,
} from "three";
import { CaseGroup_Kind } from "wire";
import { isSkin } from "../groups";
import type { Tissue } from "../mesh";
import { addNormals, type Group } from "./anatomy";
import type { ColourMap, MapName } from "./colours";
import { Fringe } from "./fringe";
import { grainOf, tissueMaterial } from "./materials";
import { Dent, depthAt, type Shade } from "./touch";
import { displacements, Grid, GRID_MM, Rim, paintMeasured, paintMismatch, paintPlan, paintTissue, REACH, type Canvas } from "./paint";

const GHOST = 0x4aa3ff;

export class Surface {
  readonly shown: Mesh<BufferGeometry, MeshPhongMaterial>;
  readonly other = new Matrix4(); // of the body that it bridges to, in its own body's frame
  readonly otherPhysical = new Matrix4();
  private ghost: Mesh | undefined;
  private canvas: Canvas;
  private readonly rim: Rim | undefined;
  private readonly fringe: Fringe | undefined; // in the scope, of a meniscus
  private readonly inScope: boolean;
  private grid: Grid | undefined;
  number = 0; // of the tissue that is shown; 0: the case's own surface
  private hash = 0n;
  private twin = 0; // vertex i of a cut surface is i + twin; 0: the mesh has none

  readonly dent: Dent | undefined; // in the scope, of what does not bend between bodies

  /** `shade`: in the scope, what takes light from it. */
  constructor(readonly group: Group, shade?: Shade) {
    const inScope = (this.inScope = shade !== undefined);
    const grain = inScope ? grainOf(group.about, group.wear !== undefined) : undefined;
    if (grain?.give && !group.otherShare) this.dent = new Dent(grain.give);
    const geometry = new BufferGeometry();
    const { positions, normals } = group.virtual;
    const count = positions.length / 3;
    geometry.setAttribute("position", new BufferAttribute(positions, 3));
    geometry.setAttribute("normal", new BufferAttribute(normals, 3));
    geometry.setAttribute("color", new BufferAttribute(new Uint8Array(4 * count), 4, true));
    geometry.setIndex(new BufferAttribute(group.triangles, 1));
    if (group.otherShare) geometry.setAttribute("share", new BufferAttribute(group.otherShare, 1));
    const skin = isSkin(group.about);
    this.shown = new Mesh(geometry, tissueMaterial({
      grain, dent: this.dent, shade, side: inScope && skin ? BackSide : FrontSide, // the scope is in it
      opacity: skin && !inScope ? 0.25 : 1,
    }, group.otherShare && this.other));
    this.shown.frustumCulled = false;
    this.shown.userData.body = group.body;
    this.shown.castShadow = !group.otherShare; // what bends is drawn from elsewhere than where its vertices are
    this.shown.receiveShadow = true;
    this.rim = inScope && group.about.kind === CaseGroup_Kind.MENISCUS ? new Rim(positions) : undefined;
    this.fringe = this.rim && new Fringe(this.dent);
    if (this.fringe) this.shown.add(this.fringe.lines);
    if (inScope && skin) this.shown.renderOrder = 1; // last: most of it is behind other things
    this.canvas = this.newCanvas(positions, count, () => false);
    this.paint("none");
  }

  /** The mock-up's surface, translucent; it is made when it is first asked for. */
  showGhost(on: boolean, parent: Object3D): void {
    if (on && !this.ghost) {
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(this.group.physical.positions, 3));
      geometry.setAttribute("normal", new BufferAttribute(this.group.physical.normals, 3));
      geometry.setIndex(this.shown.geometry.index && new BufferAttribute(this.group.triangles, 1));
      if (this.group.otherShare) geometry.setAttribute("share", new BufferAttribute(this.group.otherShare, 1));
      this.ghost = new Mesh(geometry, tissueMaterial({ opacity: 0.3, colour: GHOST }, this.group.otherShare && this.otherPhysical));
      this.ghost.frustumCulled = false;
      this.ghost.renderOrder = 2;
      parent.add(this.ghost);
    }
    if (this.ghost) this.ghost.visible = on;
  }

  /** The mesh as it is cut. True where it is another than the one that is shown. */
  setTissue(tissue: Tissue): boolean {
    if (tissue.number === this.number && tissue.hash === this.hash) return false;
    this.number = tissue.number;
    this.hash = tissue.hash;
    this.makeRoom(tissue);
    const { geometry } = this.shown;
    const positions = geometry.getAttribute("position").array as Float32Array;
    const used = tissue.positions.subarray(0, 3 * tissue.vertexBound);
    positions.set(used, 0);
    positions.set(used, 3 * this.twin);
    const index = geometry.index!.array as Uint32Array;
    let count = 0;
    for (let t = 0; t < tissue.triangleBound; t++) {
      if (!tissue.lives(t)) continue;
      const shift = tissue.labels[t] ? this.twin : 0;
      for (let k = 0; k < 3; k++) index[count++] = tissue.corners[3 * t + k]! + shift;
    }
    this.takeMismatch(tissue);
    const normals = geometry.getAttribute("normal").array as Float32Array;
    addNormals(positions, index, count, normals);
    this.fringe?.set(positions, normals, this.twin);
    if (this.inScope) this.roundEdges(normals);
    geometry.setDrawRange(0, count);
    for (const name of ["position", "normal"]) geometry.getAttribute(name).needsUpdate = true;
    geometry.index!.needsUpdate = true;
    this.grid = undefined;
    return true;
  }

  // Where a cut meets the surface, each of a vertex's two normals leans half towards the other's.
  private roundEdges(normals: Float32Array): void {
    const shift = 3 * this.twin;
    for (let i = 0; i < shift; i += 3)
      for (let k = i; k < i + 3; k++) {
        const [a, b] = [normals[k]!, normals[k + shift]!];
        normals[k] = a + 0.5 * b;
        normals[k + shift] = b + 0.5 * a;
      }
  }

  private takeMismatch({ mismatch, mismatchStep, vertexBound }: Tissue): void {
    this.canvas.mismatch = mismatchStep ? (this.canvas.mismatch ?? new Float32Array(this.canvas.count)) : undefined;
    for (let i = 0; this.canvas.mismatch && i < vertexBound; i++)
      this.canvas.mismatch[i] = this.canvas.mismatch[i + this.twin] = mismatchStep * mismatch[i]!;
  }

  private makeRoom(tissue: Tissue): void {
    const triangles = 3 * tissue.triangleCount;
    if (this.twin >= tissue.vertexBound && this.shown.geometry.index!.count >= triangles) return;
    this.twin = Math.ceil(1.3 * tissue.vertexBound);
    const count = 2 * this.twin;
    const geometry = new BufferGeometry();
    const attribute = (array: Float32Array | Uint8Array | Uint32Array, size: number): BufferAttribute =>
      new BufferAttribute(array, size, array instanceof Uint8Array).setUsage(DynamicDrawUsage);
    geometry.setAttribute("position", attribute(new Float32Array(3 * count), 3));
    geometry.setAttribute("normal", attribute(new Float32Array(3 * count), 3));
    geometry.setAttribute("color", attribute(new Uint8Array(4 * count), 4));
    geometry.setIndex(attribute(new Uint32Array(Math.ceil(1.3 * triangles)), 1));
    this.shown.geometry.dispose();
    this.shown.geometry = geometry;
    const { twin } = this;
    this.canvas = this.newCanvas(geometry.getAttribute("position").array as Float32Array, count, (vertex) => vertex >= twin);
  }

  private newCanvas(positions: Float32Array, count: number, cut: (vertex: number) => boolean): Canvas {
    const colours = this.shown.geometry.getAttribute("color").array as Uint8Array;
    return { group: this.group, inside: this.inScope, count, positions, colours, cut, rim: this.rim, measured: new Float32Array(count).fill(NaN), mismatch: undefined };
  }

  /** To a tip in the body's frame. */
  yieldTo(tip: Vector3): void {
    if (!this.dent) return;
    const { positions, count } = this.canvas;
    this.grid ??= new Grid(positions, count, GRID_MM);
    const depth = depthAt(this.grid, positions, this.shown.geometry.getAttribute("normal").array, tip);
    if (depth) this.dent.set(tip, depth);
  }

  // ---- maps -----------------------------------------------------------------------------------------

  /** Nothing was measured yet. */
  forget(): void {
    this.canvas.measured.fill(NaN);
  }

  /** Keeps the greatest of what was measured near a point, in the frame of S'. True where it is near. */
  measure(map: MapName, x: number, y: number, z: number, value: number): boolean {
    const { positions, count, measured } = this.canvas;
    this.grid ??= new Grid(positions, count, GRID_MM);
    let touched = false;
    this.grid.near(x, y, z, REACH[map]!, (vertex) => {
      if (!(measured[vertex]! >= value)) {
        measured[vertex] = value;
        touched = true;
      }
    });
    return touched;
  }

  /** Measures how far the surface is shown from the mock-up's; the greatest, mm. */
  displace(body: Matrix4, shown: Matrix4): number {
    return displacements(this.canvas, this.twin ? this.origins() : (vertex) => vertex, body, shown);
  }

  // Of a vertex of the cut mesh the nearest one of the case's: cuts leave most of them where they were.
  private origins(): (vertex: number) => number {
    const { positions } = this.canvas;
    const grid = new Grid(this.group.virtual.positions, this.group.virtual.positions.length / 3, GRID_MM);
    return (vertex) => {
      let best = 0;
      let least = Infinity;
      grid.near(positions[3 * vertex]!, positions[3 * vertex + 1]!, positions[3 * vertex + 2]!, GRID_MM, (near, distance) => {
        if (distance < least) [best, least] = [near, distance];
      });
      return best;
    };
  }

  paint(name: MapName, map?: ColourMap): void {
    if (name === "none") paintTissue(this.canvas);
    else if (name === "plan") paintPlan(this.canvas);
    else if (name === "mismatch") paintMismatch(this.canvas);
    else if (map) paintMeasured(this.canvas, map);
    this.shown.geometry.getAttribute("color").needsUpdate = true;
  }

  dispose(): void {
    this.shown.geometry.dispose();
    this.shown.material.dispose();
    this.fringe?.dispose();
    if (this.ghost) {
      this.ghost.geometry.dispose();
      (this.ghost.material as MeshPhongMaterial).dispose();
    }
  }
}
