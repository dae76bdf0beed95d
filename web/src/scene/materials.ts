// How tissue and steel look. One lamp goes with the eye in the overview; in the scope it is at the tip
// and fades with distance.
import { Color, DoubleSide, FrontSide, Matrix4, MeshPhongMaterial, type Side } from "three";
import { CaseGroup_Kind, CaseGroup_Side, type CaseGroup } from "wire";
import type { Colour } from "./colours";

const CUT: Colour = [226, 158, 136];
const CARTILAGE: Colour = [217, 230, 232]; // of a bone's part

// What the scope sees, in the light of its own lamp. A joint's lining covers what holds it from outside.
const INSIDE: Record<string, Colour> = {
  cartilage: [244, 238, 227],
  meniscus: [247, 226, 200],
  cut: [240, 170, 152],
  ligament: [238, 212, 184],
  lining: [245, 172, 164],
};

type Kind = "bone" | "meniscus" | "ligament" | "lining";

function kindOf({ kind, side }: CaseGroup): Kind {
  if (kind === CaseGroup_Kind.MENISCUS) return "meniscus";
  if (kind === CaseGroup_Kind.SKIN || kind === CaseGroup_Kind.SYNOVIUM) return "lining";
  if (kind === CaseGroup_Kind.LIGAMENT) return side === CaseGroup_Side.NONE ? "ligament" : "lining"; // a collateral one lies outside
  return kind === CaseGroup_Kind.BONE || kind === CaseGroup_Kind.CARTILAGE ? "bone" : "ligament";
}

function rgb(colour: number): Colour {
  return [(colour >> 16) & 255, (colour >> 8) & 255, colour & 255];
}

/** What a surface is made of; where it is `cut`, or cartilage. In the scope a case's own colours are kept. */
export function tissueOf(group: CaseGroup, inside: boolean, cut: boolean, cartilage: boolean): Colour {
  if (cut) return inside ? INSIDE.cut! : CUT;
  if (!inside) return cartilage ? CARTILAGE : rgb(group.colour);
  if (group.ownColour && !cartilage) return rgb(group.colour);
  const kind = kindOf(group);
  return kind === "bone" ? INSIDE.cartilage! : INSIDE[kind]!;
}

export interface Look {
  opacity?: number;
  side?: Side;
  colour?: number; // of all of it, instead of the vertices' own
  grain?: Grain; // as the scope sees it
}

// A tissue's fine structure: how often it changes in a millimetre along each axis, how rough it is, and what
// else it has.
interface Grain {
  scale: [x: number, y: number, z: number];
  rough: number;
  more?: "vessels" | "fray";
}

const GRAINS: Record<Kind, Grain> = {
  bone: { scale: [0.5, 0.5, 0.5], rough: 0.05 },
  meniscus: { scale: [0.7, 0.7, 2.6], rough: 0.07, more: "fray" }, // its fibres run round
  ligament: { scale: [2.2, 1.6, 0.3], rough: 0.12 }, // and those of a cruciate ligament upwards
  lining: { scale: [0.36, 0.33, 0.3], rough: 0.2, more: "vessels" },
};

export function grainOf(group: CaseGroup): Grain {
  return GRAINS[kindOf(group)];
}

/** A material for tissue. Where `other` is given, vertices go along with another body by their share. */
export function tissueMaterial(look: Look, other?: Matrix4): MeshPhongMaterial {
  const opacity = look.opacity ?? 1;
  const material = new MeshPhongMaterial({
    vertexColors: look.colour === undefined,
    color: look.colour ?? 0xffffff,
    specular: new Color(look.grain ? 0x40403c : 0x26282a),
    shininess: look.grain ? 90 : 22,
    transparent: opacity < 1,
    opacity,
    depthWrite: opacity === 1,
    side: look.side ?? FrontSide,
  });
  const { grain } = look;
  material.onBeforeCompile = (shader) => {
    if (other) {
      shader.uniforms.other = { value: other };
      shader.vertexShader = `attribute float share;\nuniform mat4 other;\n${shader.vertexShader}`
        .replace("#include <beginnormal_vertex>", "vec3 objectNormal = normalize(mix(normal, mat3(other) * normal, share));")
        .replace("#include <begin_vertex>", "vec3 transformed = mix(position, (other * vec4(position, 1.0)).xyz, share);");
    }
    if (grain) moisten(shader, grain);
  };
  material.customProgramCacheKey = () => `${other ? "bridge" : ""}${JSON.stringify(grain)}`;
  return material;
}

// Fibres and small hollows: noise over the place in the body, so that it goes with the tissue. It shades
// the colour a little, and its slope ruffles the normal, which breaks up the highlights as a film of water
// does. The slope is that between neighbouring pixels: one look at the noise is enough. Where tissue was
// cut, which the colours' fourth component says, fibres end in a pink and cream fray. Vessels are where the
// noise crosses its mean.
const NOISE = `
const mat3 ASKEW = mat3(0.0, 0.8, 0.6, -0.8, 0.36, -0.48, -0.6, -0.48, 0.64); // noise shows its axes where a cut follows them
float hash3(vec3 p) {
  p = fract(p * 0.3183099 + 0.1);
  p *= 17.0;
  return fract(p.x * p.y * p.z * (p.x + p.y + p.z));
}
float noise3(vec3 x) {
  vec3 i = floor(x), f = fract(x);
  f = f * f * (3.0 - 2.0 * f);
  return mix(mix(mix(hash3(i), hash3(i + vec3(1, 0, 0)), f.x), mix(hash3(i + vec3(0, 1, 0)), hash3(i + vec3(1, 1, 0)), f.x), f.y),
    mix(mix(hash3(i + vec3(0, 0, 1)), hash3(i + vec3(1, 0, 1)), f.x), mix(hash3(i + vec3(0, 1, 1)), hash3(i + vec3(1, 1, 1)), f.x), f.y), f.z);
}
`;

function moisten(shader: { vertexShader: string; fragmentShader: string }, { scale, rough, more }: Grain): void {
  shader.vertexShader = `varying vec3 vPlace;\n${shader.vertexShader}`.replace("#include <project_vertex>", "vPlace = position;\n#include <project_vertex>");
  shader.fragmentShader = `varying vec3 vPlace;\n${NOISE}${shader.fragmentShader}`
    .replace("#include <color_fragment>", `#include <color_fragment>
      float grain = noise3(vPlace * vec3(${scale.join()}));
      diffuseColor.rgb *= mix(vec3(0.97, 0.93, 0.89), vec3(1.03), grain);
      float gloss = 1.0;
      ${more ? MORE[more] : ""}`)
    .replace("#include <specularmap_fragment>", "#include <specularmap_fragment>\nspecularStrength *= gloss;")
    .replace("#include <normal_fragment_maps>", `#include <normal_fragment_maps>
      vec3 alongX = dFdx(vViewPosition), alongY = dFdy(vViewPosition);
      vec3 acrossX = cross(alongY, normal), acrossY = cross(normal, alongX);
      float area = dot(alongX, acrossX);
      vec3 slope = sign(area) * (dFdx(grain) * acrossX + dFdy(grain) * acrossY);
      normal = normalize(abs(area) * normal + ${rough} * slope);`);
}

const MORE = {
  vessels: `
      diffuseColor.rgb *= mix(vec3(0.87, 0.62, 0.62), vec3(1.0), smoothstep(0.0, 0.03, abs(grain - 0.5)));`,
  fray: `
      float raw = 1.0 - vColor.a;
      float fray = noise3(ASKEW * vPlace * vec3(3.5, 3.5, 1.5));
      diffuseColor.rgb = mix(diffuseColor.rgb, vec3(0.90, 0.72, 0.58), 0.6 * raw * smoothstep(0.3, 0.8, fray));
      gloss -= 0.8 * raw;
      grain += 0.7 * raw * fray;`,
};

export function steelMaterial(colour: number, opacity = 1): MeshPhongMaterial {
  return new MeshPhongMaterial({
    color: colour,
    specular: 0x9aa4ad,
    shininess: 70,
    transparent: opacity < 1,
    opacity,
    depthWrite: opacity === 1,
    side: DoubleSide,
  });
}
