// Small pictures of all stations at once: one canvas over the cards, a scissor rectangle for each. Each shows
// what the arthroscope sees, or the knee from outside where there is none. Menisci are as before any cut. Plain
// WebGL, so that the wall needs no 3-D library.
import { Validity, type Moment, type ShortPose } from "wire";
import { part } from "../api";
import { drawnBySoftware } from "../graphics";
import { FIRST_INSTRUMENT, isOptic, USUAL } from "../instruments";
import type { StationState } from "../live";
import { cameraFieldDeg, cameraInTip, USUAL_OPTIC, type Optic } from "../scene/optic";
import { readParts } from "../scene/gltf";
import { onTheme, themeColour } from "../theme";
import { h } from "../ui";
import { CaseCache } from "./wall_cases";
import { kneeParts, normalsOf, type Case, type Part } from "./wall_knee";

const VERTEX = `#version 300 es
uniform mat4 projection, model;
in vec3 position, normal;
out vec3 seen, across;
void main() {
  vec4 at = model * vec4(position, 1.0);
  seen = at.xyz;
  across = mat3(model) * normal;
  gl_Position = projection * at;
}`;
// In the scope the light stands beside the lens and fades; from outside it comes from above.
const FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 colour;
uniform bool inScope;
in vec3 seen, across;
out vec4 pixel;
void main() {
  vec3 normal = normalize(across);
  float far = length(seen);
  float facing = max(dot(normal, -seen / far), 0.0);
  float near = min(0.9, 420.0 / (far * far + 320.0));
  float outside = 0.42 + 0.40 * max(dot(normal, normalize(vec3(-0.4, 0.7, 0.8))), 0.0) + 0.22 * max(normal.z, 0.0);
  vec3 lit = colour * (inScope ? near * (0.25 + 0.75 * facing) : outside);
  pixel = vec4(inScope ? lit + vec3(0.1) * near * pow(facing, 40.0) : lit, 1.0);
}`;

const FIELD = Math.tan((11 * Math.PI) / 180); // half the angle of view
const REACH_MM = 82; // seen above and below the middle
const FAR_MM = REACH_MM / FIELD;
const MIDDLE = [0, 6, -16];
const SHAFT_MM = 110;
const SHAFT_RADIUS_MM = 1.7;
const SHAFT_SIDES = 10;

// The smaller the picture the fewer triangles; a processor that draws many by itself gets few in any case.
const FINE_MM = 1.2;
const COARSE_MM = 3.5;
const FINE_FROM_PX = 110;
const MANY = 8;
const OUTSIDE_MM = { fine: 3.5, coarse: 6 };

const OPTIC_PLACE = USUAL.findIndex(isOptic); // in every session
const SCOPE_NEAR_MM = 0.4;
const SCOPE_FAR_MM = 260;
const DARK = [0.16, 0.07, 0.06]; // where no light comes back from
const TISSUES: Record<Part["kind"], number[]> = { bone: [0.95, 0.9, 0.8], meniscus: [0.93, 0.8, 0.7], ligament: [0.92, 0.8, 0.66] };
const STEEL = [0.72, 0.75, 0.78];

interface Slot {
  station: StationState | undefined;
  slot: HTMLElement;
}

interface Buffers {
  array: WebGLVertexArrayObject;
  buffers: WebGLBuffer[];
  count: number;
}

/** Canvases that show a station too, by its name. */
export type Pictures = Map<HTMLCanvasElement, string>;

interface Copy {
  station: StationState | undefined;
  canvas: HTMLCanvasElement;
}

interface Drawn extends Buffers {
  body: number;
  kind: Part["kind"];
  colour: number[] | undefined;
}

type Parts = (cell: number) => Part[];

async function getJson<T>(path: string): Promise<T> {
  const response = await fetch(path);
  if (!response.ok) throw new Error(`${path}: ${response.status}`);
  return (await response.json()) as T;
}

// 0 to 1 each.
function rgb(colour: number | undefined): number[] | undefined {
  return colour === undefined ? undefined : [16, 8, 0].map((bits) => ((colour >> bits) & 255) / 255);
}

async function loadParts(name: string): Promise<Parts> {
  const base = `/api/v1/cases/${part(name)}`;
  const [told, glb] = await Promise.all([getJson<{ case: Case }>(base), fetch(`${base}/anatomy.glb`)]);
  if (!glb.ok) throw new Error(`${name}: ${glb.status}`);
  const meshes = readParts(await glb.arrayBuffer());
  return (cell) => kneeParts(told.case, meshes, cell);
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
  draw(slots: Slot[], copies: Copy[] = []): void {
    const gl = this.gl;
    const area = this.canvas.getBoundingClientRect();
    if (!gl || area.width < 1) return;
    const boxes = slots.map(({ station, slot }) => ({ station, slot, box: slot.getBoundingClientRect() }));
    const key = boxes.map(({ station, box }) => `${station?.momentAt ?? 0} ${box.left} ${box.top} ${box.width}`).join() + [area.left, area.top, area.width, area.height, this.knees.size, devicePixelRatio, ...copies.map(({ station, canvas }) => `${station?.momentAt} ${canvas.clientWidth}`)].join();
    if (key === this.drawn) return;
    this.drawn = key;
    this.many = slots.length > MANY;
    const scale = Math.min(2, devicePixelRatio);
    this.size(Math.round(area.width * scale), Math.round(area.height * scale));
    gl.useProgram(this.program!);
    for (const { station, canvas } of copies) if (station?.place && station.moment) this.copy(gl, station, canvas, scale);
    this.clear(gl);
    for (const { station, slot, box } of boxes) {
      if (!station?.place || box.bottom < area.top || box.top > area.bottom || box.height < 1) continue;
      const rectangle = [(box.left - area.left) * scale, (area.bottom - box.bottom) * scale, box.width * scale, box.height * scale].map(Math.round);
      gl.viewport(rectangle[0]!, rectangle[1]!, rectangle[2]!, rectangle[3]!);
      gl.scissor(rectangle[0]!, rectangle[1]!, rectangle[2]!, rectangle[3]!);
      slot.classList.toggle("in-scope", this.drawStation(gl, station, box));
    }
  }

  private clear(gl: WebGL2RenderingContext): void {
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.SCISSOR_TEST);
  }

  // Drawn in the corner of the cards' canvas, and taken from there.
  private copy(gl: WebGL2RenderingContext, station: StationState, canvas: HTMLCanvasElement, scale: number): void {
    const box = { width: canvas.clientWidth, height: canvas.clientHeight };
    const [width, height] = [Math.round(box.width * scale), Math.round(box.height * scale)];
    if (width < 1 || height < 1 || width > this.canvas.width || height > this.canvas.height) return;
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    this.clear(gl);
    gl.viewport(0, 0, width, height);
    gl.scissor(0, 0, width, height);
    const inScope = this.drawStation(gl, station, box);
    const to = canvas.getContext("2d")!;
    to.clearRect(0, 0, width, height);
    to.drawImage(this.canvas, 0, this.canvas.height - height, width, height, 0, 0, width, height);
    canvas.classList.toggle("in-scope", inScope);
  }

  /** Whether it is what the scope sees. */
  private drawStation(gl: WebGL2RenderingContext, station: StationState, box: { width: number; height: number }): boolean {
    const { moment } = station;
    const fine = box.height >= FINE_FROM_PX && !(this.bySoftware && this.many);
    const optic = moment && scopePose(moment);
    const knee = this.knee(station, optic ? (fine ? FINE_MM : COARSE_MM) : fine ? OUTSIDE_MM.fine : OUTSIDE_MM.coarse);
    if (!moment || !knee) return optic !== undefined;
    const aspect = box.width / box.height;
    const { tiltDeg, fieldDeg } = opticOf(station);
    const eye = optic ? inverse(times(matrixOf(optic), cameraMatrix(tiltDeg))) : VIEW;
    if (optic) {
      gl.clearColor(DARK[0]!, DARK[1]!, DARK[2]!, 1);
      gl.clear(gl.COLOR_BUFFER_BIT);
    }
    gl.uniform1i(this.where("inScope"), optic ? 1 : 0);
    gl.uniformMatrix4fv(this.where("projection"), false, optic ? scopeProjection(aspect, fieldDeg) : projection(aspect));
    for (const one of knee) {
      const body = moment.bodies.find(({ body }) => (body as number) === one.body);
      const pose = body?.virtualPose ?? body?.pose;
      if (!pose || (one.kind === "ligament" && !optic)) continue;
      this.drawPart(one, eye, pose, optic ? one.colour ?? TISSUES[one.kind] : this.colour(one.kind === "bone" ? "--bone" : "--look"));
    }
    for (const instrument of moment.instruments) {
      const pose = instrument.warped ?? instrument.tip;
      const isSelf = optic !== undefined && instrument.channel === FIRST_INSTRUMENT + OPTIC_PLACE;
      if (!pose || isSelf || instrument.validity === Validity.LOST) continue;
      this.drawPart(this.shaft!, eye, pose, optic ? STEEL : this.colour(instrument.validity === Validity.HELD ? "--text-quiet" : "--accent"));
    }
    return optic !== undefined;
  }

  private drawPart(buffers: Buffers, eye: Matrix, pose: ShortPose, colour: number[]): void {
    const gl = this.gl!;
    gl.uniformMatrix4fv(this.where("model"), false, times(eye, matrixOf(pose)));
    gl.uniform3fv(this.where("colour"), colour);
    gl.bindVertexArray(buffers.array);
    gl.drawElements(gl.TRIANGLES, buffers.count, gl.UNSIGNED_INT, 0);
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
    const drawn = found.value(cell).map((one) => ({ body: one.body, kind: one.kind, colour: rgb(one.colour), ...this.upload(one) }));
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
    gl.bindAttribLocation(program, 1, "normal");
    gl.linkProgram(program);
    gl.enable(gl.DEPTH_TEST);
    this.places.clear();
    this.shaft = this.upload(shaft());
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

  private upload({ positions, normals, triangles }: Pick<Part, "positions" | "normals" | "triangles">): Buffers {
    const gl = this.gl!;
    const array = gl.createVertexArray()!;
    gl.bindVertexArray(array);
    const buffers = [positions, normals, triangles].map((values, place) => {
      const buffer = gl.createBuffer()!;
      const kind = place < 2 ? gl.ARRAY_BUFFER : gl.ELEMENT_ARRAY_BUFFER;
      gl.bindBuffer(kind, buffer);
      gl.bufferData(kind, values, gl.STATIC_DRAW);
      if (place < 2) gl.enableVertexAttribArray(place);
      if (place < 2) gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
      return buffer;
    });
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

/** Where the scope is; undefined where it is lost, or there is none. */
function scopePose({ instruments }: Moment): ShortPose | undefined {
  const scope = instruments.find(({ channel, validity }) => channel === FIRST_INSTRUMENT + OPTIC_PLACE && validity !== Validity.LOST);
  return scope?.warped ?? scope?.tip;
}

const opticOf = ({ place }: StationState): Optic =>
  place?.opticViewDeg ? { tiltDeg: place.opticDeg, fieldDeg: place.opticViewDeg, postDeg: 0 } : USUAL_OPTIC;

const cameraMatrix = (tiltDeg: number): Matrix => matrixOf({ q: cameraInTip({ ...USUAL_OPTIC, tiltDeg }), t: [] });

// The circle that the optic sees touches the nearer sides of the slot.
function scopeProjection(aspect: number, fieldDeg: number): Matrix {
  const scale = 1 / Math.tan((cameraFieldDeg({ ...USUAL_OPTIC, fieldDeg }) * Math.PI) / 360);
  const fit = Math.min(1, aspect);
  const [near, far] = [SCOPE_NEAR_MM, SCOPE_FAR_MM];
  return Float32Array.from([(scale * fit) / aspect, 0, 0, 0, 0, scale * fit, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0]);
}

/** T_a_b as a matrix; anything but a whole pose is the identity. */
function matrixOf({ q, t }: Pick<ShortPose, "q" | "t">): Matrix {
  const [w, x, y, z] = q.length === 4 ? (q as [number, number, number, number]) : [1, 0, 0, 0];
  return Float32Array.from([
    1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0,
    2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
    2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0,
    t[0] ?? 0, t[1] ?? 0, t[2] ?? 0, 1,
  ]);
}

/** Of a rotation and a shift. */
function inverse(m: Matrix): Matrix {
  const shift = (row: number): number => -(m[4 * row]! * m[12]! + m[4 * row + 1]! * m[13]! + m[4 * row + 2]! * m[14]!);
  return Float32Array.from([m[0]!, m[4]!, m[8]!, 0, m[1]!, m[5]!, m[9]!, 0, m[2]!, m[6]!, m[10]!, 0, shift(0), shift(1), shift(2), 1]);
}

function times(a: Matrix, b: Matrix): Matrix {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; column++)
    for (let row = 0; row < 4; row++)
      for (let k = 0; k < 4; k++) out[4 * column + row]! += a[4 * k + row]! * b[4 * column + k]!;
  return out;
}

/** From the tip at the origin back along -z. */
function shaft(): Pick<Part, "positions" | "normals" | "triangles"> {
  const positions = [0, 0, 0];
  const triangles: number[] = [];
  for (let i = 0; i < SHAFT_SIDES; i++) {
    const turn = (2 * i * Math.PI) / SHAFT_SIDES;
    const [c, s] = [Math.cos(turn) * SHAFT_RADIUS_MM, Math.sin(turn) * SHAFT_RADIUS_MM];
    positions.push(c, s, -3, c, s, -SHAFT_MM);
    const [a, b] = [1 + 2 * i, 1 + 2 * ((i + 1) % SHAFT_SIDES)];
    triangles.push(0, a, b, a, a + 1, b, b, a + 1, b + 1);
  }
  const shape = { positions: Float32Array.from(positions), triangles: Uint32Array.from(triangles) };
  return { ...shape, normals: normalsOf(shape.positions, shape.triangles) };
}
