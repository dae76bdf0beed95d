// A camera that goes round a point, with pointer (three's OrbitControls) and keys. z is up, as in the patient who stands.
import { MOUSE, Vector3, type PerspectiveCamera } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

export type PresetName = "anterior" | "medial" | "lateral" | "posterior" | "superior" | "inferior";
export const PRESETS: PresetName[] = ["anterior", "medial", "lateral", "posterior", "superior", "inferior"];

const STILL_PX = 3; // a press that moves no further is a click
const KEY_TURN = Math.PI / 24;
const STEEPEST = Math.PI / 2 - 0.001;
const LEAST_MM = 12;
const MOST_MM = 900;
const ANIMATION_MS = 280;

export interface CameraState {
  azimuth: number; // 0: from anterior, towards the patient's right
  height: number;
  distance: number;
  target: Vector3;
}

export class Orbit {
  onChange: () => void = () => {};
  onPress: (x: number, y: number) => void = () => {}; // a click that turned nothing; shares of the canvas
  onCamera: (state: CameraState) => void = () => {}; // where the eye is, before each picture
  follow: (() => Vector3 | undefined) | undefined;

  private readonly controls: OrbitControls;
  private animation: { from: CameraState; to: CameraState; began: number } | undefined;
  private pressed: { x: number; y: number } | undefined;
  private readonly ends: (() => void)[] = [];

  constructor(private readonly camera: PerspectiveCamera, private readonly element: HTMLElement, private readonly left: boolean) {
    camera.up.set(0, 0, 1); // before the controls read it
    this.controls = new OrbitControls(camera, element);
    Object.assign(this.controls, { minDistance: LEAST_MM, maxDistance: MOST_MM, rotateSpeed: 0.5, zoomSpeed: 3 });
    this.controls.mouseButtons = { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.PAN, RIGHT: MOUSE.PAN };
    this.controls.addEventListener("start", () => (this.animation = undefined));
    this.controls.addEventListener("change", () => this.onChange());
    this.listen("pointerdown", (event) => this.down(event));
    this.listen("pointerup", (event) => this.up(event));
    this.listen("keydown", (event) => this.key(event));
    this.look({ azimuth: 0.35, height: 0.3, distance: 260, target: new Vector3(0, 0, -18) });
  }

  close(): void {
    this.controls.dispose();
    for (const end of this.ends) end();
  }

  preset(name: PresetName): void {
    const lateral = this.left ? -1 : 1; // x is to the patient's right
    const [azimuth, height] = {
      anterior: [0, 0.12], posterior: [Math.PI, 0.12], lateral: [(lateral * Math.PI) / 2, 0.12], medial: [(-lateral * Math.PI) / 2, 0.12],
      superior: [0, STEEPEST], inferior: [0, -STEEPEST],
    }[name] as [number, number];
    this.animateTo({ azimuth, height, distance: 230, target: new Vector3(0, 0, -18) });
  }

  /** Near to what is followed, or back. */
  closeUp(on: boolean): void {
    const target = (on && this.follow?.()) || this.controls.target;
    this.animateTo({ ...this.state, distance: on ? 70 : 230, target: target.clone() });
  }

  /** Looks from there at once. */
  put(state: CameraState): void {
    this.animation = undefined;
    this.look(state);
    this.onChange();
  }

  /** Puts the camera where it is now. True while it is on its way. */
  update(now: number): boolean {
    const target = this.animation ? undefined : this.follow?.();
    if (this.animation) this.advance(now);
    else if (target) this.shift(target.clone().sub(this.controls.target).multiplyScalar(0.25));
    this.onCamera(this.state);
    return this.animation !== undefined;
  }

  private get state(): CameraState {
    const { target } = this.controls;
    const { x, y, z } = this.camera.position.clone().sub(target);
    return { azimuth: Math.atan2(x, y), height: Math.atan2(z, Math.hypot(x, y)), distance: Math.hypot(x, y, z), target: target.clone() };
  }

  private look({ azimuth, height, distance, target }: CameraState): void {
    const steep = Math.min(STEEPEST, Math.max(-STEEPEST, height));
    this.controls.target.copy(target);
    this.camera.position.set(Math.sin(azimuth) * Math.cos(steep), Math.cos(azimuth) * Math.cos(steep), Math.sin(steep)).multiplyScalar(distance).add(target);
    this.controls.update();
  }

  private shift(by: Vector3): void {
    this.controls.target.add(by);
    this.camera.position.add(by);
    this.controls.update();
  }

  private animateTo(to: CameraState): void {
    const from = this.state;
    const turns = Math.round((to.azimuth - from.azimuth) / (2 * Math.PI));
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.animation = { from, to: { ...to, azimuth: to.azimuth - 2 * Math.PI * turns }, began: still ? -Infinity : performance.now() };
    this.onChange();
  }

  private advance(now: number): void {
    const { from, to, began } = this.animation!;
    const t = Math.min(1, (now - began) / ANIMATION_MS);
    const s = t * t * (3 - 2 * t);
    const mix = (a: number, b: number): number => a + s * (b - a);
    this.look({
      azimuth: mix(from.azimuth, to.azimuth),
      height: mix(from.height, to.height),
      distance: mix(from.distance, to.distance),
      target: from.target.clone().lerp(to.target, s),
    });
    if (t === 1) this.animation = undefined;
  }

  private listen<K extends keyof HTMLElementEventMap>(kind: K, listener: (event: HTMLElementEventMap[K]) => void): void {
    this.element.addEventListener(kind, listener);
    this.ends.push(() => this.element.removeEventListener(kind, listener));
  }

  private turn(x: number, y: number): void {
    const { azimuth, height, ...rest } = this.state;
    this.put({ ...rest, azimuth: azimuth + x, height: height + y });
  }

  // x to the right, y up; mm in the plane through the target.
  private pan(x: number, y: number): void {
    this.animation = undefined;
    const right = new Vector3().setFromMatrixColumn(this.camera.matrix, 0);
    const up = new Vector3().setFromMatrixColumn(this.camera.matrix, 1);
    this.shift(right.multiplyScalar(x).addScaledVector(up, y));
  }

  private zoom(factor: number): void {
    const { distance, ...rest } = this.state;
    this.put({ ...rest, distance: Math.min(MOST_MM, Math.max(LEAST_MM, distance * factor)) });
  }

  private down(event: PointerEvent): void {
    this.element.focus({ preventScroll: true });
    this.pressed = event.button === 0 ? { x: event.clientX, y: event.clientY } : undefined;
  }

  private up({ clientX, clientY }: PointerEvent): void {
    const { pressed } = this;
    this.pressed = undefined;
    if (!pressed || Math.hypot(clientX - pressed.x, clientY - pressed.y) > STILL_PX) return;
    const box = this.element.getBoundingClientRect();
    this.onPress((clientX - box.left) / box.width, (clientY - box.top) / box.height);
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const arrows: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const way = arrows[event.key];
    const preset = PRESETS[Number(event.key) - 1];
    if (way && event.shiftKey) this.pan(way[0] * 8, way[1] * 8);
    else if (way) this.turn(way[0] * KEY_TURN, way[1] * KEY_TURN);
    else if (event.key === "+" || event.key === "=") this.zoom(0.85);
    else if (event.key === "-") this.zoom(1 / 0.85);
    else if (preset) this.preset(preset);
    else return;
    event.preventDefault();
  }
}
