// The picture of an arthroscope: the joint from the tip of the scope, lit from there. The canvas is the
// square around the round picture.
import {
  Color, CustomToneMapping, FogExp2, HemisphereLight, PerspectiveCamera, Quaternion, Scene, ShaderChunk, SpotLight, type WebGLRenderer,
} from "three";
import { HAS_WARPED, LOST, SEEN, TIP, toolAt, WARPED, type Row } from "../history";
import { drawnBySoftware } from "../graphics";
import { isOptic, USUAL, type Instruments } from "../instruments";
import { Exposure, TONE } from "./exposure";
import type { MapName } from "./colours";
import type { Joint, Show } from "./joint";
import { Occlusion } from "./occlusion";
import { cameraFieldDeg, cameraInTip, type Optic } from "./optic";
import { SHADOW } from "./shadow";
import { AdaptiveResolution, newRenderer } from "./view3d";
import { Water } from "./water";

const LIGHT = 150; // at 1 mm, before it fades with distance
const FADE = 1.2; // less than the square: water and walls scatter some of it back
const BEYOND_DEG = 17; // how far the light's cone reaches beyond what the optic sees
const SHOW: Show = { ghost: false, raw: false, trails: false, femur: true, patella: true, ligaments: true, skin: true, seeThrough: false, map: "none" };
const FIBRES = { x: 1, y: 1.2, z: 0.3 }; // mm from the lens: where the light leaves the scope
const STEEPEST = (80 * Math.PI) / 180; // half of a cone that a shadow can be drawn in
const SHADOW_PX = 512;
const SHADE = 0.6; // what a shadow takes: tissue around throws the rest back into it
const DEPTH = 0x2a1210; // where no light comes back from
const TURBID = { colour: 0x8a6a60, per_mm: 0.006 }; // the water's own
ShaderChunk.shadowmap_pars_fragment = SHADOW;
ShaderChunk.tonemapping_pars_fragment = ShaderChunk.tonemapping_pars_fragment.replace(/vec3 CustomToneMapping\([^}]*\}/, TONE);

export class Arthroscope {
  readonly camera = new PerspectiveCamera(90, 1, 0.4, 260);
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  readonly resolution: AdaptiveResolution;
  private readonly turn = new Quaternion(); // of the camera in the tip's frame
  private instruments: Instruments = USUAL;
  private side = 0; // px of the page
  private ratio = 0; // pixels of the picture for each of those; 0: not sized yet
  private readonly exposure: Exposure;
  private readonly water = new Water(LIGHT);
  private readonly occlusion: Occlusion | undefined;
  private readonly lamp = new SpotLight(0xfffaf2, LIGHT, 0, 1, 0.9, FADE);

  constructor(canvas: HTMLCanvasElement, private readonly joint: Joint, optic: Optic) {
    this.renderer = newRenderer(canvas);
    this.resolution = new AdaptiveResolution();
    this.exposure = new Exposure(this.renderer.getContext() as WebGL2RenderingContext);
    this.renderer.toneMapping = CustomToneMapping;
    this.renderer.shadowMap.enabled = this.lamp.castShadow = !drawnBySoftware(); // as smooth edges
    if (this.lamp.castShadow) this.occlusion = new Occlusion(this.renderer, joint.shade.openness);
    this.scene.background = new Color(DEPTH);
    this.scene.fog = new FogExp2(TURBID.colour, TURBID.per_mm);
    this.lamp.position.set(FIBRES.x, FIBRES.y, FIBRES.z);
    this.lamp.target.position.set(FIBRES.x, FIBRES.y, -1);
    this.lamp.shadow.mapSize.set(SHADOW_PX, SHADOW_PX);
    this.lamp.shadow.bias = -0.0004; // in depth, which is finest near the lamp: 0.3 mm at 20 mm
    this.lamp.shadow.normalBias = 0.1;
    this.lamp.shadow.intensity = SHADE;
    this.camera.add(this.lamp, this.lamp.target);
    this.scene.add(this.camera, new HemisphereLight(0xffd9c4, 0xa04a38, 0.12), joint.root, this.water.specks);
    joint.setShow(SHOW);
    this.setOptic(optic);
  }

  close(): void {
    this.resolution.close();
    this.lamp.dispose();
    this.water.dispose();
    this.occlusion?.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  setOptic(optic: Optic): void {
    const [w, x, y, z] = cameraInTip(optic);
    this.turn.set(x, y, z, w);
    this.camera.fov = cameraFieldDeg(optic);
    this.camera.updateProjectionMatrix();
    this.lamp.angle = Math.min(STEEPEST, ((cameraFieldDeg(optic) / 2 + BEYOND_DEG) * Math.PI) / 180);
  }

  setMap(map: MapName): void {
    this.joint.setShow({ ...SHOW, map });
  }

  /** px of the page. */
  setSide(side: number): void {
    this.side = side;
    this.ratio = 0;
  }

  // setSize clears what was drawn: right before the next picture.
  private resize(): void {
    if (!this.side || this.resolution.value === this.ratio) return;
    this.ratio = this.resolution.value;
    this.renderer.setPixelRatio(this.ratio);
    this.renderer.setSize(this.side, this.side, false);
  }

  setInstruments(instruments: Instruments): void {
    this.instruments = instruments;
    this.joint.setInstruments(instruments);
  }

  /** False where the row has no scope, or it is lost: where it was last is no picture of now. */
  draw(row: Row, time: number): boolean {
    const there = (place: number): boolean => row[toolAt(place) + SEEN]! >= 1 && row[toolAt(place) + SEEN]! - 1 !== LOST;
    const optic = this.instruments.findIndex((one, place) => isOptic(one) && there(place));
    if (optic < 0) return false;
    const at = toolAt(optic);
    const pose = at + (row[at + HAS_WARPED] === 1 ? WARPED : TIP);
    this.joint.setRow(row, time);
    this.camera.position.set(row[pose + 4]!, row[pose + 5]!, row[pose + 6]!);
    this.camera.quaternion.set(row[pose + 1]!, row[pose + 2]!, row[pose + 3]!, row[pose]!).normalize().multiply(this.turn);
    this.camera.updateMatrixWorld();
    this.joint.touch(this.camera.matrixWorldInverse);
    this.joint.faceMarker(this.camera.quaternion);
    const now = performance.now();
    this.resize();
    this.water.move(this.camera, time, this.side * this.ratio);
    this.renderer.toneMappingExposure = this.exposure.at(now);
    this.occlusion?.draw(this.scene, this.camera, Math.floor(this.side * this.ratio));
    this.renderer.render(this.scene, this.camera);
    this.exposure.meter(now, this.camera);
    return true;
  }

  /** Whether the camera has come to the exposure that the picture asks for. */
  get settled(): boolean {
    return this.exposure.settled;
  }
}
