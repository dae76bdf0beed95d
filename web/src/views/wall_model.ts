// What the wall shows of a station, and in which order: no DOM.
import { SessionState, type DeviceRate, type Place } from "wire";
import { whyOf } from "../explain";
import { QUIET_MS, type StationState } from "../live";
import { format, text } from "../text";

export type Urgency = 0 | 1 | 2 | 3; // none, look, act, now
export const URGENCY_NAMES = ["quiet", "look", "act", "now"] as const;

export type Status = "waiting" | "running" | "paused" | "closed" | "gone"; // gone: no station there

export function statusOf(place: Place | undefined): Status {
  const info = place?.info;
  if (!info || !info.connected) return "gone";
  if (info.state === SessionState.RUNNING) return "running";
  if (info.state === SessionState.PAUSED) return "paused";
  return info.state === SessionState.CLOSED ? "closed" : "waiting";
}

/** Not connected, and no session waits for it: nothing to see. */
export const isAbsent = (place: Place | undefined): boolean => !place?.info?.connected && (place?.info?.state ?? SessionState.CLOSED) === SessionState.CLOSED;

export const nameOf = (station: StationState): string => station.place?.info?.station ?? "";

/** How long its session has run, in seconds; undefined without a session. */
export function runningSeconds(station: StationState, utcMs: number): number | undefined {
  if (station.moment) return Number(station.moment.timeNs) / 1e9;
  const start = station.place?.info?.startUtcNs ?? 0n;
  return start > 0n ? Math.max(0, utcMs / 1000 - Number(start) / 1e9) : undefined;
}

export interface Devices {
  count: number;
  there: number; // that are not lost
  slowestHz: number | undefined; // of those that are not lost
  dropouts: number;
}

export function sumOfDevices(devices: DeviceRate[]): Devices {
  const there = devices.filter((device) => !device.lost);
  return {
    count: devices.length,
    there: there.length,
    slowestHz: there.length ? Math.min(...there.map((device) => device.rateHz)) : undefined,
    dropouts: devices.reduce((sum, device) => sum + device.dropouts, 0),
  };
}

/** A warning of a station: the server's, or that nothing is heard of it any more. */
export interface Warning {
  station: string; // its name; "": of the server itself
  urgency: Urgency;
  words: string;
}

/** How long nothing has come about a station, in ms; undefined while its data is fresh. */
export function quietFor(station: StationState, now: number): number | undefined {
  const age = now - Math.max(station.placeAt, station.momentAt);
  return age >= QUIET_MS ? age : undefined;
}

/** `serverQuiet`: no station has data. One warning for the server replaces those of the stations. */
export function warningOf(state: StationState, now: number, serverQuiet: boolean): Warning | undefined {
  const station = nameOf(state);
  if (!serverQuiet && quietFor(state, now) !== undefined) return { station, urgency: 2, words: text.wall.noData };
  const { place } = state;
  if (!place || !place.urgency) return undefined;
  return { station, urgency: Math.min(3, place.urgency) as Urgency, words: whyOf(place.why, place.warning) };
}

/** That nothing has come for so many ms. */
export const serverQuiet = (ms: number): Warning => ({ station: "", urgency: 3, words: text.wall.serverQuiet(ms) });

const CERTIFICATE_WARNING_DAYS = 30;

/** That the server's certificate ends soon; `until`: seconds since 1970, null where nobody knows. */
export function certificateWarning(until: number | null, nowMs: number): Warning | undefined {
  const days = until === null ? Infinity : Math.floor((until - nowMs / 1000) / 86400);
  return days < CERTIFICATE_WARNING_DAYS ? { station: "", urgency: 1, words: text.wall.certificate(days) } : undefined;
}

/** The most urgent first; of equal ones by the station's name, so that nothing jumps about. */
export function byUrgency(warnings: Warning[]): Warning[] {
  return [...warnings].sort((a, b) => b.urgency - a.urgency || compareNames(a.station, b.station));
}

/** A warning, with all stations that have it. */
export interface Alarm {
  urgency: Urgency;
  words: string;
  stations: string[]; // none: the server itself
}

/** In the order in which the first of each came. */
export function grouped(warnings: readonly Warning[]): Alarm[] {
  const found = new Map<string, Alarm>();
  for (const { urgency, words, station } of warnings) {
    const key = `${urgency} ${words}`;
    const alarm = found.get(key) ?? { urgency, words, stations: [] };
    found.set(key, alarm);
    if (station) alarm.stations.push(station);
  }
  return [...found.values()];
}

/** With as many digits as three figures leave, so that large ones take no more room. */
export function short(value: number | undefined, digits: number): string {
  if (value !== undefined && value >= 9999.5) return `${format.number(value / 1000)}k`;
  return format.number(value, value !== undefined && value >= 99.95 / 10 ** (1 - digits) ? 0 : digits);
}

export const compareNames = (a: string, b: string): number => a.localeCompare(b, "en", { numeric: true });

// ---- how many cards in a row -----------------------------------------------------------------------

export type Density = "large" | "medium" | "small" | "tiny";
export interface Layout {
  density: Density;
  columns: number;
}

const GAP = 8;
const LEAST: [Density, number, number][] = [["large", 300, 280], ["medium", 212, 206], ["small", 148, 146], ["tiny", 132, 110]];

/** The largest cards with which `count` of them fit into width x height px; the smallest where none do. */
export function arrange(count: number, width: number, height: number): Layout {
  for (const [density, leastWidth, leastHeight] of LEAST) {
    const most = atMost(width, leastWidth);
    const rows = atMost(height, leastHeight);
    if (most * rows < count) continue;
    return { density, columns: squarest(count, Math.ceil(count / rows), Math.min(most, count), width, height) };
  }
  return { density: "tiny", columns: atMost(width, LEAST.at(-1)![1]) };
}

const atMost = (room: number, least: number): number => Math.max(1, Math.floor((room + GAP) / (least + GAP)));

// With as many columns cards are nearest to a square.
function squarest(count: number, least: number, most: number, width: number, height: number): number {
  const off = (columns: number): number => Math.abs(Math.log((width / columns) / (height / Math.ceil(count / columns))));
  let best = least;
  for (let columns = least; columns <= most; columns++) if (off(columns) < off(best)) best = columns;
  return Math.max(best, Math.min(2, most));
}
