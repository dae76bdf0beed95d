// What an arthroscope's optic sees. The tip's frame has z along the shaft, away from the handle; the
// optic looks from the tip, tilted from z towards y (as docs/METRICS.md has it). With a light post
// that is turned, towards where y comes by that turn about z. The camera keeps its roll: it is the
// camera along the shaft with y up, turned the shortest way into the optic's direction.

export type Vector3 = [number, number, number];
export type Rotation = [w: number, x: number, y: number, z: number];

export interface Optic {
  tiltDeg: number; // 0, 30 or 70
  fieldDeg: number; // the whole angle of the cone
  postDeg: number; // how far the light post is turned against the camera
}

export const USUAL_OPTIC: Optic = { tiltDeg: 30, fieldDeg: 90, postDeg: 0 };

const RAD = Math.PI / 180;

export function multiply(a: Rotation, b: Rotation): Rotation {
  return [
    a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
    a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
    a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
  ];
}

// The camera's rotation in the tip's frame, as OpenGL has cameras: x right, y up, looking along -z.
export function cameraInTip(optic: Optic): Rotation {
  const half = (optic.tiltDeg * RAD) / 2;
  const post = optic.postDeg * RAD;
  // About z × direction = (-cos, -sin, 0) where the direction leans towards (-sin, cos) of the plane.
  const tilt: Rotation = [Math.cos(half), -Math.sin(half) * Math.cos(post), -Math.sin(half) * Math.sin(post), 0];
  const along: Rotation = [0, 0, 1, 0]; // half a turn about y: -z of a camera becomes z of the shaft
  return multiply(tilt, along);
}

// Where in the picture the direction of the tilt is: the notch in an arthroscope's mask. Radians from
// the top, clockwise. The picture's right is -x of the tip's frame.
export function notchAngle(optic: Optic): number {
  return optic.postDeg * RAD;
}

// The angle of a camera's picture that the mask's circle is inscribed in.
export function cameraFieldDeg(optic: Optic): number {
  return Math.min(optic.fieldDeg, 150);
}
