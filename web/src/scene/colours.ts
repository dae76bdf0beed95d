// Colour maps that colour-blind eyes can read: cividis (Nuñez, Anderton, Renslow 2018) and viridis for
// amounts, and one from blue over grey to orange for more and less. Each is a table of samples; colours
// between them are linear in sRGB, which differs from the originals by less than the eye sees.
import { text } from "../text";

export type Colour = [r: number, g: number, b: number]; // 0 to 255, sRGB
export type Table = readonly Colour[];

const hex = (colours: string): Table =>
  colours.split(" ").map((c) => [0, 2, 4].map((at) => parseInt(c.slice(at, at + 2), 16)) as Colour);

export const CIVIDIS = hex("00224e 123570 3b496c 575d6d 707173 8a8678 a59c74 c3b369 e1cc55 fee838");
export const VIRIDIS = hex("440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725");
export const LESS_MORE = hex("0b4f8a 2f79b5 6aa5cf a6c8de d9dcdc e6d6c2 e8b27a d98532 b45f06 7f3b00");

/** The colour at a share of the table, 0 to 1; beyond it the ends. */
export function sample(table: Table, share: number, out: Colour): Colour {
  const last = table.length - 1;
  const at = Math.min(Math.max(share, 0), 1) * last;
  const low = Math.min(Math.floor(at), last - 1);
  const a = table[low]!;
  const b = table[low + 1]!;
  for (let k = 0; k < 3; k++) out[k] = a[k]! + (at - low) * (b[k]! - a[k]!);
  return out;
}

export type MapName = "none" | "displacement" | "gain" | "plan" | "contact" | "mismatch";

export interface ColourMap {
  table: Table;
  from: number;
  to: number;
  unit: string;
  ticks: number[];
  marks?: number[]; // values of note, as thresholds
}

export const MAPS: Record<Exclude<MapName, "none">, ColourMap> = {
  displacement: { table: VIRIDIS, from: 0, to: 3, unit: text.units.mm, ticks: [0, 1, 2, 3] },
  gain: { table: LESS_MORE, from: 0.5, to: 1.5, unit: "", ticks: [0.5, 0.75, 1, 1.25, 1.5], marks: [0.88, 1.07] },
  plan: { table: LESS_MORE, from: -2, to: 2, unit: text.units.mm, ticks: [-2, -1, 0, 1, 2] },
  mismatch: { table: LESS_MORE, from: -0.5, to: 0.5, unit: text.units.mm, ticks: [-0.5, 0, 0.5] },
  contact: { table: CIVIDIS, from: 0, to: 1, unit: text.units.mm, ticks: [0, 0.25, 0.5, 0.75, 1] },
};

export function share(map: ColourMap, value: number): number {
  return (value - map.from) / (map.to - map.from);
}

/** A map of displacements up to `most`, with an end whose quarters are round. */
export function scaledTo(map: ColourMap, most: number): ColourMap {
  const rounds = [0.4, 0.8, 1.2, 2, 4, 8, 12, 16, 20, 40, 60];
  const to = rounds.find((round) => round >= most) ?? most;
  return { ...map, to, ticks: [0, to / 4, to / 2, (3 * to) / 4, to] };
}
