// Whether an optic's cone holds a point: what the rail knows of what a trainee sees. Nothing hides anything here.
import { cameraInTip, multiply, type Optic, type Rotation, type Vector3 } from "../scene/optic";

interface Pose {
  q: ArrayLike<number>; // w, x, y, z
  t: ArrayLike<number>; // mm
}

function turned([w, x, y, z]: Rotation, [a, b, c]: Vector3): Vector3 {
  const u = 2 * (y * c - z * b), v = 2 * (z * a - x * c), s = 2 * (x * b - y * a);
  return [a + w * u + y * s - z * v, b + w * v + z * u - x * s, c + w * s + x * v - y * u];
}

export function sees(scope: Pose, optic: Optic, tip: Pose): boolean {
  const camera = multiply([scope.q[0]!, scope.q[1]!, scope.q[2]!, scope.q[3]!], cameraInTip(optic));
  const away = turned([camera[0], -camera[1], -camera[2], -camera[3]], [tip.t[0]! - scope.t[0]!, tip.t[1]! - scope.t[1]!, tip.t[2]! - scope.t[2]!]);
  const ahead = -away[2];
  return Math.atan2(Math.hypot(away[0], away[1]), ahead) <= (optic.fieldDeg * Math.PI) / 360;
}
