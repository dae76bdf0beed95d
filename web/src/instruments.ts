// The instruments of a session, by their place from 0: the usual five, and what its station describes.
import { create } from "@bufbuild/protobuf";
import { Instrument_Kind, InstrumentSchema, type Instrument } from "wire";
import { nameInWords } from "./groups";

export const FIRST_INSTRUMENT = 4; // its channel
export const INSTRUMENTS = 8; // that there may be

export type Instruments = readonly Instrument[];

type Sizes = Partial<Pick<Instrument, "cuts" | "button" | "lengthMm" | "widthMm" | "thicknessMm" | "openingDeg">>;

const USUAL_KINDS: [name: string, kind: Instrument_Kind, sizes?: Sizes][] = [
  ["probe", Instrument_Kind.TIP],
  ["punch", Instrument_Kind.JAW, { cuts: true, lengthMm: 6, widthMm: 3.5, openingDeg: 35 }],
  ["shaver", Instrument_Kind.BURR, { cuts: true, button: 0, widthMm: 4 }],
  ["knife", Instrument_Kind.BLADE, { cuts: true, lengthMm: 3.5, widthMm: 2.5, thicknessMm: 0.2 }],
  ["scope", Instrument_Kind.OPTIC],
];

/** Of a session that tells none, as one of an older server. */
export const USUAL: Instruments = USUAL_KINDS.map(([name, kind, sizes], i) =>
  create(InstrumentSchema, { channel: FIRST_INSTRUMENT + i, name, kind, ...sizes }));

const COLOURS = [0x0072b2, 0xe69f00, 0x009e73, 0xcc79a7, 0x7a8794, 0xd55e00, 0x56b4e9, 0xf0e442]; // Okabe and Ito

/** By their places; a place that is not told has the usual one, or nothing. */
export function instrumentsOf(told: readonly Instrument[] | undefined): Instruments {
  const all = [...USUAL];
  for (const one of told ?? []) {
    const place = one.channel - FIRST_INSTRUMENT;
    if (place >= 0 && place < INSTRUMENTS && place <= all.length) all[place] = one;
  }
  return all;
}

export function nameOf(instrument: Instrument | undefined): string | undefined {
  if (!instrument) return undefined;
  return nameInWords(instrument.name);
}

export function colourOf(instrument: Instrument, place: number): number {
  return instrument.colour ?? COLOURS[place % COLOURS.length]!;
}

export function isOptic(instrument: Instrument | undefined): boolean {
  return instrument?.kind === Instrument_Kind.OPTIC;
}

/** Whether its burr turns. */
export function runs(instrument: Instrument | undefined, buttons: number): boolean {
  return instrument?.kind === Instrument_Kind.BURR && ((buttons >>> (instrument.button ?? 0)) & 1) === 1;
}
