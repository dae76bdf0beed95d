// How tissue in the scope answers a tool: it gives way to a tip, and what lies close to a shaft, or in a hollow, gets
// less light.
import { Matrix4, Vector2, Vector3, Vector4, type Texture } from "three";
import type { Grid } from "./paint";

const REACH = 2; // mm around a tip, of the surface that tells how deep the tip is
const MOST = 1.5; // mm that tissue gives way by
const SHAFTS = 2; // that take light: a hand holds the scope, the other a tool, an assistant may hold one more
const SHADED = 60; // mm of a shaft from its tip

/** A tip in tissue: where it is and how deep, mm; which way the tissue goes. */
export interface Depth {
  mm: number; // negative: above it
  way: Vector3;
}

const apart = new Vector3();

/**
 * How deep a place is in a surface, and the way in there: the mean of the planes of the vertices around it, so that it
 * does not jump from one to the next. The other side of something thin does not count.
 */
export function depthAt(grid: Grid, positions: ArrayLike<number>, normals: ArrayLike<number>, { x, y, z }: Vector3): Depth | undefined {
  let nearest = -1;
  let least = REACH;
  const around: [vertex: number, distance: number][] = [];
  grid.near(x, y, z, REACH, (vertex, distance) => {
    const at = 3 * vertex;
    if (!normals[at] && !normals[at + 1] && !normals[at + 2]) return; // of no triangle
    around.push([vertex, distance]);
    if (distance < least) [nearest, least] = [vertex, distance];
  });
  if (nearest < 0) return undefined;
  const normalOf = (vertex: number, out: Vector3): Vector3 => out.set(normals[3 * vertex]!, normals[3 * vertex + 1]!, normals[3 * vertex + 2]!).normalize();
  const facing = normalOf(nearest, new Vector3());
  const way = new Vector3();
  const normal = new Vector3();
  let [deep, all] = [0, 0];
  for (const [vertex, distance] of around) {
    if (normalOf(vertex, normal).dot(facing) < 0.3) continue;
    const weight = (1 - (distance / REACH) ** 2) ** 2;
    apart.set(positions[3 * vertex]! - x, positions[3 * vertex + 1]! - y, positions[3 * vertex + 2]! - z);
    deep += weight * apart.dot(normal);
    all += weight;
    way.addScaledVector(normal, -weight);
  }
  return { mm: deep / all, way: way.normalize() };
}

/** What a surface's material is told: the tip and the depth in mm, the way and how far around tissue goes along, mm. */
export class Dent {
  readonly tip = { value: new Vector4(0, 0, 0, 0) };
  readonly way = { value: new Vector4(0, 0, 1, 1) };

  /** `give`: by how much tissue goes ahead of a tip that touches it, mm. */
  constructor(private readonly give: number) {}

  set(place: Vector3, { mm, way }: Depth): void {
    const deep = Math.min(MOST, mm + this.give);
    if (deep <= this.tip.value.w) return; // another tip is deeper
    this.tip.value.set(place.x, place.y, place.z, deep);
    this.way.value.set(way.x, way.y, way.z, 1 + 4 * this.give);
  }

  clear(): void {
    this.tip.value.w = 0;
  }
}

/** In a vertex shader: both sides of a meniscus go along, so a hook lifts it. */
export const YIELD = {
  uniforms: "uniform vec4 dentTip, dentWay;\n",
  normal: `
    vec3 off = position - dentTip.xyz;
    float yields = dentTip.w * exp(-dot(off, off) / (dentWay.w * dentWay.w));
    objectNormal = normalize(objectNormal + 2.0 * yields / (dentWay.w * dentWay.w) * dot(dentWay.xyz, objectNormal) * off);`,
  place: "\ntransformed += yields * dentWay.xyz;",
};

/** Of an instrument, in its tip's frame: along z, and so far from the tip's axis, mm. */
export interface Shaft {
  radius: number;
  y: number;
}

/** How much of the half ball over each place of the picture is free; px: one over its size, 0 where nobody knows. */
export class Openness {
  readonly map: { value: Texture | null } = { value: null };
  readonly px = { value: new Vector2() };
}

/** What takes light from tissue: shafts near it, and hollows. */
export class Shade {
  /** Of the shafts, in the eye's frame, two of each; the first one's fourth component is the radius. */
  readonly ends = { value: Array.from({ length: 2 * SHAFTS }, () => new Vector4()) };
  readonly openness = new Openness();
  private count = 0;

  constructor() {
    this.clear();
  }

  clear(): void {
    this.count = 0;
    this.ends.value.forEach((end, i) => end.set(0, 0, 1e4 + i, 0)); // behind the eye
  }

  /** `toEye`: from the tip's frame. */
  add(toEye: Matrix4, { radius, y }: Shaft): void {
    if (this.count === SHAFTS) return;
    const [tip, back] = this.ends.value.slice(2 * this.count++);
    tip!.set(0, y, -radius, 1).applyMatrix4(toEye).w = radius;
    back!.set(0, y, -SHADED, 1).applyMatrix4(toEye);
  }
}

/** In a fragment shader: a shaft hides a part of what a place sees (the solid angle of its nearest disc), and so does tissue. */
export const SHADE = {
  uniforms: `uniform vec4 shafts[${2 * SHAFTS}];\nuniform sampler2D openness;\nuniform vec2 opennessPx;\n`,
  light: `
    float open = 1.0;
    for (int i = 0; i < ${2 * SHAFTS}; i += 2) {
      vec3 along = shafts[i + 1].xyz - shafts[i].xyz, from = -vViewPosition - shafts[i].xyz;
      vec3 gap = from - saturate(dot(from, along) / dot(along, along)) * along;
      float wide = min(1.0, shafts[i].w / length(gap));
      open *= 1.0 - wide * wide * saturate(-dot(normalize(gap), normal));
    }
    reflectedLight.directDiffuse *= open;
    reflectedLight.directSpecular *= open;
    reflectedLight.indirectDiffuse *= open;
    if (opennessPx.x > 0.0) {
      float free = 0.0;
      for (int i = 0; i < 4; i++) free += 0.25 * texture2D(openness, (gl_FragCoord.xy + 2.0 * vec2(i % 2 == 0 ? -1 : 1, i < 2 ? -1 : 1)) * opennessPx).x;
      reflectedLight.directDiffuse *= mix(1.0, free, 0.6); // the lamp looks into hollows, too
      reflectedLight.indirectDiffuse *= free;
    }`,
};
