// #/wall: all stations at a glance.
import { Watch_What } from "wire";
import type { App, View } from "../app";
import type { Feed, StationState } from "../live";
import { routeTo } from "../router";
import { isTechnical, technicalSwitch } from "../technical";
import { text } from "../text";
import type { IconName } from "../kit/icon";
import { empty, everySecond, fill, h, icon, loading, roving, setClass, setText } from "../ui";
import { trainees } from "./attention";
import { Card } from "./wall_card";
import { arrange, byUrgency, certificateWarning, compareNames, grouped, isAbsent, nameOf, serverQuiet, statusOf, URGENCY_NAMES, warningOf, type Alarm, type Status, type Warning } from "./wall_model";
import { MiniScene } from "./wall_scene";

const RATE_HZ = 10;
const HOUR_MS = 3_600_000;
const SOON_MS = 2000; // by then the server has sent every station

export const wall: View = (root, _route, app) => {
  const page = new Wall(root, app);
  return () => page.close();
};

class Wall {
  private readonly cards = new Map<number, Card>();
  private readonly list = h("ul", { class: "cards", "aria-label": text.wall.stations });
  private readonly grid = h("div", { class: "wall-grid" }, this.list);
  private readonly summary = h("p", { class: "wall-summary number" });
  private readonly absent = absentStations();
  private readonly rail: ReturnType<typeof attentionRail>;
  private readonly state = h("div", { class: "wall-state" });
  private readonly picture: MiniScene;
  private certificate: Warning[] = [];
  private pending = false;
  private frame = 0;
  private readonly ends: (() => void)[];

  constructor(private readonly root: HTMLElement, private readonly app: App) {
    app.title(text.views.wall);
    const technician = app.account?.role === "technician";
    this.rail = attentionRail(app, technician);
    setClass(root, "technical", isTechnical());
    root.append(h("section", { class: "wall-main" },
      h("div", { class: "wall-head" }, h("h1", {}, text.views.wall), this.summary, technicalSwitch(text.wall.technical, (on) => setClass(root, "technical", on))),
      h("div", { class: "wall-area" }, this.grid, this.state), this.absent.element), this.rail.element);
    this.picture = new MiniScene(this.grid);
    roving(this.list, () => [...this.list.querySelectorAll<HTMLElement>(".card a.name")]);
    this.ends = this.listen();
    this.askForCertificate();
    this.draw();
    app.feed.watch({ what: Watch_What.WALL, rateHz: RATE_HZ });
  }

  close(): void {
    for (const end of this.ends) end();
    cancelAnimationFrame(this.frame);
    this.picture.end();
    this.rail.end();
    this.app.feed.unwatch();
  }

  private listen(): (() => void)[] {
    const { feed } = this.app;
    const soon = (): void => this.soon();
    const hourly = setInterval(() => this.askForCertificate(), HOUR_MS);
    const size = new ResizeObserver(() => this.fit());
    size.observe(this.grid);
    const linked = feed.onLink(({ state }) => {
      if (state === "open") this.picture.renewCases();
      soon();
    });
    return [feed.on("place", soon), linked, everySecond(soon), () => clearInterval(hourly), () => size.disconnect()];
  }

  private askForCertificate(): void {
    void this.app.api.get<{ certificate_until_utc_s: number | null }>("/server").then(
      ({ certificate_until_utc_s: until }) => (this.certificate = [certificateWarning(until, Date.now()) ?? []].flat()), () => undefined);
  }

  private draw(): void {
    this.frame = requestAnimationFrame(() => this.draw());
    const { stations } = this.app.feed;
    this.picture.draw([...this.cards].map(([number, card]) => ({ station: stations.get(number), slot: card.scene })));
  }

  private soon(): void {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      if (this.root.isConnected) this.update();
    });
  }

  private update(): void {
    const { feed } = this.app;
    const { cards, summary } = this;
    const now = feed.now();
    const all = ordered(feed);
    const stations = all.filter(({ place }) => !isAbsent(place));
    if (stations.length !== cards.size || stations.some((station) => !cards.has(station.number))) this.layOut(stations);
    const lost = all.length > 0 ? feed.lostMs() : undefined;
    for (const station of stations) cards.get(station.number)!.update(station, now, lost);
    this.absent.show(all.filter(({ place }) => isAbsent(place)).map(nameOf));
    setText(summary, lost !== undefined ? text.wall.lost(lost) : all.length ? text.wall.summary(count(stations)) : "");
    setClass(summary, "fault", lost !== undefined);
    const silent = lost !== undefined ? [serverQuiet(lost)] : [];
    this.rail.trainees(stations);
    this.rail.show(byUrgency([...silent, ...this.certificate, ...all.flatMap((station) => warningOf(station, now, lost !== undefined) ?? [])]), all.length > 0);
    showState(this.state, all.length, stations.length, feed);
  }

  private layOut(stations: StationState[]): void {
    const { cards, list } = this;
    for (const [number, card] of cards) {
      if (stations.some((station) => station.number === number)) continue;
      card.item.remove();
      cards.delete(number);
    }
    stations.forEach((station, at) => {
      let card = cards.get(station.number);
      if (!card) cards.set(station.number, (card = new Card()));
      if (list.children[at] !== card.item) list.insertBefore(card.item, list.children[at] ?? null);
    });
    const links = list.querySelectorAll<HTMLElement>(".card a.name");
    if (links.length && !list.querySelector('a.name[tabindex="0"]')) links.forEach((link, at) => (link.tabIndex = at ? -1 : 0));
    this.fit();
  }

  private fit(): void {
    const layout = arrange(this.cards.size, this.grid.clientWidth, this.grid.clientHeight);
    this.list.dataset.density = layout.density;
    setClass(this.root, "figures-only", layout.density === "small" || layout.density === "tiny");
    this.list.style.setProperty("--columns", String(layout.columns));
  }
}

const ordered = (feed: Feed): StationState[] =>
  [...feed.stations.values()].filter((station) => station.place).sort((a, b) => compareNames(nameOf(a), nameOf(b)));

function count(stations: StationState[]): Record<Status, number> {
  const sum = { running: 0, paused: 0, waiting: 0, closed: 0, gone: 0 };
  for (const station of stations) sum[statusOf(station.place)]++;
  return sum;
}

// What stands where the cards would: waiting, no way to the server, or no stations at all.
function showState(state: HTMLElement, stations: number, present: number, feed: Feed): void {
  state.hidden = present > 0;
  if (stations > 0 || feed.link.state !== "open") delete state.dataset.since;
  else state.dataset.since ??= String(feed.now());
  const none = feed.now() - Number(state.dataset.since ?? Infinity) >= SOON_MS;
  const kind = stations > 0 ? (present > 0 ? "" : "absent") : feed.link.state === "broken" ? "broken" : none ? "none" : "waiting";
  if (state.dataset.kind === kind) return;
  state.dataset.kind = kind;
  const t = text.wall;
  if (kind === "broken") fill(state, empty(t.unreachable, t.unreachableHint));
  else if (kind === "absent") fill(state, empty(t.allAbsent, t.allAbsentHint));
  else if (kind === "none") fill(state, empty(t.none, t.noneHint));
  else if (kind === "waiting") fill(state, loading(t.waiting));
  else fill(state);
}

// ---- beside the cards ---------------------------------------------------------------------------------

// Stations that are not there, in one line.
function absentStations(): { element: HTMLElement; show(names: string[]): void } {
  const names = h("span", { class: "absent-names" });
  const summary = h("summary", {});
  const element = h("details", { class: "absent", hidden: true }, summary, names);
  let shown = "";
  return {
    element,
    show(absent) {
      if (absent.join() === shown) return;
      shown = absent.join();
      element.hidden = !absent.length;
      setText(summary, text.wall.absent(absent.length));
      fill(names, ...absent.map((name) => h("a", { href: routeTo("station", [name]) }, name)));
    },
  };
}

// ---- what needs somebody ----------------------------------------------------------------------------

interface Rail {
  element: HTMLElement;
  trainees(stations: readonly StationState[]): void;
  show(warnings: Warning[], known: boolean): void;
  end(): void;
}

// Trainees first; the equipment is folded, but for what is urgent.
function attentionRail(app: App, technician: boolean): Rail {
  const people = h("div", { class: "attention-people" });
  const rail = trainees(people, app);
  const list = h("ol", { class: "attention-list" });
  const folded = h("summary", {});
  const equipment = h("details", { class: "equipment", open: technician }, folded, list);
  const element = h("aside", { class: "attention", "aria-label": text.wall.attention },
    h("h2", {}, text.wall.attention), h("div", { class: "attention-body" }, people, equipment),
    h("section", { class: "key" }, h("h3", {}, text.wall.key), h("ol", {}, ...text.wall.keys.map((one) => h("li", {}, one)))));
  let shown = "";
  let urgent = new Set<string>();
  // Screen readers announce new urgent alerts.
  const announce = (warnings: Warning[]): void => {
    const words = warnings.filter((warning) => warning.urgency === 3)
      .map(({ station, words }) => (station ? `${station}: ${words}` : `${text.wall.server}: ${text.wall.serverGone}`));
    const fresh = words.filter((one) => !urgent.has(one));
    urgent = new Set(words);
    if (!fresh.length) return;
    equipment.open = true;
    document.getElementById("announcements")!.textContent = fresh.join(". ");
  };
  return {
    element,
    trainees: rail.show,
    end: rail.end,
    show(warnings, known) {
      const key = JSON.stringify([warnings, known]);
      if (key === shown) return;
      shown = key;
      announce(warnings);
      const alarms = grouped(warnings);
      const focused = document.activeElement as HTMLElement | null;
      const station = focused?.dataset.station;
      const words = element.contains(focused) ? focused!.closest("summary")?.parentElement!.dataset.words : undefined;
      const unfolded = new Set([...list.querySelectorAll<HTMLElement>("details[open]")].map((one) => one.dataset.words));
      setText(folded, text.teach.attention.equipment(alarms.length));
      fill(list, ...alarms.map((alarm) => entry(alarm, unfolded.has(alarm.words))), known && alarms.length === 0 && h("li", { class: "all-quiet" }, icon("quiet"), text.wall.allQuiet));
      if (station !== undefined) element.querySelector<HTMLElement>(`[data-station="${CSS.escape(station)}"]`)?.focus();
      if (words !== undefined) element.querySelector<HTMLElement>(`[data-words="${CSS.escape(words)}"] summary`)?.focus();
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
