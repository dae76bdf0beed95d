// Motions of the hands for the mock-up: what arthron-case computes, with a scope that is held still.
import { readFileSync, writeFileSync } from "node:fs";
import { call } from "./programs.mjs";
import { frame } from "./optic.mjs";

const POSE = ["tx_mm", "ty_mm", "tz_mm", "qw", "qx", "qy", "qz", "valid", "opening"];

export const BITES = `[motion]
rate_hz = 100
speed_mm_s = 120
joint_speed_deg_s = 60
tremor_mm = 0.05
seed = 1
[steps]
flex = 20
valgus = 8
approach = punch anterolateral
resect = punch meniscus_medial 6
withdraw = punch
valgus = 0
`;

/** `speed`: of the hand, mm/s. */
export function palpation(source, speed) {
  return readFileSync(`${source}/cases/motions/palpation.ini`, "utf8").replace(/^speed_mm_s.*$/m, `speed_mm_s = ${speed}`)
    .replace(/^rate_hz.*$/m, "rate_hz = 200");
}

export async function motion(folder, name, script, caseDir) {
  writeFileSync(`${folder}/${name}.ini`, script);
  await call("arthron-case", "motion", `${folder}/${name}.ini`, "--case", caseDir, "--out", `${folder}/${name}.csv`);
  const [header, ...rows] = readFileSync(`${folder}/${name}.csv`, "utf8").trimEnd().split("\n");
  return { header: header.split(","), rows: rows.map((row) => row.split(",")) };
}

/** A scope whose tip is at `tip` and whose optic of 30 degrees looks at `target`, from a portal. */
export function scopeAt(tip, portal) {
  const shaft = tip.map((value, i) => value - portal[i]);
  return { t: tip, q: frame(shaft, [0, 0, 1]) };
}

/** Writes rows, 1 / `rateHz` apart, with the scope and the probe's force beside. */
export function write(path, { header, rows }, scope, rateHz, force = 0) {
  const values = [...scope.t, ...scope.q, 1, 0, force].map((value) => value.toFixed(6)).join(",");
  const names = [...header.slice(0, -1), ...POSE.map((name) => `scope_${name}`), "probe_force_n", header.at(-1)];
  const lines = rows.map((row, i) => [(i / rateHz).toFixed(6), ...row.slice(1, -1), values, row.at(-1)].join(","));
  writeFileSync(path, `${[names.join(","), ...lines].join("\n")}\n`);
}

/** The probe strokes the tibia, there and back. */
export function stroke({ header, rows }) {
  const first = rows.findIndex((row) => row.at(-1) === "tibia");
  const there = rows.slice(first, first + 240);
  return { header, rows: [...there, ...[...there].reverse()] };
}

/** One moment of that. */
export function stand({ header, rows }) {
  const touching = rows.filter((row) => row.at(-1) === "tibia");
  return { header, rows: Array(200).fill(touching[Math.floor(touching.length / 6)]) };
}

/**
 * The hands of a file at `from` with a probe that moves a cursor, in a file at `to`: into the left lower corner, where it
 * must not matter how long it is, then to each of `places` (px to the right of there and up), where it stays for `stay_s`.
 */
export function pointing(from, to, places, pxPerMm, stay_s) {
  const [header, first] = readFileSync(from, "utf8").split("\n").map((line) => line.split(","));
  const [x, z] = ["probe_tx_mm", "probe_tz_mm"].map((name) => header.indexOf(name));
  const [RATE_HZ, SPEED_MM_S, FAR_MM, FOUND_S] = [100, 150, 300, 8]; // by then the station has found the mock-up again
  const corner = { x: Number(first[x]) + FAR_MM, z: Number(first[z]) - FAR_MM };
  let at = { x: Number(first[x]), z: Number(first[z]) };
  const moments = Array(FOUND_S * RATE_HZ).fill(at);
  const go = (there, stay) => {
    const steps = Math.max(1, Math.ceil((Math.hypot(there.x - at.x, there.z - at.z) / SPEED_MM_S) * RATE_HZ));
    for (let i = 1; i <= steps; i++) moments.push({ x: at.x + ((there.x - at.x) * i) / steps, z: at.z + ((there.z - at.z) * i) / steps });
    moments.push(...Array(Math.round(stay * RATE_HZ)).fill(there));
    at = there;
  };
  go(corner, 0);
  for (const [right, up] of places) go({ x: corner.x - right / pxPerMm, z: corner.z + up / pxPerMm }, stay_s);
  const lines = moments.map((of, i) => first.map((value, column) => (column === 0 ? i / RATE_HZ : column === x ? of.x : column === z ? of.z : value)).join(","));
  writeFileSync(to, `${[header.join(","), ...lines].join("\n")}\n`);
}

/** Its first moment: the hands are outside. */
export function rest({ header, rows }) {
  return { header, rows: Array(200).fill(rows[0]) };
}
