// The picture of an arthroscope: the joint from the tip of the scope, lit from there. The canvas is the
// square around the round picture.
import {
  Color, CustomToneMapping, DataUtils, HalfFloatType, HemisphereLight, PerspectiveCamera, Quaternion, Scene, ShaderChunk, SpotLight, WebGLRenderTarget,
  type WebGLRenderer,
} from "three";
import { HAS_WARPED, SEEN, TIP, toolAt, WARPED, type Row } from "../history";
import { SCOPE, type Joint } from "./joint";
import { cameraFieldDeg, cameraInTip, type Optic } from "./optic";
import { Fineness, newRenderer } from "./view3d";

const LIGHT = 260; // at 1 mm, before it fades with distance
const FADE = 1.4; // less than the square: water and walls scatter some of it back
const BEYOND_DEG = 17; // how far the light's cone reaches beyond what the optic sees
const DEPTH = 0x2a1210; // where no light comes back from
const METER_MS = 300;
const ADAPT_MS = { close: 120, open: 400 }; // to go most of the way: what is too bright shows nothing
const METER_SIDE = 32; // px
const BRIGHT = { share: 0.75, light: 0.85 }; // so much of the picture is to be darker than that
const BRIGHTEST = { share: 0.96, light: 1.6 };
const EXPOSURE_MOST = 6;
const SETTLED = 0.02; // of the exposure

// How a camera makes light to signal: what is bright is held back and never quite white, and what is dark
// stays warm, as it is lit by what red walls give back.
ShaderChunk.tonemapping_pars_fragment = ShaderChunk.tonemapping_pars_fragment.replace(/vec3 CustomToneMapping\([^}]*\}/, `
vec3 CustomToneMapping(vec3 color) {
  vec3 light = 1.5 * toneMappingExposure * color;
  vec3 signal = 1.0 - 1.0 / (1.0 + light * (1.0 + light * (0.5 + 0.17 * light))); // 1 - exp(-light), nearly
  return signal * mix(vec3(1.0, 0.93, 0.87), vec3(1.0), signal);
}`);

export class Arthroscope {
  readonly camera = new PerspectiveCamera(90, 1, 0.4, 260);
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  readonly fineness: Fineness;
  private readonly turn = new Quaternion(); // of the camera in the tip's frame
  private side = 0; // px of the page
  private ratio = 0; // pixels of the picture for each of those; 0: not sized yet
  private metering = false;
  private meteredAt = -METER_MS;
  private adaptedAt = 0;
  private exposure = 0; // 0: the first one is taken as it is
  private wanted = 0; // exposure; 0: not known yet
  private readonly lamp = new SpotLight(0xfffaf2, LIGHT, 0, 1, 0.9, FADE);
  private readonly metered = new WebGLRenderTarget(METER_SIDE, METER_SIDE, { type: HalfFloatType });
  private readonly levels = new Uint16Array(4 * METER_SIDE * METER_SIDE);

  constructor(canvas: HTMLCanvasElement, private readonly joint: Joint, optic: Optic) {
    this.renderer = newRenderer(canvas);
    this.fineness = new Fineness();
    this.renderer.toneMapping = CustomToneMapping;
    this.scene.background = new Color(DEPTH);
    this.lamp.position.set(0.4, 0.5, 0.2);
    this.lamp.target.position.set(0.4, 0.5, -1);
    this.camera.add(this.lamp, this.lamp.target);
    this.scene.add(this.camera, new HemisphereLight(0xffd9c4, 0xa04a38, 0.12), joint.root);
    joint.setShow({ ghost: false, raw: false, trails: false, femur: true, patella: true, ligaments: true, skin: true, seeThrough: false, map: "none" });
    this.setOptic(optic);
  }

  close(): void {
    this.fineness.close();
    this.metered.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  setOptic(optic: Optic): void {
    const [w, x, y, z] = cameraInTip(optic);
    this.turn.set(x, y, z, w);
    this.camera.fov = cameraFieldDeg(optic);
    this.camera.updateProjectionMatrix();
    this.lamp.angle = ((cameraFieldDeg(optic) / 2 + BEYOND_DEG) * Math.PI) / 180;
  }

  /** px of the page. */
  setSide(side: number): void {
    this.side = side;
    this.ratio = 0;
  }

  // setSize clears what was drawn: right before the next picture.
  private resize(): void {
    if (!this.side || this.fineness.value === this.ratio) return;
    this.ratio = this.fineness.value;
    this.renderer.setPixelRatio(this.ratio);
    this.renderer.setSize(this.side, this.side, false);
  }

  /** False where the row has no scope. */
  draw(row: Row, time: number): boolean {
    const at = toolAt(SCOPE);
    if (row[at + SEEN]! < 1) return false;
    const pose = at + (row[at + HAS_WARPED] === 1 ? WARPED : TIP);
    this.joint.setRow(row, time);
    this.camera.position.set(row[pose + 4]!, row[pose + 5]!, row[pose + 6]!);
    this.camera.quaternion.set(row[pose + 1]!, row[pose + 2]!, row[pose + 3]!, row[pose]!).normalize().multiply(this.turn);
    this.joint.faceMarker(this.camera.quaternion);
    const now = performance.now();
    this.resize();
    this.meter(now);
    this.adapt(now);
    this.renderer.render(this.scene, this.camera);
    return true;
  }

  /** Whether the camera's exposure has come to what it found of the picture. */
  get settled(): boolean {
    return this.wanted > 0 && Math.abs(this.exposure - this.wanted) <= SETTLED * this.wanted;
  }

  // Cameras open and close by how bright the picture is: a small one is drawn and looked at, once it is there.
  private meter(now: number): void {
    if (this.metering || now - this.meteredAt < METER_MS) return;
    this.metering = true;
    this.meteredAt = now;
    this.renderer.setRenderTarget(this.metered);
    this.renderer.render(this.scene, this.camera);
    this.renderer.setRenderTarget(null);
    this.renderer.readRenderTargetPixelsAsync(this.metered, 0, 0, METER_SIDE, METER_SIDE, this.levels).then(() => {
      this.wanted = wantedExposure(this.levels);
      this.metering = false;
    }, () => {}); // closed meanwhile
  }

  private adapt(now: number): void {
    const most = this.wanted < this.exposure ? ADAPT_MS.close : ADAPT_MS.open;
    const share = this.exposure ? 1 - Math.exp((this.adaptedAt - now) / most) : 1;
    this.exposure += share * (this.wanted - this.exposure);
    this.adaptedAt = now;
    this.renderer.toneMappingExposure = this.exposure;
  }
}

// Of a square picture's light, as halves of four components: what is in the circle counts.
function wantedExposure(levels: Uint16Array): number {
  const found: number[] = [];
  for (let i = 0; i < METER_SIDE * METER_SIDE; i++) {
    const x = (i % METER_SIDE) + 0.5 - METER_SIDE / 2;
    const y = Math.floor(i / METER_SIDE) + 0.5 - METER_SIDE / 2;
    if (Math.hypot(x, y) > METER_SIDE / 2) continue;
    found.push(Math.max(...[0, 1, 2].map((k) => DataUtils.fromHalfFloat(levels[4 * i + k]!))));
  }
  found.sort((a, b) => a - b);
  const limits = [BRIGHT, BRIGHTEST].map(({ share, light }) => light / Math.max(found[Math.floor(share * found.length)]!, 1e-3));
  return Math.min(EXPOSURE_MOST, ...limits);
}
