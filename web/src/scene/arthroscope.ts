// The picture of an arthroscope: the joint from the tip of the scope, lit from there. The canvas is the
// square around the round picture.
import { BackSide, Color, HemisphereLight, Matrix4, NeutralToneMapping, PerspectiveCamera, PointLight, Quaternion, Scene, Vector3, type WebGLRenderer } from "three";
import { HAS_WARPED, SEEN, TIP, toolAt, WARPED, type Row } from "../history";
import { SCOPE, type Joint } from "./joint";
import { cameraFieldDeg, cameraInTip, type Optic } from "./optic";
import { Fineness, newRenderer } from "./view3d";

const LIGHT = 260; // at 1 mm, before it fades with distance
const FADE = 1.45; // less than the square: cameras open up in the distance
const DEPTH = 0x1a0b0a; // where no light comes back from
const MEAN = 0.76; // of what is lit, as the camera wants to have it
const METER_MS = 120;
const METER_EACH = 13; // vertices of which one is looked at
const METER_CONE = Math.cos((36 * Math.PI) / 180);

const matrix = new Matrix4();
const place = new Vector3();
const normal = new Vector3();

export class Arthroscope {
  readonly camera = new PerspectiveCamera(90, 1, 0.4, 260);
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly fineness: Fineness;
  private readonly turn = new Quaternion(); // of the camera in the tip's frame
  private side = 0; // px of the page
  private meteredAt = 0;
  private exposure = 0; // 0: the next one is taken as it is

  constructor(canvas: HTMLCanvasElement, private readonly joint: Joint, optic: Optic) {
    this.renderer = newRenderer(canvas);
    this.fineness = new Fineness();
    this.renderer.toneMapping = NeutralToneMapping;
    this.scene.background = new Color(DEPTH);
    const lamp = new PointLight(0xfffaf2, LIGHT, 0, FADE);
    lamp.position.set(0.9, 1.2, 0.3);
    this.camera.add(lamp);
    this.scene.add(this.camera, new HemisphereLight(0xffe9dd, 0x5a2018, 0.16), joint.root);
    joint.setShow({ ghost: false, raw: false, trails: false, femur: true, patella: true, ligaments: true, skin: true, seeThrough: false, map: "none" });
    this.setOptic(optic);
  }

  close(): void {
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  setOptic(optic: Optic): void {
    const [w, x, y, z] = cameraInTip(optic);
    this.turn.set(x, y, z, w);
    this.camera.fov = cameraFieldDeg(optic);
    this.camera.updateProjectionMatrix();
  }

  /** px of the page, and whether pictures follow each other without a break, which took so long. */
  setSide(side: number): void {
    this.side = side;
    this.resize();
  }

  took(ms: number): void {
    if (this.fineness.took(ms)) this.resize();
  }

  private resize(): void {
    if (!this.side) return;
    this.renderer.setPixelRatio(this.fineness.value);
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
    this.meter();
    this.renderer.render(this.scene, this.camera);
    return true;
  }

  // Cameras open and close by how bright the middle of the picture is: the mean of what the lamp gives to
  // surfaces there, each by how large it appears. Nothing hides anything here; what is near counts most.
  private meter(): void {
    const now = performance.now();
    if (now - this.meteredAt < METER_MS) return;
    this.meteredAt = now;
    let light = 0;
    let size = 0;
    this.camera.updateMatrixWorld();
    for (const { shown } of this.joint.surfaces) {
      if (!shown.visible) continue;
      matrix.multiplyMatrices(this.camera.matrixWorldInverse, shown.matrixWorld);
      const positions = shown.geometry.getAttribute("position");
      const normals = shown.geometry.getAttribute("normal");
      const inwards = shown.material.side === BackSide ? -1 : 1;
      for (let i = 0; i < positions.count; i += METER_EACH) {
        place.fromBufferAttribute(positions, i).applyMatrix4(matrix);
        const distance = place.length();
        if (!(-place.z > METER_CONE * distance) || distance < 1) continue;
        const facing = (-inwards * normal.fromBufferAttribute(normals, i).transformDirection(matrix).dot(place)) / distance;
        if (facing <= 0) continue;
        const seen = facing / distance ** 4; // nearer ones hide farther ones
        light += (seen * facing * LIGHT) / (Math.PI * distance ** FADE);
        size += seen;
      }
    }
    if (!size) return;
    const wanted = Math.min(4, Math.max(0.15, (MEAN * size) / light));
    this.exposure = this.exposure ? this.exposure + 0.25 * (wanted - this.exposure) : wanted;
    this.renderer.toneMappingExposure = this.exposure;
  }
}
