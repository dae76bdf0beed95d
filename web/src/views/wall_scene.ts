// Small pictures of all knees at once: one canvas over the cards, a scissor rectangle for each. Plain
// WebGL, so that the wall needs no 3-D library.
import { Validity, type ShortPose } from "wire";
import { part } from "../api";
import { drawnBySoftware } from "../graphics";
import type { StationState } from "../live";
import { onTheme, themeColour } from "../theme";
import { h } from "../ui";
import { CaseCache } from "./wall_cases";
import { kneeParts, type CaseFile, type Part } from "./wall_knee";

const VERTEX = `#version 300 es
uniform mat4 projection, model;
in vec3 position;
out vec3 seen;
void main() {
  vec4 at = model * vec4(position, 1.0);
  seen = at.xyz;
  gl_Position = projection * at;
}`;
// Flat faces from the derivatives: the model has no normals.
const FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 colour;
in vec3 seen;
out vec4 pixel;
void main() {
  vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
  float light = 0.42 + 0.40 * max(dot(normal, normalize(vec3(-0.4, 0.7, 0.8))), 0.0) + 0.22 * max(normal.z, 0.0);
  pixel = vec4(colour * light, 1.0);
}`;

const FIELD = Math.tan((11 * Math.PI) / 180); // half the angle of view
const REACH_MM = 82; // seen above and below the middle
const FAR_MM = REACH_MM / FIELD;
const MIDDLE = [0, 6, -16];
const SHAFT_MM = 110;
const SHAFT_RADIUS_MM = 1.7;

// The smaller the picture the fewer triangles; a processor that draws many by itself gets few in any case.
const FINE_MM = 3.5;
const COARSE_MM = 6;
const FINE_FROM_PX = 110;
const MANY = 8;

interface Slot {
  station: StationState | undefined;
  slot: HTMLElement;
}

interface Buffers {
  array: WebGLVertexArrayObject;
  buffers: WebGLBuffer[];
  count: number;
}

interface Drawn extends Buffers {
  body: number;
  soft: boolean;
}

type Parts = Record<number, Part[]>; // by cell

async function getJson<T>(path: string): Promise<T> {
  const response = await fetch(path);
  if (!response.ok) throw new Error(`${path}: ${response.status}`);
  return (await response.json()) as T;
}

async function loadParts(name: string): Promise<Parts> {
  const base = `/api/v1/cases/${part(name)}`;
  const [file, glb] = await Promise.all([getJson<CaseFile>(`${base}/case.json`), fetch(`${base}/anatomy.glb`)]);
  if (!glb.ok) throw new Error(`${name}: ${glb.status}`);
  const bytes = await glb.arrayBuffer();
  return { [COARSE_MM]: kneeParts(file, bytes, COARSE_MM), [FINE_MM]: kneeParts(file, bytes, FINE_MM) };
}

type Matrix = Float32Array; // 4 x 4, column by column

export class MiniScene {
  private readonly canvas = h("canvas", { class: "wall-canvas", "aria-hidden": "true" });
  private gl: WebGL2RenderingContext | null = null;
  private program: WebGLProgram | undefined;
  private shaft: Buffers | undefined;
  private bySoftware = false;
  private many = false;
  private readonly cases = new CaseCache<Parts>({
    list: async () => (await getJson<{ cases: { name: string; hash: string | null }[] }>("/api/v1/cases")).cases,
    load: loadParts,
    later: (ms, then) => void setTimeout(then, ms),
    changed: () => (this.drawn = ""),
  });
  private readonly knees = new Map<string, { hash: string; drawn: Drawn[] }>(); // by case and cell
  private readonly colours = new Map<string, number[]>();
  private readonly ends: (() => void)[];
  private drawn = "";

  constructor(grid: HTMLElement) {
    grid.after(this.canvas);
    const theme = (): void => {
      this.colours.clear();
      this.drawn = "";
    };
    this.canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.gl = null;
    });
    this.canvas.addEventListener("webglcontextrestored", () => this.begin());
    this.ends = [onTheme(theme)];
    this.begin();
  }

  end(): void {
    for (const end of this.ends) end();
    this.gl?.getExtension("WEBGL_lose_context")?.loseContext();
    this.canvas.remove();
  }

  /** Draws what is new; costs nothing where nothing moved. */
  draw(slots: Slot[]): void {
    const gl = this.gl;
    const area = this.canvas.getBoundingClientRect();
    if (!gl || area.width < 1) return;
    const boxes = slots.map(({ station, slot }) => ({ station, box: slot.getBoundingClientRect() }));
    const key = boxes.map(({ station, box }) => `${station?.momentAt ?? 0} ${box.left} ${box.top} ${box.width}`).join() + [area.left, area.top, area.width, area.height, this.knees.size, devicePixelRatio].join();
    if (key === this.drawn) return;
    this.drawn = key;
    this.many = slots.length > MANY;
    const scale = Math.min(2, devicePixelRatio);
    this.size(Math.round(area.width * scale), Math.round(area.height * scale));
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.SCISSOR_TEST);
    gl.useProgram(this.program!);
    for (const { station, box } of boxes) {
      if (!station?.place || box.bottom < area.top || box.top > area.bottom || box.height < 1) continue;
      const rectangle = [(box.left - area.left) * scale, (area.bottom - box.bottom) * scale, box.width * scale, box.height * scale].map(Math.round);
      gl.viewport(rectangle[0]!, rectangle[1]!, rectangle[2]!, rectangle[3]!);
      gl.scissor(rectangle[0]!, rectangle[1]!, rectangle[2]!, rectangle[3]!);
      this.drawStation(gl, station, box);
    }
  }

  private drawStation(gl: WebGL2RenderingContext, station: StationState, box: DOMRect): void {
    const moment = station.moment;
    const knee = this.knee(station, box.height < FINE_FROM_PX || (this.bySoftware && this.many) ? COARSE_MM : FINE_MM);
    if (!moment || !knee) return;
    gl.uniformMatrix4fv(this.where("projection"), false, projection(box.width / box.height));
    for (const one of knee) {
      const body = moment.bodies.find(({ body }) => (body as number) === one.body);
      const pose = body?.virtualPose ?? body?.pose;
      if (pose) this.drawPart(one, pose, this.colour(one.soft ? "--look" : "--bone"));
    }
    for (const instrument of moment.instruments) {
      const pose = instrument.warped ?? instrument.tip;
      if (!pose || instrument.validity === Validity.LOST) continue;
      this.drawPart(this.shaft!, pose, this.colour(instrument.validity === Validity.HELD ? "--text-quiet" : "--accent"));
    }
  }

  private drawPart(buffers: Buffers, pose: ShortPose, colour: number[]): void {
    const gl = this.gl!;
    gl.uniformMatrix4fv(this.where("model"), false, times(VIEW, matrixOf(pose)));
    gl.uniform3fv(this.where("colour"), colour);
    gl.bindVertexArray(buffers.array);
    gl.drawElements(gl.TRIANGLES, buffers.count, gl.UNSIGNED_SHORT, 0);
  }

  // ---- cases ---------------------------------------------------------------------------------------

  /** The connection is new: the server may have other cases. */
  renewCases(): void {
    this.cases.renew();
    this.drawn = "";
  }

  private knee(station: StationState, cell: number): Drawn[] | undefined {
    const name = station.place?.info?.caseName;
    const found = name ? this.cases.get(name) : undefined;
    if (!found) return undefined;
    const key = `${name} ${cell}`;
    const knee = this.knees.get(key);
    if (knee?.hash === found.hash) return knee.drawn;
    for (const { array, buffers } of knee?.drawn ?? []) this.discard(array, buffers);
    const drawn = found.value[cell]!.map((one) => ({ body: one.body, soft: one.soft, ...this.upload(one.positions, one.triangles) }));
    this.knees.set(key, { hash: found.hash, drawn });
    return drawn;
  }

  // ---- WebGL ---------------------------------------------------------------------------------------

  private begin(): void {
    this.bySoftware = drawnBySoftware();
    const gl = (this.gl = this.canvas.getContext("webgl2", { alpha: true, antialias: !this.bySoftware, powerPreference: "low-power" }));
    if (!gl) return;
    this.knees.clear();
    this.drawn = "";
    const program = (this.program = gl.createProgram()!);
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]] as const) {
      const shader = gl.createShader(kind)!;
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "position");
    gl.linkProgram(program);
    gl.enable(gl.DEPTH_TEST);
    this.places.clear();
    const { positions, triangles } = shaft();
    this.shaft = this.upload(positions, triangles);
  }

  private readonly places = new Map<string, WebGLUniformLocation | null>();

  private where(name: string): WebGLUniformLocation | null {
    if (!this.places.has(name)) this.places.set(name, this.gl!.getUniformLocation(this.program!, name));
    return this.places.get(name)!;
  }

  private size(width: number, height: number): void {
    if (this.canvas.width !== width) this.canvas.width = width;
    if (this.canvas.height !== height) this.canvas.height = height;
  }

  private upload(positions: Float32Array, triangles: Uint16Array): Buffers {
    const gl = this.gl!;
    const array = gl.createVertexArray()!;
    gl.bindVertexArray(array);
    const buffers = [gl.createBuffer()!, gl.createBuffer()!];
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[0]!);
    gl.bufferData(gl.ARRAY_BUFFER, positions, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[1]!);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return { array, buffers, count: triangles.length };
  }

  private discard(array: WebGLVertexArrayObject, buffers: WebGLBuffer[]): void {
    this.gl!.deleteVertexArray(array);
    for (const buffer of buffers) this.gl!.deleteBuffer(buffer);
  }

  private colour(token: string): number[] {
    let found = this.colours.get(token);
    if (!found) this.colours.set(token, (found = (themeColour(token).match(/[\d.]+/g) ?? []).slice(0, 3).map((c) => Number(c) / 255)));
    return found;
  }
}

// ---- matrices -----------------------------------------------------------------------------------------

// From the right and the front, a little from above: flexion and the joint's gap are both seen.
const VIEW = lookFrom([0.8, 0.62, 0.22]);

function lookFrom(direction: number[]): Matrix {
  const unit = (v: number[]): number[] => v.map((c) => c / Math.hypot(...v));
  const cross = (a: number[], b: number[]): number[] => [a[1]! * b[2]! - a[2]! * b[1]!, a[2]! * b[0]! - a[0]! * b[2]!, a[0]! * b[1]! - a[1]! * b[0]!];
  const dot = (a: number[], b: number[]): number => a[0]! * b[0]! + a[1]! * b[1]! + a[2]! * b[2]!;
  const back = unit(direction);
  const right = unit(cross([0, 0, 1], back));
  const up = cross(back, right);
  const rows = [right, up, back];
  return Float32Array.from([
    ...[0, 1, 2].flatMap((column) => [...rows.map((row) => row[column]!), 0]),
    -dot(right, MIDDLE), -dot(up, MIDDLE), -dot(back, MIDDLE) - FAR_MM, 1,
  ]);
}

function projection(aspect: number): Matrix {
  const near = FAR_MM / 4;
  const far = FAR_MM * 2;
  const scale = 1 / FIELD;
  const fit = Math.min(1, aspect); // narrow slots show as much from side to side as from top to bottom
  return Float32Array.from([(scale * fit) / aspect, 0, 0, 0, 0, scale * fit, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0]);
}

/** T_a_b as a matrix; anything but a whole pose is the identity. */
function matrixOf({ q, t }: ShortPose): Matrix {
  const [w, x, y, z] = q.length === 4 ? (q as [number, number, number, number]) : [1, 0, 0, 0];
  return Float32Array.from([
    1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0,
    2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
    2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0,
    t[0] ?? 0, t[1] ?? 0, t[2] ?? 0, 1,
  ]);
}

function times(a: Matrix, b: Matrix): Matrix {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; column++)
    for (let row = 0; row < 4; row++)
      for (let k = 0; k < 4; k++) out[4 * column + row]! += a[4 * k + row]! * b[4 * column + k]!;
  return out;
}

/** Six-sided, from the tip at the origin back along -z. */
function shaft(): { positions: Float32Array; triangles: Uint16Array } {
  const positions = [0, 0, 0];
  const triangles: number[] = [];
  for (let i = 0; i < 6; i++) {
    const [c, s] = [Math.cos((i * Math.PI) / 3) * SHAFT_RADIUS_MM, Math.sin((i * Math.PI) / 3) * SHAFT_RADIUS_MM];
    positions.push(c, s, -3, c, s, -SHAFT_MM);
    const [a, b] = [1 + 2 * i, 1 + 2 * ((i + 1) % 6)];
    triangles.push(0, a, b, a, a + 1, b, b, a + 1, b + 1);
  }
  return { positions: Float32Array.from(positions), triangles: Uint16Array.from(triangles) };
}
