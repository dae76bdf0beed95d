// Where an arthroscope shows a point, from the definition of its optic (docs/METRICS.md) alone: the tip's
// frame has z along the shaft, away from the handle; the optic looks along z turned by its angle towards
// y, and with a light post turned by p, towards y turned by p about z. Along the shaft the picture's up
// is y; turning z into the direction of sight takes it along.

const RAD = Math.PI / 180;
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** v turned about a unit axis (Rodrigues). */
function turned(v, axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const side = cross(axis, v);
  const along = dot(axis, v) * (1 - c);
  return v.map((value, i) => value * c + side[i] * s + axis[i] * along);
}

/** The rows of the rotation of a quaternion. */
function rows([w, x, y, z]) {
  const n = 2 / (w * w + x * x + y * y + z * z);
  return [
    [1 - n * (y * y + z * z), n * (x * y - w * z), n * (x * z + w * y)],
    [n * (x * y + w * z), 1 - n * (x * x + z * z), n * (y * z - w * x)],
    [n * (x * z - w * y), n * (y * z + w * x), 1 - n * (x * x + y * y)],
  ];
}

/** [right, up, depth] of a point as the optic sees it, mm. */
export function seenFrom(point, tip, { tiltDeg, postDeg }) {
  const away = point.map((value, i) => value - tip.t[i]);
  const turn = rows(tip.q);
  const inTip = [0, 1, 2].map((k) => turn[0][k] * away[0] + turn[1][k] * away[1] + turn[2][k] * away[2]); // the transpose
  const lean = turned([0, 1, 0], [0, 0, 1], postDeg * RAD);
  const axis = cross([0, 0, 1], lean);
  return [[-1, 0, 0], [0, 1, 0], [0, 0, 1]].map((v) => dot(inTip, turned(v, axis, tiltDeg * RAD)));
}

/** Place in the picture, from its middle, in halves of its side: right and up; undefined: behind. */
export function project(point, tip, optic) {
  const [right, up, depth] = seenFrom(point, tip, optic);
  const scale = 1 / (depth * Math.tan((optic.fieldDeg * RAD) / 2));
  return depth > 0 ? { right: right * scale, up: up * scale } : undefined;
}

/** A quaternion [w, x, y, z] whose z axis is `z` and whose y axis is as near to `y` as can be. */
export function frame(z, y) {
  const unit = (v) => v.map((value) => value / Math.hypot(...v));
  const k = unit(z);
  const i = unit(cross(y, k));
  const j = cross(k, i);
  const [m00, m11, m22] = [i[0], j[1], k[2]];
  const w = Math.sqrt(Math.max(0, 1 + m00 + m11 + m22)) / 2;
  const x = Math.sqrt(Math.max(0, 1 + m00 - m11 - m22)) / 2;
  return [w, x * Math.sign(j[2] - k[1] || 1), (Math.sqrt(Math.max(0, 1 - m00 + m11 - m22)) / 2) * Math.sign(k[0] - i[2] || 1),
    (Math.sqrt(Math.max(0, 1 - m00 - m11 + m22)) / 2) * Math.sign(i[1] - j[0] || 1)];
}
