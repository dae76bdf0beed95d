// The instruments' shapes, in the tip's frame: the origin in the tip, z along the shaft away from the
// handle, y the side to which an upper jaw opens and a blade's edge looks. The parts that cut have
// the sizes that the cuts are made with (shared/base/instrument.h).
import {
  BoxGeometry, BufferAttribute, BufferGeometry, CylinderGeometry, Group, Matrix4, Mesh, SphereGeometry, TorusGeometry, type Material,
} from "three";
import { Instrument_Kind, type Instrument } from "wire";

const SHAFT = 130; // mm
const HANDLE = 34;
const SHAFT_MOST = 2.5; // its radius behind a jaw or a burr
const HOOK = 1.7; // how far a probe's hook stands from its shaft's axis
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

type Make = (instrument: Instrument, material: Material, bright: Material) => Shape;

function probe(_: Instrument, material: Material): Shape {
  const bend = new TorusGeometry(0.7, 0.45, 8, 8, Math.PI / 2).rotateY(Math.PI / 2).translate(0, HOOK - 0.7, -1.15);
  const hook = new CylinderGeometry(0.45, 0.32, HOOK - 0.7, 10).translate(0, (HOOK - 0.7) / 2, -0.45);
  const tip = new SphereGeometry(0.34, 10, 8).translate(0, 0.34, -0.45);
  return still(group(new Mesh(merged(...shaftAndHandle(0.85, -1.1, HOOK), bend, hook, tip), material)));
}

function jaws({ lengthMm: length, widthMm: width, openingDeg }: Instrument, material: Material): Shape {
  const half = width / 2;
  const lower = new BoxGeometry(width, 0.9, length).translate(0, -0.5, -length / 2);
  const nose = new CylinderGeometry(half, half, 0.9, 16, 1, false, -Math.PI / 2, Math.PI).translate(0, -0.5, -0.6);
  const body = new Mesh(merged(...shaftAndHandle(Math.min(half, SHAFT_MOST), -length - 0.5), lower, nose), material);
  const upper = new BoxGeometry(width - Math.min(0.4, half), 0.9, length + 0.2).translate(0, 0.5, length / 2);
  const jaw = new Mesh(merged(upper), material);
  jaw.position.set(0, 0, -length);
  return {
    root: group(body, jaw),
    move: (opening) => {
      jaw.rotation.x = (-opening * openingDeg * Math.PI) / 180;
    },
  };
}

// The tube is open towards y at its end; in it the burr turns.
function shaver({ widthMm }: Instrument, material: Material, bright: Material): Shape {
  const radius = widthMm / 2;
  const window = new CylinderGeometry(radius + 0.35, radius + 0.35, 5, 20, 1, true, Math.PI / 2 + 0.7, 2 * Math.PI - 1.8).rotateX(Math.PI / 2).translate(0, 0, -2.8);
  const body = new Mesh(merged(...shaftAndHandle(radius + 0.35, -5.2), window), material);
  const teeth = Array.from({ length: 6 }, (_, i) => {
    const angle = (i * Math.PI) / 3;
    return new BoxGeometry(0.5, 0.5, 2.6).translate(radius - 0.35, 0, -radius).applyMatrix4(new Matrix4().makeRotationZ(angle));
  });
  const burr = new Mesh(merged(new SphereGeometry(0.9 * radius, 16, 12).translate(0, 0, -radius), tube(0.6 * radius, -5, -radius), ...teeth), bright);
  return {
    root: group(body, burr),
    move: (opening, running, time) => {
      if (running || opening > 0.5) burr.rotation.z = 2 * Math.PI * TURNS * time;
    },
  };
}

function knife({ lengthMm: length, widthMm: width, thicknessMm }: Instrument, material: Material, bright: Material): Shape {
  const blade = new BoxGeometry(thicknessMm, width, length).translate(0, 0, -length / 2);
  const back = new BoxGeometry(Math.max(0.5, thicknessMm), 1.4, 5).translate(0, -0.2, -length - 2);
  return still(group(new Mesh(merged(...shaftAndHandle(1.5, -length - 4), back), material), new Mesh(blade, bright)));
}

function scope(_: Instrument, material: Material, bright: Material): Shape {
  const head = new BoxGeometry(13, 13, 20).translate(0, 0, -SHAFT - 8);
  const post = new CylinderGeometry(1.8, 1.8, 14, 12).translate(0, -9, -SHAFT + 8);
  const body = new Mesh(merged(tube(2, -SHAFT, -1.2), tube(4.5, -SHAFT, -SHAFT + 14), head, post), material);
  const lens = new Mesh(new CylinderGeometry(1.7, 1.9, 1.6, 20).rotateX(Math.PI / 2).translate(0, 0, -0.8), bright);
  return still(group(body, lens));
}

const SHAPES: Record<Instrument_Kind, Make> = {
  [Instrument_Kind.TIP]: probe,
  [Instrument_Kind.JAW]: jaws,
  [Instrument_Kind.BURR]: shaver,
  [Instrument_Kind.BLADE]: knife,
  [Instrument_Kind.OPTIC]: scope,
};

/** An instrument by its kind and sizes; `bright`: the material of the part that does the work. */
export function shapeOf(instrument: Instrument, material: Material, bright: Material): Shape {
  return SHAPES[instrument.kind](instrument, material, bright);
}
