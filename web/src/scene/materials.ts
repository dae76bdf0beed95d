// How tissue and steel look. One lamp goes with the eye in the overview; in the scope it is at the tip
// and fades with the square of the distance.
import { Color, DoubleSide, FrontSide, Matrix4, MeshPhongMaterial, type Side } from "three";
import type { Colour } from "./colours";

export const TISSUE: Record<string, Colour> = {
  bone: [228, 216, 194],
  cartilage: [226, 228, 222],
  meniscus: [206, 190, 168],
  cut: [226, 158, 136],
  ligament: [228, 216, 192],
  skin: [192, 134, 128],
};

/** What a surface is made of, as its group's name tells. In the joint's inside bones have their cartilage. */
export function tissueOf(group: string, inside: boolean): Colour {
  if (group.startsWith("meniscus")) return TISSUE.meniscus!;
  if (group === "skin") return TISSUE.skin!;
  return ["femur", "tibia", "patella"].includes(group) ? (inside ? TISSUE.cartilage! : TISSUE.bone!) : TISSUE.ligament!;
}

export interface Look {
  opacity?: number;
  wet?: boolean;
  side?: Side;
  colour?: number; // of all of it, instead of the vertices' own
}

/** A material for tissue. Where `other` is given, vertices go along with another body by their share. */
export function tissueMaterial(look: Look, other?: Matrix4): MeshPhongMaterial {
  const opacity = look.opacity ?? 1;
  const material = new MeshPhongMaterial({
    vertexColors: look.colour === undefined,
    color: look.colour ?? 0xffffff,
    specular: new Color(look.wet ? 0x94948f : 0x26282a),
    shininess: look.wet ? 130 : 22,
    transparent: opacity < 1,
    opacity,
    depthWrite: opacity === 1,
    side: look.side ?? FrontSide,
  });
  const wet = look.wet === true;
  material.onBeforeCompile = (shader) => {
    if (other) {
      shader.uniforms.other = { value: other };
      shader.vertexShader = `attribute float share;\nuniform mat4 other;\n${shader.vertexShader}`
        .replace("#include <beginnormal_vertex>", "vec3 objectNormal = normalize(mix(normal, mat3(other) * normal, share));")
        .replace("#include <begin_vertex>", "vec3 transformed = mix(position, (other * vec4(position, 1.0)).xyz, share);");
    }
    if (wet) moisten(shader);
  };
  material.customProgramCacheKey = () => `${other ? "bridge" : ""}${wet ? "wet" : ""}`;
  return material;
}

// Fibres and small hollows: noise over the place in the body, so that it goes with the tissue. It shades
// the colour a little, and its slope ruffles the normal, which breaks up the highlights as a film of water
// does. The slope is that between neighbouring pixels: one look at the noise is enough.
const NOISE = `
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

function moisten(shader: { vertexShader: string; fragmentShader: string }): void {
  shader.vertexShader = `varying vec3 vPlace;\n${shader.vertexShader}`.replace("#include <project_vertex>", "vPlace = position;\n#include <project_vertex>");
  shader.fragmentShader = `varying vec3 vPlace;\n${NOISE}${shader.fragmentShader}`
    .replace("#include <color_fragment>", `#include <color_fragment>
      float grain = noise3(vPlace * 0.8);
      diffuseColor.rgb *= mix(vec3(1.0, 0.95, 0.91), vec3(1.03), grain);`)
    .replace("#include <normal_fragment_maps>", `#include <normal_fragment_maps>
      vec3 alongX = dFdx(vViewPosition), alongY = dFdy(vViewPosition);
      vec3 acrossX = cross(alongY, normal), acrossY = cross(normal, alongX);
      float area = dot(alongX, acrossX);
      vec3 slope = sign(area) * (dFdx(grain) * acrossX + dFdy(grain) * acrossY);
      normal = normalize(abs(area) * normal + 0.11 * slope);`);
}

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
