// How tissue and steel look. One lamp goes with the eye in the overview; in the scope it is at the tip
// and fades with distance.
import { BackSide, Color, DoubleSide, FrontSide, Matrix4, MeshPhongMaterial, ShaderChunk, Vector2, type Side, type WebGLProgramParametersWithUniforms } from "three";
import { CaseGroup_Kind, CaseGroup_Side, type CaseGroup } from "wire";
import type { Colour } from "./colours";
import { SHADE, YIELD, type Dent, type Shade } from "./touch";

const CUT: Colour = [226, 158, 136];
const CARTILAGE: Colour = [217, 230, 232]; // of a bone's part

// What the scope sees, in the light of its own lamp. A joint's lining covers what holds it from outside.
const INSIDE: Record<string, Colour> = {
  cartilage: [243, 239, 231],
  meniscus: [247, 234, 212],
  rim: [238, 184, 164], // a meniscus's outer third, which has vessels
  cut: [245, 222, 194],
  ligament: [244, 229, 208],
  lining: [236, 158, 146],
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

const red: Colour = [0, 0, 0];

/**
 * What a surface is made of; where it is `cut`, or cartilage; `rim`: how much of a meniscus's outer third it is, 0 to 1.
 * In the scope a case's own colours are kept.
 */
export function tissueOf(group: CaseGroup, inside: boolean, cut: boolean, cartilage: boolean, rim = 0): Colour {
  if (inside && rim > 0) {
    const inner = tissueOf(group, inside, cut, cartilage);
    for (let k = 0; k < 3; k++) red[k] = inner[k]! + rim * (INSIDE.rim![k]! - inner[k]!);
    return red;
  }
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
  grain?: Grain | undefined; // as the scope sees it
  dent?: Dent | undefined;
  shade?: Shade | undefined;
  thread?: boolean; // so thin that light reaches it from wherever the eye looks
}

// A tissue's fine structure: how often it changes in a millimetre along each axis, how rough it is, how much of the
// light that enters it comes out elsewhere, how wide its film of water spreads a highlight, by how much it gives way
// to a tip (mm), and what else it has.
interface Grain {
  scale: [x: number, y: number, z: number];
  rough: number;
  soft: number;
  film: number;
  give: number;
  more?: "lining" | "fray" | "wear";
}

const GRAINS: Record<Kind, Grain> = {
  bone: { scale: [0.5, 0.5, 0.5], rough: 0.05, soft: 0.5, film: 0.34, give: 0.08 },
  meniscus: { scale: [0.7, 0.7, 2.6], rough: 0.07, soft: 0.4, film: 0.22, give: 0.35, more: "fray" }, // its fibres run round
  ligament: { scale: [2.2, 1.6, 0.3], rough: 0.12, soft: 0.35, film: 0.3, give: 0.3 }, // and those of a cruciate ligament upwards
  lining: { scale: [0.36, 0.33, 0.3], rough: 0.2, soft: 0.6, film: 0.2, give: 0, more: "lining" },
};

export function grainOf(group: CaseGroup, worn = false): Grain {
  const grain = GRAINS[kindOf(group)];
  return worn ? { ...grain, more: "wear" } : grain;
}

/** A material for tissue. Where `other` is given, vertices go along with another body by their share. */
export function tissueMaterial(look: Look, other?: Matrix4): MeshPhongMaterial {
  const opacity = look.opacity ?? 1;
  const material = new MeshPhongMaterial({
    vertexColors: look.colour === undefined,
    color: look.colour ?? 0xffffff,
    specular: new Color(0x26282a),
    shininess: 22,
    transparent: opacity < 1,
    opacity,
    depthWrite: opacity === 1,
    side: look.side ?? FrontSide,
  });
  const { grain, dent, shade, thread } = look;
  material.onBeforeCompile = (shader) => {
    if (other) {
      shader.uniforms.other = { value: other };
      shader.vertexShader = `attribute float share;\nuniform mat4 other;\n${shader.vertexShader}`
        .replace("#include <beginnormal_vertex>", "vec3 objectNormal = normalize(mix(normal, mat3(other) * normal, share));")
        .replace("#include <begin_vertex>", "vec3 transformed = mix(position, (other * vec4(position, 1.0)).xyz, share);");
    }
    if (grain) moisten(shader, grain);
    if (dent) giveWay(shader, dent);
    if (shade) shadeBy(shader, shade, other !== undefined);
    if (thread) shader.fragmentShader = shader.fragmentShader.replace("#include <normal_fragment_begin>", "$&\nnormal = normalize(vViewPosition);");
  };
  material.customProgramCacheKey = () => `${other ? "bridge" : ""}${dent ? "dent" : ""}${shade ? "shade" : ""}${thread ? "thread" : ""}${JSON.stringify(grain)}`;
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
// Where noise crosses its mean; finer than a pixel, of which noise changes by so much, the line is paler instead.
float lineAt(float noise, float width, float pixel) {
  float seen = max(width, 1.5 * pixel);
  return (1.0 - smoothstep(0.3 * seen, seen, abs(noise - 0.5))) * width / seen;
}
`;

type Shader = Pick<WebGLProgramParametersWithUniforms, "uniforms" | "vertexShader" | "fragmentShader">;

function giveWay(shader: Shader, dent: Dent): void {
  Object.assign(shader.uniforms, { dentTip: dent.tip, dentWay: dent.way });
  shader.vertexShader = YIELD.uniforms + shader.vertexShader
    .replace("#include <beginnormal_vertex>", `#include <beginnormal_vertex>${YIELD.normal}`).replace("#include <begin_vertex>", `#include <begin_vertex>${YIELD.place}`);
}

// What bends between bodies is in no picture of depths.
function shadeBy(shader: Shader, { ends, openness }: Shade, bends: boolean): void {
  Object.assign(shader.uniforms, { shafts: ends, openness: openness.map, opennessPx: bends ? { value: new Vector2() } : openness.px });
  shader.fragmentShader = SHADE.uniforms + shader.fragmentShader.replace("#include <aomap_fragment>", SHADE.light);
}

// What a lamp's light does to a surface, instead of Phong's: `towards` is the lamp's cosine.
function litBy(shader: Shader, direct: string): void {
  const chunk = ShaderChunk.lights_phong_pars_fragment.replace(/(void RE_Direct_BlinnPhong\([^{]*\{)[^}]*\}/, `
    // How much of a lamp's light the facets of a surface throw to the eye (GGX), of which each throws the share f0 straight ahead.
    float thrown(vec3 n, vec3 l, vec3 v, float rough, float f0) {
      vec3 h = normalize(l + v);
      float nh = saturate(dot(n, h)), a2 = pow2(pow2(rough)), d = nh * nh * (a2 - 1.0) + 1.0;
      return (f0 + (1.0 - f0) * pow(1.0 - saturate(dot(v, h)), 5.0)) * a2 / (4.0 * d * d);
    }
    $1 float towards = dot(geometryNormal, directLight.direction); ${direct} }`);
  shader.fragmentShader = shader.fragmentShader.replace("#include <lights_phong_pars_fragment>", chunk);
}

// Light goes into soft tissue and comes out where the lamp does not reach any more, red the farthest.
function moisten(shader: Shader, { scale, rough, soft, film, more }: Grain): void {
  litBy(shader, `
      vec3 wrap = ${soft} * vec3(1.0, 0.8, 0.72);
      vec3 lit = saturate((towards + wrap) / (1.0 + wrap));
      reflectedLight.directDiffuse += directLight.color * lit * BRDF_Lambert(material.diffuseColor);
      reflectedLight.directSpecular += directLight.color * saturate(towards) * material.specularStrength * thrown(geometryNormal, directLight.direction, geometryViewDir, ${film}, 0.03);`);
  shader.vertexShader = `varying vec3 vPlace;\n${shader.vertexShader}`.replace("#include <project_vertex>", "vPlace = position;\n#include <project_vertex>");
  shader.fragmentShader = `varying vec3 vPlace;\n${NOISE}${shader.fragmentShader}`
    .replace("#include <color_fragment>", `#include <color_fragment>
      float grain = noise3(vPlace * vec3(${scale.join()}));
      diffuseColor.rgb *= mix(vec3(0.95, 0.93, 0.91), vec3(1.02), grain);
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

// Worn cartilage gets cracks (where noise crosses its mean), which widen with the grade, then fibres; where it is gone,
// bone lies bare, and bleeds in points. The colours' fourth component says the grade.
//
// Vessels are where noise crosses its mean: thick ones, and thin ones that leave them. In front and below lies the fat
// pad, in lobules. The capsule has folds.
const MORE = {
  lining: `
      vec3 bent = ASKEW * (0.12 * vPlace + 0.5 * grain);
      float fold = noise3(bent), trunk = abs(noise3(1.3 * bent + 5.0) - 0.5), twig = abs(noise3(4.1 * bent) - 0.5);
      float red = max(smoothstep(0.022, 0.008, trunk), 0.7 * smoothstep(0.2, 0.03, trunk) * smoothstep(0.05, 0.02, twig));
      float fat = smoothstep(-4.0, -16.0, vPlace.z) * smoothstep(16.0, 30.0, vPlace.y);
      float lobule = abs(noise3(0.3 * ASKEW * vPlace) - 0.5);
      diffuseColor.rgb = mix(diffuseColor.rgb, vec3(0.95, 0.72, 0.36), 0.75 * fat * smoothstep(0.0, 0.14, lobule));
      diffuseColor.rgb *= mix(vec3(1.0), vec3(0.72, 0.3, 0.3), (1.0 - 0.6 * fat) * red) * mix(0.8, 1.08, fold);
      grain += mix(9.0 * fold, 12.0 * sqrt(lobule), fat);`,
  wear: `
      float grade = 4.0 * (1.0 - vColor.a), pixel = 0.5 * length(fwidth(vPlace));
      if (grade > 0.02) {
        vec3 worn = ASKEW * vPlace + 0.4 * grain, finer = ASKEW * (2.3 * worn);
        float patchy = noise3(0.6 * worn) - 0.5, fibres = noise3(finer * vec3(2.5, 0.8, 2.5));
        float bare = smoothstep(3.1, 3.5, grade + 1.6 * patchy), whole = 1.0 - bare;
        float width = 0.02 * grade, deep = whole * saturate(0.35 * grade);
        float crack = deep * max(lineAt(noise3(0.45 * worn + 3.0), width, 0.45 * pixel), 0.7 * lineAt(noise3(0.5 * finer), width, 1.15 * pixel));
        float fray = whole * smoothstep(1.2, 2.6, grade + patchy);
        float blood = smoothstep(0.74, 0.8, noise3(1.3 * finer + 7.0));
        diffuseColor.rgb *= mix(vec3(1.0), vec3(0.97, 0.88, 0.72), saturate(0.4 * grade));
        diffuseColor.rgb *= mix(vec3(1.0), vec3(0.62, 0.48, 0.38), crack) * mix(1.0, 0.85 + 0.25 * fibres, fray);
        diffuseColor.rgb = mix(diffuseColor.rgb, mix(vec3(0.8, 0.6, 0.44), vec3(0.62, 0.2, 0.16), blood), bare);
        gloss -= 0.6 * fray + 0.4 * bare;
        grain += 1.5 * fray * fibres - 1.5 * crack + 1.5 * bare * patchy;
      }`,
  fray: `
      float raw = 1.0 - vColor.a, fray = 0.0;
      if (raw > 0.0) fray = noise3(ASKEW * vPlace * vec3(6.0, 6.0, 2.0));
      diffuseColor.rgb *= mix(vec3(1.0), mix(vec3(0.86, 0.72, 0.62), vec3(1.04), smoothstep(0.25, 0.75, fray)), raw);
      gloss -= 0.9 * raw;
      grain += 0.7 * raw * fray;`,
};

/** Steel; `inside` the joint it mirrors the lit tissue in front of it, and behind the eye nothing is lit. */
export function steelMaterial(colour: number, opacity = 1, inside = false): MeshPhongMaterial {
  const material = new MeshPhongMaterial({
    color: colour,
    specular: 0x9aa4ad,
    shininess: 70,
    transparent: opacity < 1,
    opacity,
    depthWrite: opacity === 1,
    side: DoubleSide,
  });
  if (!inside) return material;
  material.onBeforeCompile = (shader) => litBy(shader, `
      float ahead = 0.5 - 0.5 * reflect(-geometryViewDir, geometryNormal).z;
      vec3 mirrored = mix(vec3(0.02, 0.012, 0.01), vec3(0.6, 0.49, 0.44), ahead * ahead) + 0.05 * saturate(towards);
      reflectedLight.directSpecular += directLight.color * material.diffuseColor * (mirrored + thrown(geometryNormal, directLight.direction, geometryViewDir, 0.35, 0.55));`);
  material.shadowSide = BackSide; // a front would shade itself
  material.customProgramCacheKey = () => "steel";
  return material;
}
