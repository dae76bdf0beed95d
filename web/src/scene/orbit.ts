// A camera that goes round a point, with pointer and keys. z is up, as in the patient who stands.
import { Vector3, type PerspectiveCamera } from "three";

export type PresetName = "anterior" | "medial" | "lateral" | "posterior" | "superior" | "inferior";
export const PRESETS: PresetName[] = ["anterior", "medial", "lateral", "posterior", "superior", "inferior"];

const TURN = 0.0055; // radians for each pixel
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

  private current: CameraState = { azimuth: 0.35, height: 0.3, distance: 260, target: new Vector3(0, 0, -18) };
  private animation: { from: CameraState; to: CameraState; began: number } | undefined;
  private readonly pointers = new Map<number, { x: number; y: number }>();
  private moved = 0;
  private readonly ends: (() => void)[] = [];

  constructor(private readonly camera: PerspectiveCamera, private readonly element: HTMLElement, private readonly left: boolean) {
    camera.up.set(0, 0, 1);
    this.listen("pointerdown", (event) => this.down(event));
    this.listen("pointermove", (event) => this.move(event));
    this.listen("pointerup", (event) => this.up(event));
    this.listen("pointercancel", (event) => this.pointers.delete(event.pointerId));
    this.listen("wheel", (event) => this.wheel(event));
    this.listen("keydown", (event) => this.key(event));
    this.listen("contextmenu", (event) => event.preventDefault());
  }

  close(): void {
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
    const target = (on && this.follow?.()) || this.current.target;
    this.animateTo({ ...this.current, distance: on ? 70 : 230, target: target.clone() });
  }

  /** Looks from there at once. */
  put({ azimuth, height, distance, target }: CameraState): void {
    this.animation = undefined;
    this.current = { azimuth, height, distance, target: target.clone() };
    this.onChange();
  }

  /** Puts the camera where it is now. True while it is on its way. */
  update(now: number): boolean {
    if (this.animation) this.advance(now);
    else {
      const target = this.follow?.();
      if (target) this.current.target.lerp(target, 0.25);
    }
    const { azimuth, height, distance, target } = this.current;
    this.camera.position.set(Math.sin(azimuth) * Math.cos(height), Math.cos(azimuth) * Math.cos(height), Math.sin(height));
    this.camera.position.multiplyScalar(distance).add(target);
    this.camera.lookAt(target);
    this.onCamera(this.current);
    return this.animation !== undefined;
  }

  private animateTo(to: CameraState): void {
    const from = { ...this.current, target: this.current.target.clone() };
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
    this.current = {
      azimuth: mix(from.azimuth, to.azimuth),
      height: mix(from.height, to.height),
      distance: mix(from.distance, to.distance),
      target: from.target.clone().lerp(to.target, s),
    };
    if (t === 1) this.animation = undefined;
  }

  private listen<K extends keyof HTMLElementEventMap>(kind: K, listener: (event: HTMLElementEventMap[K]) => void): void {
    this.element.addEventListener(kind, listener, { passive: false });
    this.ends.push(() => this.element.removeEventListener(kind, listener));
  }

  private turn(x: number, y: number): void {
    this.animation = undefined;
    this.current.azimuth += x;
    this.current.height = Math.min(STEEPEST, Math.max(-STEEPEST, this.current.height + y));
    this.onChange();
  }

  // x to the right, y up; mm in the plane through the target.
  private pan(x: number, y: number): void {
    this.animation = undefined;
    const right = new Vector3().setFromMatrixColumn(this.camera.matrix, 0);
    const up = new Vector3().setFromMatrixColumn(this.camera.matrix, 1);
    this.current.target.addScaledVector(right, x).addScaledVector(up, y);
    this.onChange();
  }

  private zoom(factor: number): void {
    this.animation = undefined;
    this.current.distance = Math.min(MOST_MM, Math.max(LEAST_MM, this.current.distance * factor));
    this.onChange();
  }

  private mmPerPixel(): number {
    return (2 * this.current.distance * Math.tan((this.camera.fov * Math.PI) / 360)) / Math.max(1, this.element.clientHeight);
  }

  private down(event: PointerEvent): void {
    this.element.focus({ preventScroll: true });
    this.element.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    this.moved = 0;
  }

  private move(event: PointerEvent): void {
    const last = this.pointers.get(event.pointerId);
    if (!last) return;
    const x = event.clientX - last.x;
    const y = event.clientY - last.y;
    this.moved += Math.abs(x) + Math.abs(y);
    if (this.pointers.size === 2) this.pinch(event, x, y);
    else if (event.buttons & 6 || event.shiftKey) this.pan(-x * this.mmPerPixel(), y * this.mmPerPixel());
    else if (this.moved > 3) this.turn(x * TURN, y * TURN);
    last.x = event.clientX;
    last.y = event.clientY;
  }

  private pinch(event: PointerEvent, x: number, y: number): void {
    const [other] = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
    const before = Math.hypot(event.clientX - x - other!.x, event.clientY - y - other!.y);
    const after = Math.hypot(event.clientX - other!.x, event.clientY - other!.y);
    if (before > 10 && after > 10) this.zoom(before / after);
    this.pan((-x / 2) * this.mmPerPixel(), (y / 2) * this.mmPerPixel());
  }

  private up(event: PointerEvent): void {
    if (this.pointers.delete(event.pointerId) && this.moved <= 3 && event.button === 0) {
      const box = this.element.getBoundingClientRect();
      this.onPress((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
    }
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    this.zoom(Math.exp(Math.sign(event.deltaY) * Math.min(0.25, Math.abs(event.deltaY) * 0.0015)));
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
