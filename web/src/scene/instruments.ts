// The instruments' shapes, in the tip's frame: the origin in the tip, z along the shaft away from the
// handle, y the side to which an upper jaw opens and a blade's edge looks. The parts that cut have
// the sizes that the cuts are made with (shared/base/instrument.h).
import {
  BoxGeometry, BufferAttribute, BufferGeometry, CylinderGeometry, Group, LatheGeometry, Mesh, SphereGeometry, TorusGeometry, Vector2, type Material,
} from "three";
import { Instrument_Kind, type Instrument } from "wire";
import type { Shaft } from "./touch";

const SHAFT = 130; // mm
const HANDLE = 34;
const SHAFT_MOST = 2.5; // its radius behind a jaw or a burr
const HOOK = 1.7; // how far a probe's hook stands from its shaft's axis
const TURNS = 4; // of a burr, each second: as many as the eye can follow

export interface Shape {
  root: Group;
  shaft: Shaft;
  /** How open the handle is, whether it runs, and the time in s. */
  move(opening: number, running: boolean, time: number): void;
}

function merged(...parts: BufferGeometry[]): BufferGeometry {
  const flat = parts.map((part) => (part.index ? part.toNonIndexed() : part));
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

// Turned on a lathe about z: radii at heights that grow, from an angle over another; 0 is at -y, towards x.
function turned(profile: [radius: number, z: number][], from = 0, over = 2 * Math.PI, segments = 28): BufferGeometry {
  return new LatheGeometry(profile.map(([radius, z]) => new Vector2(radius, z)), segments, from, over).rotateX(Math.PI / 2);
}

// Closed and tapered towards what works at its end.
function shaftAndHandle(radius: number, to: number, y = 0, neck = 0.75 * radius): BufferGeometry[] {
  return [turned([[radius, -SHAFT], [radius, to - 2.5], [neck, to], [0, to]]).translate(0, y, 0),
    tube(radius + 2.6, -SHAFT - HANDLE, -SHAFT, 0, y), tube(radius + 3.4, -SHAFT - 4, -SHAFT, 0, y)];
}

function still(root: Group, radius: number, y = 0): Shape {
  return { root, shaft: { radius, y }, move: () => {} };
}

function group(...meshes: Mesh[]): Group {
  const root = new Group();
  root.add(...meshes);
  return root;
}

type Make = (instrument: Instrument, material: Material, bright: Material) => Shape;

function probe(_: Instrument, material: Material): Shape {
  const bend = new TorusGeometry(0.7, 0.45, 8, 8, Math.PI / 2).rotateY(-Math.PI / 2).translate(0, HOOK - 0.7, -1.15);
  const hook = new CylinderGeometry(0.45, 0.32, HOOK - 0.7, 10).translate(0, (HOOK - 0.7) / 2, -0.45);
  const tip = new SphereGeometry(0.34, 10, 8).translate(0, 0.34, -0.45);
  return still(group(new Mesh(merged(...shaftAndHandle(0.85, -1.1, HOOK), bend, hook, tip), material)), 0.85, HOOK);
}

const BITE = { teeth: 5, deep: 0.22, thick: 0.95 }; // of a jaw, mm

// Half of a spindle of so much width, from z = 0 to its length; its flat side looks along y and is toothed.
function halfSpindle(width: number, length: number): BufferGeometry {
  const half = width / 2;
  const profile: [number, number][] = [[0, -0.4], [0.8 * half, -0.4], [half, 0.2 * length], [0.9 * half, 0.7 * length], [0.6 * half, 0.93 * length], [0, length]];
  const back = turned(profile, -Math.PI / 2, Math.PI, 16).scale(1, BITE.thick / half, 1);
  const face = turned(profile.flatMap(([radius, z], i): [number, number][] => {
    const [nextRadius, nextZ] = profile[i + 1] ?? [radius, z];
    return Array.from({ length: BITE.teeth }, (_, k) => [radius + (k / BITE.teeth) * (nextRadius - radius), z + (k / BITE.teeth) * (nextZ - z)]);
  }), -Math.PI / 2, Math.PI, 8).scale(1, 0, 1);
  const places = face.getAttribute("position");
  for (let i = 0; i < places.count; i++) places.setY(i, -BITE.deep * Math.abs(Math.sin((Math.PI * BITE.teeth * places.getZ(i)) / length)));
  face.computeVertexNormals();
  return merged(back, face);
}

function jaws({ lengthMm: length, widthMm: width, openingDeg }: Instrument, material: Material): Shape {
  const lower = halfSpindle(width, length).translate(0, 0, -length);
  const pin = new CylinderGeometry(0.45, 0.45, 0.8 * width, 10).rotateZ(Math.PI / 2).translate(0, 0, -length);
  const radius = Math.min(width / 2, SHAFT_MOST);
  const body = new Mesh(merged(...shaftAndHandle(radius, -length + 0.3), lower, pin), material);
  const jaw = new Mesh(halfSpindle(0.85 * width, 0.97 * length).rotateZ(Math.PI), material);
  jaw.position.set(0, 0, -length);
  return {
    root: group(body, jaw),
    shaft: { radius, y: 0 },
    move: (opening) => {
      jaw.rotation.x = (-opening * openingDeg * Math.PI) / 180;
    },
  };
}

const WINDOW = 1.9; // angle by which a shaver's tube is open, towards y
const FLUTES = 6;

// The tube is round at its end and open towards y there; in it the burr turns.
function shaver({ widthMm }: Instrument, material: Material, bright: Material): Shape {
  const radius = widthMm / 2;
  const wall = radius + 0.35;
  const hood = turned([[wall, -5.4], [wall, -radius], [0.87 * wall, -0.5 * radius], [0.5 * wall, -0.13 * radius], [0, 0.1]], Math.PI + WINDOW / 2, 2 * Math.PI - WINDOW);
  const body = new Mesh(merged(...shaftAndHandle(wall, -5.4, 0, wall), hood), material);
  const burr = new Mesh(turned([[0.45 * radius, -5.3], [0.95 * radius, -4.6], [0.95 * radius, -radius], [0.6 * radius, -0.3 * radius], [0, -0.1 * radius]], 0, 2 * Math.PI, 8 * FLUTES), bright);
  const places = burr.geometry.getAttribute("position");
  for (let i = 0; i < places.count; i++) {
    const flute = 1 - 0.22 * Math.abs(Math.sin((FLUTES / 2) * Math.atan2(places.getY(i), places.getX(i)) + 0.6 * places.getZ(i)));
    places.setXY(i, flute * places.getX(i), flute * places.getY(i));
  }
  burr.geometry.computeVertexNormals();
  return {
    root: group(body, burr),
    shaft: { radius: wall, y: 0 },
    move: (opening, running, time) => {
      if (running || opening > 0.5) burr.rotation.z = 2 * Math.PI * TURNS * time;
    },
  };
}

function knife({ lengthMm: length, widthMm: width, thicknessMm }: Instrument, material: Material, bright: Material): Shape {
  const blade = new BoxGeometry(thicknessMm, width, length).translate(0, 0, -length / 2);
  const back = new BoxGeometry(Math.max(0.5, thicknessMm), 1.4, 5).translate(0, -0.2, -length - 2);
  return still(group(new Mesh(merged(...shaftAndHandle(1.5, -length - 4), back), material), new Mesh(blade, bright)), 1.5);
}

function scope(_: Instrument, material: Material, bright: Material): Shape {
  const head = new BoxGeometry(13, 13, 20).translate(0, 0, -SHAFT - 8);
  const post = new CylinderGeometry(1.8, 1.8, 14, 12).translate(0, -9, -SHAFT + 8);
  const body = new Mesh(merged(tube(2, -SHAFT, -1.2), tube(4.5, -SHAFT, -SHAFT + 14), head, post), material);
  const lens = new Mesh(new CylinderGeometry(1.7, 1.9, 1.6, 20).rotateX(Math.PI / 2).translate(0, 0, -0.8), bright);
  return still(group(body, lens), 2);
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
