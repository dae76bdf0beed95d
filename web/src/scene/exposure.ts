// How a camera makes light to signal, and how it opens and closes by what it has seen: some rows of the
// picture are read back once they are there, without waiting for them.
import { Quaternion, Vector3, type Camera } from "three";

const GAIN = 1.5;
const ROWS = 24;
const METER_MS = { moving: 250, still: 2000 };
const MOVED = { mm: 0.5, cos: Math.cos((1.5 * Math.PI) / 360) };
const ADAPT_MS = { close: 120, open: 400 }; // to go most of the way: what is too bright shows nothing
const BRIGHT = { share: 0.75, light: 0.72 }; // so much of the picture is to be darker than that
const BRIGHTEST = { share: 0.96, light: 1.6 };
const FIRST = 0.3;
const LEAST = 0.01;
const MOST = 6;
const SETTLED = 0.03; // of the exposure
const EACH = 4; // pixels of a row of which one is looked at

/** In GLSL: what is bright is held back and never quite white, what is dark stays warm, as red walls light it. */
export const TONE = `
vec3 CustomToneMapping(vec3 color) {
  vec3 light = ${GAIN.toFixed(2)} * toneMappingExposure * color;
  vec3 signal = 1.0 - 1.0 / (1.0 + light * (1.0 + light * (0.5 + 0.17 * light))); // 1 - exp(-light), nearly
  return signal * mix(vec3(1.0, 0.93, 0.87), vec3(1.0), signal);
}`;

// Of each value of a pixel's red, which the warmth leaves alone: the light times the exposure.
const LIGHT = Float32Array.from({ length: 256 }, (_, i) => {
  const c = Math.min(i, 254) / 255;
  return -Math.log(1 - (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)) / GAIN;
});

interface Reading {
  sync: WebGLSync;
  buffer: WebGLBuffer;
  width: number;
  exposure: number; // that the picture was made with
}

export class Exposure {
  private value = 0; // 0: nothing was metered yet
  private wanted = FIRST;
  private adaptedAt = 0;
  private meteredAt = -Infinity;
  private reading: Reading | undefined;
  private readonly position = new Vector3(); // of the camera when it metered
  private readonly quaternion = new Quaternion();

  constructor(private readonly gl: WebGL2RenderingContext) {}

  /** Whether it has come to what the last pictures asked for. */
  get settled(): boolean {
    return this.value > 0 && !this.reading && Math.abs(this.value - this.wanted) <= SETTLED * this.wanted;
  }

  /** For the next picture. */
  at(now: number): number {
    const first = this.read();
    const most = this.wanted < this.value ? ADAPT_MS.close : ADAPT_MS.open;
    if (this.value) this.value += (1 - Math.exp((this.adaptedAt - now) / most)) * (this.wanted - this.value);
    else if (first) this.value = this.wanted;
    this.adaptedAt = now;
    return this.value || FIRST;
  }

  /** After a picture, before anything else is drawn. */
  meter(now: number, camera: Camera): void {
    const still = this.settled && this.position.distanceTo(camera.position) < MOVED.mm && Math.abs(this.quaternion.dot(camera.quaternion)) > MOVED.cos;
    if (this.reading || now - this.meteredAt < (still ? METER_MS.still : METER_MS.moving)) return;
    this.meteredAt = now;
    this.position.copy(camera.position);
    this.quaternion.copy(camera.quaternion);
    const { gl } = this;
    const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
    const buffer = gl.createBuffer()!;
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, 4 * ROWS * width, gl.STREAM_READ);
    for (let row = 0; row < ROWS; row++) gl.readPixels(0, Math.floor(((row + 0.5) * height) / ROWS), width, 1, gl.RGBA, gl.UNSIGNED_BYTE, 4 * row * width);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0)!;
    gl.flush();
    this.reading = { sync, buffer, width, exposure: this.value || FIRST };
  }

  // True where something came.
  private read(): boolean {
    if (!this.reading) return false;
    const { gl } = this;
    const { sync, buffer, width, exposure } = this.reading;
    if (gl.clientWaitSync(sync, 0, 0) === gl.TIMEOUT_EXPIRED) return false;
    const pixels = new Uint8Array(4 * ROWS * width);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, pixels);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    gl.deleteBuffer(buffer);
    gl.deleteSync(sync);
    this.reading = undefined;
    this.wanted = wantedExposure(pixels, width, exposure);
    return true;
  }
}

/** Of rows of a square picture, four bytes for each pixel, made with `exposure`: what is in the circle counts. */
export function wantedExposure(pixels: Uint8Array, width: number, exposure: number): number {
  const rows = pixels.length / (4 * width);
  const found: number[] = [];
  for (let row = 0; row < rows; row++) {
    const y = (2 * row + 1) / rows - 1;
    for (let x = 0; x < width; x += EACH)
      if (Math.hypot((2 * x + 1) / width - 1, y) <= 1) found.push(LIGHT[pixels[4 * (row * width + x)]!]! / exposure);
  }
  found.sort((a, b) => a - b);
  const limits = [BRIGHT, BRIGHTEST].map(({ share, light }) => light / Math.max(found[Math.floor(share * found.length)]!, 1e-3));
  return Math.max(LEAST, Math.min(MOST, ...limits));
}
