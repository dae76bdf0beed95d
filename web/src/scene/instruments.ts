// The instruments' shapes, in the tip's frame: the origin in the tip, z along the shaft away from the
// handle, y the side to which a punch's upper jaw opens and a knife's edge looks. The parts that cut have
// the sizes that the cuts are made with (server/cut/blade.c).
import {
  BoxGeometry, BufferAttribute, BufferGeometry, CylinderGeometry, Group, Matrix4, Mesh, SphereGeometry, TorusGeometry, type Material,
} from "three";

const SHAFT = 130; // mm
const HANDLE = 34;
const JAW = 6;
const JAW_OPEN = (35 * Math.PI) / 180;
const HOOK = 1.7; // how far a probe's hook stands from its shaft's axis
const BURR = 2;
const TURNS = 4; // of a burr, each second: as many as the eye can follow

export interface Shape {
  root: Group;
  /** How open the handle is, whether it runs, and the time in s. */
  move(opening: number, running: boolean, time: number): void;
}

function merged(...parts: BufferGeometry[]): BufferGeometry {
  const flat = parts.map((part) => part.toNonIndexed());
  const geometry = new BufferGeometry();
  for (const name of ["position", "normal"]) {
    const arrays = flat.map((part) => part.getAttribute(name).array);
    const all = new Float32Array(arrays.reduce((sum, array) => sum + array.length, 0));
    let at = 0;
    for (const array of arrays) {
      all.set(array, at);
      at += array.length;
    }
    geometry.setAttribute(name, new BufferAttribute(all, 3));
  }
  return geometry;
}

// A tube along z from one place to another.
function tube(radius: number, from: number, to: number, x = 0, y = 0, end = radius): BufferGeometry {
  return new CylinderGeometry(end, radius, to - from, 20).rotateX(Math.PI / 2).translate(x, y, (from + to) / 2);
}

function shaftAndHandle(radius: number, from: number, y = 0): BufferGeometry[] {
  return [tube(radius, -SHAFT, from, 0, y), tube(radius + 2.6, -SHAFT - HANDLE, -SHAFT, 0, y), tube(radius + 3.4, -SHAFT - 4, -SHAFT, 0, y)];
}

function still(root: Group): Shape {
  return { root, move: () => {} };
}

function group(...meshes: Mesh[]): Group {
  const root = new Group();
  root.add(...meshes);
  return root;
}

function probe(material: Material): Shape {
  const bend = new TorusGeometry(0.7, 0.45, 8, 8, Math.PI / 2).rotateY(Math.PI / 2).translate(0, HOOK - 0.7, -1.15);
  const hook = new CylinderGeometry(0.45, 0.32, HOOK - 0.7, 10).translate(0, (HOOK - 0.7) / 2, -0.45);
  const tip = new SphereGeometry(0.34, 10, 8).translate(0, 0.34, -0.45);
  return still(group(new Mesh(merged(...shaftAndHandle(0.85, -1.1, HOOK), bend, hook, tip), material)));
}

function punch(material: Material): Shape {
  const lower = new BoxGeometry(3.5, 0.9, JAW).translate(0, -0.5, -JAW / 2);
  const nose = new CylinderGeometry(1.75, 1.75, 0.9, 16, 1, false, -Math.PI / 2, Math.PI).translate(0, -0.5, -0.6);
  const body = new Mesh(merged(...shaftAndHandle(1.75, -JAW - 0.5), lower, nose), material);
  const upper = new BoxGeometry(3.1, 0.9, JAW + 0.2).translate(0, 0.5, JAW / 2);
  const jaw = new Mesh(merged(upper), material);
  jaw.position.set(0, 0, -JAW);
  return {
    root: group(body, jaw),
    move: (opening) => {
      jaw.rotation.x = -opening * JAW_OPEN;
    },
  };
}

// The tube is open towards y at its end; in it the burr turns.
function shaver(material: Material, bright: Material): Shape {
  const window = new CylinderGeometry(BURR + 0.35, BURR + 0.35, 5, 20, 1, true, Math.PI / 2 + 0.7, 2 * Math.PI - 1.8).rotateX(Math.PI / 2).translate(0, 0, -2.8);
  const body = new Mesh(merged(...shaftAndHandle(BURR + 0.35, -5.2), window), material);
  const teeth = Array.from({ length: 6 }, (_, i) => {
    const angle = (i * Math.PI) / 3;
    return new BoxGeometry(0.5, 0.5, 2.6).translate(BURR - 0.35, 0, -BURR).applyMatrix4(new Matrix4().makeRotationZ(angle));
  });
  const burr = new Mesh(merged(new SphereGeometry(BURR - 0.2, 16, 12).translate(0, 0, -BURR), tube(1.2, -5, -BURR), ...teeth), bright);
  return {
    root: group(body, burr),
    move: (opening, running, time) => {
      if (running || opening > 0.5) burr.rotation.z = 2 * Math.PI * TURNS * time;
    },
  };
}

function knife(material: Material, bright: Material): Shape {
  const blade = new BoxGeometry(0.2, 2.5, 3.5).translate(0, 0, -1.75);
  const back = new BoxGeometry(0.5, 1.4, 5).translate(0, -0.2, -5.5);
  return still(group(new Mesh(merged(...shaftAndHandle(1.5, -7.5), back), material), new Mesh(blade, bright)));
}

function scope(material: Material, bright: Material): Shape {
  const head = new BoxGeometry(13, 13, 20).translate(0, 0, -SHAFT - 8);
  const post = new CylinderGeometry(1.8, 1.8, 14, 12).translate(0, -9, -SHAFT + 8);
  const body = new Mesh(merged(tube(2, -SHAFT, -1.2), tube(4.5, -SHAFT, -SHAFT + 14), head, post), material);
  const lens = new Mesh(new CylinderGeometry(1.7, 1.9, 1.6, 20).rotateX(Math.PI / 2).translate(0, 0, -0.8), bright);
  return still(group(body, lens));
}

const SHAPES = [probe, punch, shaver, knife, scope];

/** The shape of an instrument, from 0, the probe; `bright`: of the part that does the work. */
export function shapeOf(instrument: number, material: Material, bright: Material): Shape {
  return SHAPES[instrument]!(material, bright);
}

