// #/wall: all stations at a glance.
import { Watch_What } from "wire";
import type { View } from "../app";
import type { Feed, StationState } from "../live";
import { routeTo } from "../router";
import { format, text } from "../text";
import { empty, everySecond, fill, h, icon, loading, roving, setClass, setText, type IconName } from "../ui";
import { MiniScene } from "./wall_scene";
import {
  arrange, byUrgency, certificateWarning, compareNames, grouped, quietFor, runningSeconds, serverQuiet, short, statusOf, stationOf, sumOfDevices, URGENCY_NAMES, warningOf,
  type Alarm, type Status, type Warning,
} from "./wall_model";

const RATE_HZ = 10;
const HOUR_MS = 3_600_000;
const SOON_MS = 2000; // by then the server has sent every station

interface Card {
  item: HTMLElement;
  scene: HTMLElement; // where the picture goes
  update(seat: StationState, now: number, lostMs: number | undefined): void;
}

export const wall: View = (root, _route, app) => {
  app.title(text.views.wall);
  const { feed } = app;
  const cards = new Map<number, Card>();
  const list = h("ul", { class: "cards", "aria-label": text.wall.stations });
  const grid = h("div", { class: "wall-grid" }, list);
  const summary = h("p", { class: "wall-summary number" });
  const rail = attentionRail();
  const state = h("div", { class: "wall-state" });
  root.append(h("section", { class: "wall-main" },
    h("div", { class: "wall-head" }, h("h1", {}, text.views.wall), summary), h("div", { class: "wall-area" }, grid, state)), rail.element);
  const picture = new MiniScene(grid);
  roving(list, () => [...list.querySelectorAll<HTMLElement>(".card a.name")]);

  const ordered = (): StationState[] => [...feed.stations.values()].filter((seat) => seat.place).sort((a, b) => compareNames(stationOf(a), stationOf(b)));

  const layOut = (): void => {
    const stations = ordered();
    for (const [seat, card] of cards) {
      if (feed.stations.has(seat)) continue;
      card.item.remove();
      cards.delete(seat);
    }
    stations.forEach((seat, at) => {
      let card = cards.get(seat.seat);
      if (!card) cards.set(seat.seat, (card = makeCard()));
      if (list.children[at] !== card.item) list.insertBefore(card.item, list.children[at] ?? null);
    });
    const links = list.querySelectorAll<HTMLElement>(".card a.name");
    if (links.length && !list.querySelector('a.name[tabindex="0"]')) links.forEach((link, at) => (link.tabIndex = at ? -1 : 0));
    fit();
  };

  const fit = (): void => {
    const layout = arrange(cards.size, grid.clientWidth, grid.clientHeight);
    list.dataset.density = layout.density;
    setClass(root, "figures-only", layout.density === "small" || layout.density === "tiny");
    list.style.setProperty("--columns", String(layout.columns));
  };

  const update = (): void => {
    const now = feed.now();
    const stations = ordered();
    if (stations.length !== cards.size || stations.some((seat) => !cards.has(seat.seat))) layOut();
    const lost = stations.length > 0 ? feed.lostMs() : undefined;
    for (const seat of stations) cards.get(seat.seat)!.update(seat, now, lost);
    setText(summary, lost !== undefined ? text.wall.lost(lost) : stations.length ? text.wall.summary(count(stations)) : "");
    setClass(summary, "fault", lost !== undefined);
    rail.show(byUrgency([...(lost !== undefined ? [serverQuiet(lost)] : []), ...certificate, ...stations.flatMap((seat) => warningOf(seat, now, lost !== undefined) ?? [])]), stations.length > 0);
    showState(state, stations.length, feed);
  };

  let certificate: Warning[] = [];
  const askForCertificate = (): void => void app.api.get<{ certificate_until_utc_s: number | null }>("/server").then(
    ({ certificate_until_utc_s: until }) => (certificate = [certificateWarning(until, Date.now()) ?? []].flat()), () => undefined);
  const hourly = setInterval(askForCertificate, HOUR_MS);
  askForCertificate();

  let pending = false;
  const soon = (): void => {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => {
      pending = false;
      if (root.isConnected) update();
    });
  };
  const size = new ResizeObserver(fit);
  size.observe(grid);
  let frame = requestAnimationFrame(function draw() {
    frame = requestAnimationFrame(draw);
    picture.draw([...cards].map(([seat, card]) => ({ seat: feed.stations.get(seat), slot: card.scene })));
  });
  const linked = feed.onLink(({ state }) => {
    if (state === "open") picture.renewCases();
    soon();
  });
  const ends = [feed.on("place", soon), linked, everySecond(soon), () => clearInterval(hourly), () => size.disconnect(), () => cancelAnimationFrame(frame), () => picture.end()];
  feed.watch({ what: Watch_What.WALL, rateHz: RATE_HZ });
  return () => {
    for (const end of ends) end();
    feed.unwatch();
  };
};

function count(stations: StationState[]): Record<Status, number> {
  const sum = { running: 0, paused: 0, waiting: 0, closed: 0, gone: 0 };
  for (const seat of stations) sum[statusOf(seat.place)]++;
  return sum;
}

// What stands where the cards would: waiting, no way to the server, or no stations at all.
function showState(state: HTMLElement, stations: number, feed: Feed): void {
  state.hidden = stations > 0;
  if (stations > 0 || feed.link.state !== "open") delete state.dataset.since;
  else state.dataset.since ??= String(feed.now());
  const none = feed.now() - Number(state.dataset.since ?? Infinity) >= SOON_MS;
  const kind = stations > 0 ? "" : feed.link.state === "broken" ? "broken" : none ? "none" : "waiting";
  if (state.dataset.kind === kind) return;
  state.dataset.kind = kind;
  const t = text.wall;
  if (kind === "broken") fill(state, empty(t.unreachable, t.unreachableHint));
  else if (kind === "none") fill(state, empty(t.none, t.noneHint));
  else if (kind === "waiting") fill(state, loading(t.waiting));
  else fill(state);
}

// ---- a card -----------------------------------------------------------------------------------------

interface Value {
  element: HTMLElement;
  set(value: string, unit?: string): void;
}

function value(label: string, title: string, kind = ""): Value {
  const figure = h("span", { class: "figure" });
  const unit = h("span", { class: kind.includes("counted") ? "unit word" : "unit" });
  const element = h("div", { class: `value ${kind}`, title }, h("dt", {}, label), h("dd", {}, figure, unit));
  return {
    element,
    set(words, of = "") {
      setText(figure, words);
      setText(unit, words === format.none ? "" : of);
    },
  };
}

function makeCard(): Card {
  const t = text.wall;
  const sign = h("span", { class: "sign" });
  const link = h("a", { class: "name", tabindex: -1 }); // its area is the whole card
  const time = h("span", { class: "time number" });
  const scene = h("div", { class: "mini" });
  const age = h("span", { class: "age" });
  const who = h("span", { class: "who" });
  const what = h("span", { class: "what" });
  const values = {
    roundTrip: value(t.roundTrip, t.titles.roundTrip), loss: value(t.loss, t.titles.loss), clock: value(t.clock, t.titles.clock, "tight"),
    rate: value(t.rate, t.titles.rate), dropouts: value(t.dropouts, t.titles.dropouts, "counted"), devices: value(t.devices, t.titles.devices),
    cuts: value(t.cuts, t.titles.cuts, "over counted"), removed: value(t.removed, t.titles.removed, "removed"),
    displacement: value(t.displacement, t.titles.displacement, "over second"),
  };
  const warning = h("span", { class: "warning" });
  const card = h("article", { class: "card" },
    h("div", { class: "card-head" }, sign, link, time),
    h("div", { class: "card-scene" }, scene, age),
    h("div", { class: "card-who" }, who, what),
    h("dl", { class: "values" }, ...Object.values(values).map((one) => one.element)),
    warning);
  card.addEventListener("click", (event) => event.target !== link && link.click());
  const item = h("li", {}, card);

  const update = (seat: StationState, now: number, lostMs: number | undefined): void => {
    const place = seat.place!;
    const info = place.info;
    const kind = statusOf(place);
    const quiet = lostMs ?? quietFor(seat, now);
    const warned = warningOf(seat, now, lostMs !== undefined);
    link.href = routeTo("station", [stationOf(seat)]);
    card.dataset.status = kind;
    card.dataset.urgency = URGENCY_NAMES[warned?.urgency ?? 0];
    setClass(card, "old", quiet !== undefined);
    setSign(sign, quiet !== undefined ? "gone" : kind, quiet !== undefined ? t.noData : t.statuses[kind]);
    setText(link, stationOf(seat));
    const seconds = runningSeconds(seat, Date.now());
    setText(time, kind === "gone" || seconds === undefined ? "" : format.clock(seconds));
    setText(age, quiet !== undefined ? t.oldFor(quiet) : kind === "gone" ? t.statuses.gone : "");
    setText(who, place.trainee || t.nobody);
    setClass(who, "quiet-text", !place.trainee);
    setText(what, info?.caseName ?? "");
    const devices = sumOfDevices(place.devices);
    const there = kind !== "gone";
    values.roundTrip.set(there ? short((info?.rttP50Us ?? NaN) / 1000, 1) : format.none, text.units.ms);
    values.loss.set(there ? short(place.lossShare * 100, 1) : format.none, text.units.percent);
    values.clock.set(there ? `±${short((info?.clockUncertaintyUs ?? NaN) / 1000, 1)}` : format.none, text.units.ms);
    values.rate.set(there ? short(devices.slowestHz, 0) : format.none, text.units.hertz);
    values.dropouts.set(there ? short(devices.dropouts, 0) : format.none, t.dropoutsUnit);
    values.devices.set(there ? `${devices.there}/${devices.count}` : format.none);
    setClass(values.devices.element, "bad", there && devices.there < devices.count);
    values.cuts.set(short(place.cuts, 0), t.cutsUnit(place.cuts));
    values.removed.set(format.number(place.removedMm3), text.units.mm3);
    values.displacement.set(there ? format.number(place.warpMm, 1) : format.none, text.units.mm);
    showWarning(warning, warned);
  };
  return { item, scene, update };
}

function setSign(sign: HTMLElement, kind: ReturnType<typeof statusOf>, words: string): void {
  if (sign.dataset.kind === kind && sign.textContent === words) return;
  sign.dataset.kind = kind;
  fill(sign, icon(kind), h("span", { class: "unseen" }, words));
}

function showWarning(element: HTMLElement, warning: Warning | undefined): void {
  const key = warning ? `${warning.urgency} ${warning.words}` : "";
  if (element.dataset.key === key) return;
  element.dataset.key = key;
  if (!warning) fill(element);
  else fill(element, icon(URGENCY_NAMES[warning.urgency] as IconName), h("b", {}, text.wall.urgencies[warning.urgency]), h("span", { class: "words" }, warning.words));
}

// ---- what needs somebody ----------------------------------------------------------------------------

function attentionRail(): { element: HTMLElement; show(warnings: Warning[], known: boolean): void } {
  const list = h("ol", { class: "attention-list" });
  const total = h("span", { class: "badge number" });
  const element = h("aside", { class: "attention", "aria-label": text.wall.attention },
    h("h2", {}, text.wall.attention, total), list,
    h("section", { class: "key" }, h("h3", {}, text.wall.key), h("ol", {}, ...text.wall.keys.map((one) => h("li", {}, one)))));
  let shown = "";
  let urgent = new Set<string>();
  // Screen readers announce new urgent alerts.
  const announce = (warnings: Warning[]): void => {
    const words = warnings.filter((warning) => warning.urgency === 3)
      .map(({ station, words }) => (station ? `${station}: ${words}` : `${text.wall.server}: ${text.wall.serverGone}`));
    const fresh = words.filter((one) => !urgent.has(one));
    urgent = new Set(words);
    if (fresh.length) document.getElementById("announcements")!.textContent = fresh.join(". ");
  };
  return {
    element,
    show(warnings, known) {
      const key = JSON.stringify([warnings, known]);
      if (key === shown) return;
      shown = key;
      announce(warnings);
      const alarms = grouped(warnings);
      setText(total, String(alarms.length));
      const focused = document.activeElement as HTMLElement | null;
      const station = focused?.dataset.station;
      const words = list.contains(focused) ? focused!.closest("summary")?.parentElement!.dataset.words : undefined;
      const unfolded = new Set([...list.querySelectorAll<HTMLElement>("details[open]")].map((one) => one.dataset.words));
      fill(list, ...alarms.map((alarm) => entry(alarm, unfolded.has(alarm.words))), known && warnings.length === 0 && h("li", { class: "all-quiet" }, icon("quiet"), text.wall.allQuiet));
      if (station !== undefined) list.querySelector<HTMLElement>(`[data-station="${CSS.escape(station)}"]`)?.focus();
      if (words !== undefined) list.querySelector<HTMLElement>(`[data-words="${CSS.escape(words)}"] summary`)?.focus();
    },
  };
}

const LISTED = 8; // stations of one warning; more are folded

function entry({ urgency, words, stations }: Alarm, unfolded: boolean): HTMLElement {
  const kind = URGENCY_NAMES[urgency];
  const name = stations.length > 1 ? text.wall.several(stations.length) : (stations[0] ?? text.wall.server);
  const parts = [icon(kind as IconName), h("span", { class: "alarm-head" }, h("b", {}, name), h("span", {}, text.wall.urgencies[urgency])),
    h("span", { class: "alarm-words" }, words)];
  const to = (station: string): { href: string; data: Record<string, string> } => ({ href: routeTo("station", [station]), data: { station } });
  if (stations.length === 1) return h("li", {}, h("a", { class: `alarm ${kind}`, ...to(stations[0]!) }, ...parts));
  const links = stations.length > 1 && h("span", { class: "alarm-stations" }, ...stations.map((station) => h("a", to(station), station)));
  const folded = links && stations.length > LISTED ? h("details", { open: unfolded, data: { words } }, h("summary", {}, text.wall.which), links) : links;
  return h("li", { class: `alarm ${kind}` }, ...parts, folded);
}
