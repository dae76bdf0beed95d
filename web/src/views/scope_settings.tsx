// What a trainee chose for the scope, and the dialog that asks. The optic is the trainee's at all stations, the place of
// the station's own poses is that station's.
import { Field, openForm, Select, type Faults, type Values } from "../kit";
import { routeTo, type Route } from "../router";
import type { MapName } from "../scene/colours";
import { USUAL_OPTIC, type Optic } from "../scene/optic";
import { isPort, TOKEN, type ViewAddress } from "../station_view";
import { text } from "../text";

export const POST_STEP_DEG = 15;
const FIELD = { least: 40, most: 150 }; // degrees

/** The optic is the station's, but for what the trainee chose. */
export interface Settings {
  place: ViewAddress | undefined;
  tiltDeg: number | undefined;
  fieldDeg: number | undefined;
  postDeg: number;
}

const KEY = "scope-settings";
const placeKey = (station: string): string => `scope-place ${station}`;
const NOTHING_CHOSEN: Settings = { place: undefined, tiltDeg: undefined, fieldDeg: undefined, postDeg: USUAL_OPTIC.postDeg };

function read<T>(key: string): Partial<T> {
  try {
    return (JSON.parse(localStorage.getItem(key) ?? "{}") as Partial<T> | null) ?? {};
  } catch {
    return {};
  }
}

function kept(station: string): Settings {
  const { port, token = "" } = read<ViewAddress>(placeKey(station));
  return { ...NOTHING_CHOSEN, ...read<Settings>(KEY), place: isPort(port) && TOKEN.test(token) ? { port, token } : undefined };
}

export function keep(station: string, { place, ...chosen }: Settings): void {
  localStorage.setItem(KEY, JSON.stringify(chosen));
  localStorage.setItem(placeKey(station), JSON.stringify(place ?? {}));
}

/** What the address says goes before what was kept; the token does not stay in the address. */
export function settingsOf({ name, args, query }: Route): Settings {
  const station = args[0] ?? "";
  const settings = kept(station);
  const port = Number(query.get("port"));
  const token = query.get("token") ?? "";
  if (isPort(port) && TOKEN.test(token)) {
    settings.place = { port, token };
    keep(station, settings);
    history.replaceState(null, "", routeTo(name, args));
  }
  if (query.has("optic")) settings.tiltDeg = Number(query.get("optic")) || 0;
  return settings;
}

/** The optic as it is seen through, where the station's is `own`. */
export const opticWith = ({ tiltDeg, fieldDeg, postDeg }: Settings, own: Optic): Optic =>
  ({ tiltDeg: tiltDeg ?? own.tiltDeg, fieldDeg: fieldDeg ?? own.fieldDeg, postDeg });

/** What is as the station has it is not chosen. */
export const chosen = (next: Optic, own: Optic, place: ViewAddress | undefined): Settings => ({
  place,
  tiltDeg: next.tiltDeg === own.tiltDeg ? undefined : next.tiltDeg,
  fieldDeg: next.fieldDeg === own.fieldDeg ? undefined : next.fieldDeg,
  postDeg: next.postDeg,
});

// ---- the dialog --------------------------------------------------------------------------------------------

export interface Choice {
  optic: Optic;
  place: ViewAddress | undefined;
  map: MapName | undefined; // undefined: there is nothing to choose
}

function faultsOf({ port = "", token = "" }: Values): Faults {
  const wanted = port.trim() !== "";
  return {
    port: wanted && !isPort(Number(port)) ? text.scope.portWrong : "",
    token: wanted && !TOKEN.test(token.trim()) ? text.scope.tokenWrong : "",
  };
}

function choiceOf({ tilt, angle, post, map, port = "", token = "" }: Values, now: Optic): Choice {
  return {
    optic: {
      tiltDeg: Number(tilt),
      fieldDeg: Math.min(FIELD.most, Math.max(FIELD.least, Number(angle) || now.fieldDeg)),
      postDeg: Number(post) || 0,
    },
    place: port.trim() ? { port: Number(port), token: token.trim() } : undefined,
    map: map as MapName | undefined,
  };
}

export function askSettings({ optic, place, map }: Choice, change: (next: Choice) => void): void {
  const words = text.scope;
  const tilts = [...new Set([0, 30, 70, optic.tiltDeg])].sort((a, b) => a - b);
  openForm(words.settings, text.save, <>
    {map && <Field label={text.session.map}><Select name="map" value={map} options={(["none", "mismatch"] as const).map((name) => [name, text.session.maps[name]])} /></Field>}
    <Field label={words.tilt}><Select name="tilt" value={String(optic.tiltDeg)} options={tilts.map((deg) => [String(deg), words.optic(deg)])} /></Field>
    <Field label={words.field}><input name="angle" type="number" min={FIELD.least} max={FIELD.most} step="any" defaultValue={String(optic.fieldDeg)} /></Field>
    <Field label={words.post} hint={words.postHint}><input name="post" type="number" min={-180} max={180} step={POST_STEP_DEG} defaultValue={String(optic.postDeg)} /></Field>
    <Field label={words.port} hint={words.portHint}><input name="port" inputMode="numeric" autocomplete="off" defaultValue={String(place?.port ?? "")} /></Field>
    <Field label={words.token} hint={words.tokenHint}><input name="token" class="mono" autocomplete="off" spellcheck={false} defaultValue={place?.token ?? ""} /></Field>
  </>, async (values) => change(choiceOf(values, optic)), faultsOf);
}
