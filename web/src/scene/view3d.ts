// A canvas with the joint. It is drawn when something has changed, and coarser where that takes longer than a
// sixtieth of a second (or than the screen's own time): the picture follows the hands. Once nothing changes any more
// it is drawn finely.
import { AmbientLight, DirectionalLight, PerspectiveCamera, Raycaster, Scene, SRGBColorSpace, Vector2, WebGLRenderer } from "three";
import { drawnBySoftware, measureScreen, screenMs } from "../graphics";
import { h } from "../ui";
import type { Joint, Marker } from "./joint";
import { Orbit } from "./orbit";

const HELD_MS = 1000 / 60;
const SLOW = 1.14; // of what is held: a mean, where one in seven is late
const FAST = 1.05;
const PATIENCE = { least: 30, most: 3600 }; // pictures
const VAIN_MOST = 60; // pictures: a try that held for longer was not in vain
const COARSEST = 0.6;
const STILL_MS = 300;
const PAUSE_MS = 2000; // a page that was hidden

/** No 3-D in this browser. */
export class NoWebGl extends Error {}

export function newRenderer(canvas: HTMLCanvasElement): WebGLRenderer {
  try {
    const renderer = new WebGLRenderer({ canvas, antialias: !drawnBySoftware(), alpha: true, powerPreference: "high-performance" });
    renderer.outputColorSpace = SRGBColorSpace;
    return renderer;
  } catch {
    throw new NoWebGl();
  }
}

/**
 * How fine a picture is drawn: pixels of it for each of the page's. A screen shows no picture earlier than its time, so
 * nobody knows whether a finer one would be in time. It is tried, and after each vain try twice as late.
 */
export class AdaptiveResolution {
  private moving: number;
  private patience = PATIENCE.least;
  private since = 0; // pictures, since the last change
  private grown = false; // by it
  private still = false;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private spent = FAST * HELD_MS;

  constructor(private readonly finest = Math.min(devicePixelRatio, 2), coarse = drawnBySoftware()) {
    this.moving = coarse ? COARSEST * finest : finest;
  }

  private get held(): number {
    return Math.max(HELD_MS, screenMs());
  }

  get value(): number {
    return this.still ? this.finest : this.moving;
  }

  /** After a picture. The frame that follows comes late where drawing took long, whenever the next picture is due. */
  drawn(now: number): void {
    if (!this.still) requestAnimationFrame((next) => next - now < PAUSE_MS && this.took(next - now));
  }

  /** Of a picture that took so long. */
  took(ms: number): void {
    this.spent += 0.1 * (Math.min(ms, 2 * this.held) - this.spent);
    this.since++;
    if (this.spent > SLOW * this.held) this.change(this.moving * 0.8);
    else if (this.spent < FAST * this.held && this.since > this.patience) this.change(this.moving * 1.25);
  }

  private change(wanted: number): void {
    const next = Math.min(this.finest, Math.max(COARSEST * this.finest, wanted));
    if (next === this.moving) return;
    if (next < this.moving && this.grown) this.patience = this.since < VAIN_MOST ? Math.min(2 * this.patience, PATIENCE.most) : PATIENCE.least;
    this.grown = next > this.moving;
    this.moving = next;
    this.spent = this.held;
    this.since = 0;
  }

  /** Something has changed. */
  move(): void {
    clearTimeout(this.timer);
    this.still = false;
  }

  /** After a picture: `draw` is for a fine one, when nothing has changed for a while. */
  rest(draw: () => void): void {
    clearTimeout(this.timer);
    if (this.value === this.finest) return;
    this.timer = setTimeout(() => {
      this.still = true;
      draw();
      measureScreen(() => this.still);
    }, STILL_MS);
  }

  close(): void {
    clearTimeout(this.timer);
  }
}

export class View3D {
  readonly canvas: HTMLCanvasElement;
  readonly camera = new PerspectiveCamera(30, 1, 2, 2500);
  readonly orbit: Orbit;
  /** Before each picture; true: another one is needed. */
  onFrame: (now: number) => boolean = () => false;
  onPick: (marker: Marker) => void = () => {};

  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly resolution: AdaptiveResolution;
  private readonly resize: ResizeObserver;
  private pending = 0;
  private ratio = 0; // pixels of the picture for each of the page's
  private closed = false;

  constructor(readonly element: HTMLElement, private readonly joint: Joint, name: string) {
    this.canvas = h("canvas", { class: "scene-canvas", tabindex: 0, role: "application", "aria-label": name });
    this.renderer = newRenderer(this.canvas);
    this.resolution = new AdaptiveResolution();
    element.append(this.canvas);
    const lamp = new DirectionalLight(0xffffff, 2.1);
    lamp.position.set(-0.5, 0.8, 1);
    const second = new DirectionalLight(0xdfe9ff, 0.7);
    second.position.set(1, -0.3, 0.6);
    this.camera.add(lamp, lamp.target, second, second.target);
    lamp.target.position.set(0, 0, -1);
    second.target.position.set(0, 0, -1);
    this.scene.add(this.camera, new AmbientLight(0xffffff, 0.9), joint.root);
    this.orbit = new Orbit(this.camera, this.canvas, joint.knee.left);
    this.orbit.onChange = () => this.draw();
    this.orbit.onPress = (x, y) => this.pick(x, y);
    this.resize = new ResizeObserver(() => this.measure());
    this.resize.observe(element);
    this.measure();
  }

  close(): void {
    this.closed = true;
    cancelAnimationFrame(this.pending);
    this.resolution.close();
    this.resize.disconnect();
    this.orbit.close();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
    this.canvas.remove();
  }

  /** Something has changed. Once for all changes until the next frame. */
  draw(): void {
    this.resolution.move();
    this.request();
  }

  private request(): void {
    if (this.closed) return;
    this.pending ||= requestAnimationFrame((now) => {
      this.pending = 0;
      this.paint(now);
    });
  }

  private paint(now: number): void {
    if (!this.canvas.clientWidth || document.hidden) return;
    const more = this.onFrame(now);
    const gliding = this.orbit.update(now);
    this.joint.faceMarker(this.camera.quaternion);
    if (this.resolution.value !== this.ratio) this.size();
    this.renderer.render(this.scene, this.camera);
    this.resolution.drawn(now);
    if (more || gliding) this.draw();
    else this.resolution.rest(() => this.request());
  }

  private measure(): void {
    this.size();
    this.draw();
  }

  private size(): void {
    const { clientWidth, clientHeight } = this.element;
    if (!clientWidth || !clientHeight) return;
    this.ratio = this.resolution.value;
    this.renderer.setPixelRatio(this.ratio);
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
  }

  private pick(x: number, y: number): void {
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2(2 * x - 1, 1 - 2 * y), this.camera);
    const [hit] = ray.intersectObjects(this.joint.targets(), false);
    if (hit) this.onPick(this.joint.markerOf(hit.object, hit.point));
  }
}
