// What lies in a hollow gets less of the light that tissue around throws back (ambient occlusion). A picture of the
// depths, half as fine as the scope's, tells for each of its places how much of the half ball over it is free. Tissue
// looks that up (SHADE in touch.ts).
import {
  Camera, DepthTexture, DoubleSide, LinearFilter, Mesh, MeshBasicMaterial, PlaneGeometry, Scene, ShaderMaterial, Vector2, Vector3, WebGLRenderTarget,
  type Light, type PerspectiveCamera, type WebGLRenderer,
} from "three";
import type { Openness } from "./touch";

const LAYER = 1; // what has a depth, and the lamps: a scene with other lamps would need other programs
const LOOKS = 10;

const PLACES = "void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }";
const OPENNESS = `
uniform sampler2D depths;
uniform vec2 px;
uniform vec3 lens; // near, far, and the tangent of half the field
const float REACH = 4.0; // mm
vec3 place(vec2 at) { // right, up and ahead of the eye
  float ahead = lens.x * lens.y / (lens.y - texture2D(depths, at).x * (lens.y - lens.x));
  return vec3((2.0 * at - 1.0) * lens.z, 1.0) * ahead;
}
vec3 nearer(vec3 a, vec3 b) { return abs(a.z) < abs(b.z) ? a : b; } // the side on which the surface goes on
void main() {
  vec2 at = gl_FragCoord.xy * px, x = vec2(px.x, 0.0), y = vec2(0.0, px.y);
  vec3 p = place(at);
  vec3 normal = normalize(cross(nearer(place(at + y) - p, p - place(at - y)), nearer(place(at + x) - p, p - place(at - x))));
  float turn = 6.2832 * fract(52.98 * fract(dot(gl_FragCoord.xy, vec2(0.0671, 0.00584)))), hidden = 0.0;
  float reach = min(0.15, REACH / (2.0 * lens.z * p.z));
  for (int i = 0; i < ${LOOKS}; i++) {
    vec3 off = place(at + reach * sqrt((float(i) + 0.5) / ${LOOKS}.0) * vec2(cos(turn), sin(turn))) - p;
    float square = dot(off, off);
    hidden += max(0.0, dot(off, normal) * inversesqrt(square + 0.01) - 0.1) * max(0.0, 1.0 - square / (REACH * REACH));
    turn += 2.4;
  }
  gl_FragColor = vec4(vec3(max(0.0, 1.0 - 2.2 * hidden / ${LOOKS}.0)), 1.0);
}`;

export class Occlusion {
  private readonly seen = new WebGLRenderTarget(1, 1, { depthTexture: new DepthTexture(1, 1) });
  private readonly open = new WebGLRenderTarget(1, 1, { minFilter: LinearFilter, magFilter: LinearFilter, depthBuffer: false });
  private readonly depths = new MeshBasicMaterial({ side: DoubleSide, fog: false, colorWrite: false });
  private readonly lens = new Vector3();
  private readonly px = new Vector2();
  private readonly all: Mesh<PlaneGeometry, ShaderMaterial>;
  private readonly screen = new Scene();
  private readonly camera = new Camera();

  constructor(private readonly renderer: WebGLRenderer, private readonly openness: Openness) {
    const uniforms = { depths: { value: this.seen.depthTexture }, px: { value: this.px }, lens: { value: this.lens } };
    this.all = new Mesh(new PlaneGeometry(2, 2), new ShaderMaterial({ uniforms, vertexShader: PLACES, fragmentShader: OPENNESS, depthTest: false }));
    this.all.frustumCulled = false;
    this.screen.add(this.all);
    renderer.shadowMap.autoUpdate = false; // the depths' pass draws it
    openness.map.value = this.open.texture;
  }

  /** Before each picture of `side` pixels. */
  draw(scene: Scene, camera: PerspectiveCamera, side: number): void {
    const { renderer } = this;
    const half = Math.max(1, side >> 1);
    for (const target of [this.seen, this.open]) target.setSize(half, half);
    this.px.setScalar(1 / half);
    this.openness.px.value.setScalar(1 / side);
    this.lens.set(camera.near, camera.far, Math.tan((camera.fov * Math.PI) / 360));
    scene.traverse((node) => { if (node.castShadow || (node as Light).isLight) node.layers.enable(LAYER); });
    scene.overrideMaterial = this.depths;
    camera.layers.set(LAYER);
    renderer.shadowMap.needsUpdate = true;
    renderer.setRenderTarget(this.seen);
    renderer.render(scene, camera);
    scene.overrideMaterial = null;
    camera.layers.set(0);
    renderer.setRenderTarget(this.open);
    renderer.render(this.screen, this.camera);
    renderer.setRenderTarget(null);
  }

  dispose(): void {
    this.seen.dispose();
    this.open.dispose();
    this.depths.dispose();
    this.all.geometry.dispose();
    this.all.material.dispose();
  }
}
