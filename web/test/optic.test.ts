// Where a point appears in the scope's picture, beside a formula of its own: angles instead of rotations.
import assert from "node:assert/strict";
import { test } from "node:test";
import { PerspectiveCamera, Quaternion, Vector3 } from "three";
import { cameraFieldDeg, cameraInTip, multiply, notchAngle, type Optic, type Rotation } from "../src/scene/optic";

const RAD = Math.PI / 180;

// As server/step/optic.c has it: the axis of the cone in the tip's frame, here with a turned post.
function axis({ tiltDeg, postDeg }: Optic): Vector3 {
  return new Vector3(0, Math.sin(tiltDeg * RAD), Math.cos(tiltDeg * RAD)).applyAxisAngle(new Vector3(0, 0, 1), postDeg * RAD);
}

// A point seen at an angle from the cone's axis, in a direction of the picture: from its top, clockwise.
function project(point: Vector3, optic: Optic): { x: number; y: number } {
  const forward = axis(optic);
  const angle = point.angleTo(forward);
  // The picture's top is where y of the tip comes as z is brought onto the axis the shortest way.
  const shortest = new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), forward);
  const up = new Vector3(0, 1, 0).applyQuaternion(shortest);
  const right = forward.clone().cross(up);
  const aside = point.clone().addScaledVector(forward, -point.dot(forward));
  const turn = Math.atan2(aside.dot(right), aside.dot(up));
  const radius = Math.tan(angle) / Math.tan((optic.fieldDeg * RAD) / 2);
  return { x: radius * Math.sin(turn), y: radius * Math.cos(turn) };
}

function camera(optic: Optic, scope: Rotation, at: Vector3): PerspectiveCamera {
  const [w, x, y, z] = multiply(scope, cameraInTip(optic));
  const made = new PerspectiveCamera(cameraFieldDeg(optic), 1, 0.1, 200);
  made.position.copy(at);
  made.quaternion.set(x, y, z, w);
  made.updateMatrixWorld();
  made.updateProjectionMatrix();
  return made;
}

const OPTICS: Optic[] = [
  { tiltDeg: 0, fieldDeg: 90, postDeg: 0 },
  { tiltDeg: 30, fieldDeg: 90, postDeg: 0 },
  { tiltDeg: 70, fieldDeg: 75, postDeg: 0 },
  { tiltDeg: 30, fieldDeg: 105, postDeg: 90 },
  { tiltDeg: 70, fieldDeg: 90, postDeg: -135 },
];

test("a point appears where its angles say, for each optic and light post", () => {
  const scope = new Quaternion(0.3, -0.2, 0.5, 0.7).normalize();
  const at = new Vector3(12, -7, 30);
  for (const optic of OPTICS) {
    const made = camera(optic, [scope.w, scope.x, scope.y, scope.z], at);
    for (const [x, y, depth] of [[0, 0, 20], [3, 1, 15], [-8, 4, 25], [5, -9, 12], [0.5, 6, 8]] as const) {
      const forward = axis(optic).multiplyScalar(depth);
      const inTip = forward.add(new Vector3(x, y, 0));
      const seen = inTip.clone().applyQuaternion(scope).add(at).project(made);
      const wanted = project(inTip, optic);
      assert.ok(Math.abs(seen.x - wanted.x) < 1e-6 && Math.abs(seen.y - wanted.y) < 1e-6, JSON.stringify([optic, seen, wanted]));
    }
  }
});

test("what lies on the shaft's axis is opposite to the notch", () => {
  for (const optic of OPTICS.slice(1)) {
    if (optic.tiltDeg * 2 >= optic.fieldDeg + 60) continue;
    const seen = new Vector3(0, 0, 10).project(camera(optic, [1, 0, 0, 0], new Vector3()));
    const notch = notchAngle(optic);
    const across = seen.x * Math.cos(notch) - seen.y * Math.sin(notch);
    const along = seen.x * Math.sin(notch) + seen.y * Math.cos(notch);
    assert.ok(Math.abs(across) < 1e-6 && along < 0, JSON.stringify([optic, seen]));
    assert.ok(Math.abs(-along - Math.tan(optic.tiltDeg * RAD) / Math.tan((optic.fieldDeg * RAD) / 2)) < 1e-6);
  }
});

test("the circle's edge is half of the field from its middle", () => {
  const optic = OPTICS[2]!;
  const edge = axis(optic).applyAxisAngle(new Vector3(1, 0, 0), (optic.fieldDeg / 2) * RAD).multiplyScalar(9);
  const seen = edge.project(camera(optic, [1, 0, 0, 0], new Vector3()));
  assert.ok(Math.abs(Math.hypot(seen.x, seen.y) - 1) < 1e-6);
});
