// What drifts in the water between scope and tissue: it tells how far things are, and that the picture lives. Where each
// speck is follows from the time alone.
import { BufferAttribute, BufferGeometry, Points, ShaderMaterial, Vector3, type Camera } from "three";

const SPECKS = 300;
const BOX = 36; // mm around the eye; who leaves it comes in on the other side

const VERTEX = `
uniform vec3 eye;
uniform float time, height;
varying float light;
void main() {
  vec3 drift = time * vec3(0.017, -0.011, 0.023) + 0.01 * sin(0.7 * time + 40.0 * position.yzx);
  vec4 seen = viewMatrix * vec4(eye + ${BOX.toFixed(1)} * (fract(position + drift - eye / ${BOX.toFixed(1)}) - 0.5), 1.0);
  gl_Position = projectionMatrix * seen;
  gl_PointSize = clamp(0.09 * projectionMatrix[1][1] * height / -seen.z, 1.0, 12.0);
  light = smoothstep(2.0, 5.0, -seen.z) * pow(max(-seen.z, 1.0), -1.2);
}`;
const FRAGMENT = `
varying float light;
void main() {
  gl_FragColor = vec4(vec3(LIGHT, 0.9 * LIGHT, 0.8 * LIGHT) * light, 0.3 * smoothstep(0.5, 0.1, length(gl_PointCoord - 0.5)));
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}`;

export class Water {
  readonly specks: Points<BufferGeometry, ShaderMaterial>;

  /** `light`: the lamp's, at 1 mm. */
  constructor(light: number) {
    let seed = 1;
    const places = Float32Array.from({ length: 3 * SPECKS }, () => (seed = (seed * 16807) % 2147483647) / 2147483647);
    const uniforms = { eye: { value: new Vector3() }, time: { value: 0 }, height: { value: 0 } };
    const material = new ShaderMaterial({
      uniforms, vertexShader: VERTEX, fragmentShader: FRAGMENT, transparent: true, depthWrite: false, defines: { LIGHT: (0.3 * light).toFixed(1) },
    });
    this.specks = new Points(new BufferGeometry().setAttribute("position", new BufferAttribute(places, 3)), material);
    this.specks.frustumCulled = false;
    this.specks.renderOrder = 4;
  }

  /** `time` in s; `height` of the picture in its pixels. */
  move(camera: Camera, time: number, height: number): void {
    const { eye, time: at, height: px } = this.specks.material.uniforms;
    (eye!.value as Vector3).copy(camera.position);
    at!.value = time % 1000;
    px!.value = height;
  }

  dispose(): void {
    this.specks.geometry.dispose();
    this.specks.material.dispose();
  }
}
