// What a session's page says beside the pictures, in tabs: resection, events, remarks, metrics.
import type { CaseGroup, Metric, Resection } from "wire";
import { lastBefore } from "./axes";
import { groupOf, nameInWords, type Groups } from "./groups";
import type { Change, TimedEvent, TimedMarker, Source } from "./source";
import { resectionsAt } from "./source";
import { format, text } from "./text";
import { empty, fill, h, setText } from "./ui";

type Tab = keyof typeof text.session.tabs;
const TABS = Object.keys(text.session.tabs) as Tab[];
const QUIET: string[] = ["contact", "release"]; // events that only come on demand
const LIST_MOST = 300;

let made = 0;

export class Panels {
  readonly element: HTMLElement;
  private readonly id = `panel-${++made}`;
  private readonly bodies: Record<Tab, HTMLElement>;
  private readonly tabs: HTMLElement[];
  private open: Tab = "resection";
  private readonly touches = h("input", { type: "checkbox", on: { change: () => {
    this.stale.add("events");
    this.refresh();
  } } });
  private readonly events = h("div", {});
  private shown = ""; // what the resection tab shows
  private stale = new Set<Tab>(TABS);
  private time = 0;

  constructor(private readonly source: Source, private readonly jump: (time: number) => void,
    private readonly metrics: (metrics: readonly Metric[]) => HTMLElement = (metrics) => metricsTable(metrics, source.session?.groups)) {
    this.bodies = Object.fromEntries(TABS.map((tab) =>
      [tab, h("div", { class: `tab-body ${tab}`, role: "tabpanel", id: `${this.id}-${tab}`, "aria-labelledby": `${this.id}-${tab}-tab`, tabindex: 0 })])) as unknown as Record<Tab, HTMLElement>;
    this.tabs = TABS.map((tab) => h("button", { type: "button", class: "tab", role: "tab", id: `${this.id}-${tab}-tab`, "aria-controls": `${this.id}-${tab}`,
      on: { click: () => this.show(tab) } }, text.session.tabs[tab]));
    this.bodies.events.append(h("label", { class: "switch" }, this.touches, h("span", {}, text.session.touches)), this.events);
    const list = h("div", { class: "tabs", role: "tablist", on: { keydown: (event: KeyboardEvent) => this.key(event) } }, ...this.tabs);
    this.element = h("section", { class: "panels panel" }, list, ...TABS.map((tab) => this.bodies[tab]));
    this.show("resection");
  }

  changed(change: Change): void {
    if (change === "session") for (const tab of TABS) this.stale.add(tab);
    if (change === "resection") this.stale.add("resection");
    if (change === "remark") this.stale.add("remarks").add("events");
    if (change === "device") this.stale.add("events");
    if (change === "metrics") this.stale.add("metrics");
    // A record comes faster than a list is made.
    if (change === (this.source.recorded ? "progress" : "moment") && this.eventsShown !== this.eventsKnown) this.stale.add("events");
    this.refresh();
  }
  private eventsShown = -1;
  private get eventsKnown(): number {
    return this.source.events.length + this.source.markers.length;
  }

  showTime(time: number): void {
    this.time = time;
    if (this.open === "resection") this.refreshResection();
    if (this.open === "events") this.markEvent();
  }

  // The last one that has happened at the moment that is shown.
  private markEvent(): void {
    if (!this.source.recorded) return;
    const at = lastBefore(this.eventTimes.length, (index) => this.eventTimes[index]!, this.time);
    const items = this.bodies.events.querySelectorAll(".event");
    const before = this.bodies.events.querySelector("[aria-current]");
    if (before === (items[at] ?? null)) return;
    before?.removeAttribute("aria-current");
    items[at]?.setAttribute("aria-current", "true");
    const list = this.bodies.events;
    if (items[at] && !list.contains(document.activeElement)) {
      const away = items[at]!.getBoundingClientRect().top - list.getBoundingClientRect().top;
      if (away < 0 || away > list.clientHeight - 40) list.scrollTop += away - list.clientHeight / 2;
    }
  }
  private eventTimes: number[] = []; // of those in the list

  show(tab: Tab): void {
    this.open = tab;
    TABS.forEach((name, i) => {
      this.bodies[name].hidden = name !== tab;
      this.tabs[i]!.setAttribute("aria-selected", String(name === tab));
      this.tabs[i]!.tabIndex = name === tab ? 0 : -1;
    });
    this.refresh();
  }

  private key(event: KeyboardEvent): void {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const at = (TABS.indexOf(this.open) + step + TABS.length) % TABS.length;
    this.show(TABS[at]!);
    this.tabs[at]!.focus();
    event.preventDefault();
  }

  private refresh(): void {
    if (!this.stale.has(this.open)) return;
    this.stale.delete(this.open);
    if (this.open === "resection") this.refreshResection();
    if (this.open === "events") this.refreshEvents();
    if (this.open === "remarks") this.refreshRemarks();
    if (this.open === "metrics") fill(this.bodies.metrics, this.metrics(this.source.metrics));
  }

  private refreshResection(): void {
    const found = [...resectionsAt(this.source, this.time).values()];
    const key = `${this.source.session?.id.join()} ${found.map(({ group, meshNumber, cuts, cutsRefused }) => [group, meshNumber, cuts, cutsRefused].join()).join(" ")}`;
    if (key === this.shown) return;
    this.shown = key;
    const worked = found.filter((resection) => resection.plannedMm3 > 0 || resection.cuts > 0);
    fill(this.bodies.resection, ...(found.length ? (worked.length ? worked : found).map((one) => resectionFigures(one, groupOf(this.source.session?.groups, one.group))) : [empty(text.session.noResection)]));
  }

  private refreshEvents(): void {
    this.eventsShown = this.eventsKnown;
    const happened = withBlinks(inBursts(this.source.events.filter(({ event }) => this.touches.checked || !QUIET.includes(event))));
    const events = withMarkers(happened, this.source.markers);
    const listed = this.source.recorded ? events : events.slice(-LIST_MOST).reverse(); // what happens now is on top
    this.eventTimes = listed.map(({ time }) => time);
    const focused = this.events.contains(document.activeElement) ? (document.activeElement as HTMLElement).dataset : undefined;
    fill(this.events, listed.length ? h("ol", { class: "events-list" }, ...listed.map((one) => this.event(one))) : empty(text.session.noEvents));
    if (focused) this.focusEvent(focused);
    this.markEvent();
  }

  // The same event, or the list where that has left it.
  private focusEvent({ event, time }: DOMStringMap): void {
    const place = this.events.querySelector<HTMLElement>(`[data-event="${event}"][data-time="${time}"]`) ?? this.bodies.events;
    place.focus({ preventScroll: true });
  }

  private event({ time, event, times, blink, words, devices }: Listed): HTMLElement {
    const told = words ?? text.session.eventOf(blink ? text.session.blink : text.session.events[event]!, devices) + text.session.times(times);
    return h("li", {}, h("button", { type: "button", class: "event", data: { event, time: String(time) }, on: { click: () => this.jump(time) } },
      h("time", {}, this.source.recorded ? format.tenths(time) : format.clock(time)), h("span", {}, told)));
  }

  private refreshRemarks(): void {
    const all = [...this.source.remarks].reverse();
    fill(this.bodies.remarks, all.length ? h("ol", { class: "remarks-list" }, ...all.map((remark) => {
      const time = Number(remark.timeNs) * 1e-9;
      return h("li", { class: "remark" }, h("button", { type: "button", class: "event", on: { click: () => this.jump(time) } },
        h("time", {}, format.clock(time)), h("span", { class: "remark-author" }, remark.author)),
        h("p", {}, remark.text || text.session.marker, remark.withdrawn && h("small", {}, ` (${text.session.withdrawn})`)));
    })) : empty(text.session.noRemarks));
  }
}

const BURST_S = 1;

/** The same event again and again within a second is one, at the time of the first. */
export function inBursts(events: readonly TimedEvent[]): TimedEvent[] {
  const found: TimedEvent[] = [];
  let last = 0;
  for (const one of events) {
    const burst = found.at(-1);
    if (burst?.event === one.event && one.time - last < BURST_S) found[found.length - 1] = { ...burst, times: burst.times + one.times, ...joined(burst, one) };
    else found.push({ ...one });
    last = one.time;
  }
  return found;
}

const joined = ({ devices: a = [] }: TimedEvent, { devices: b = [] }: TimedEvent): Pick<TimedEvent, "devices"> =>
  (a.length + b.length ? { devices: [...new Set([...a, ...b])] } : {});

export interface Listed extends Omit<TimedEvent, "event"> {
  event: TimedEvent["event"] | "marker";
  blink?: boolean; // lost, and back within a second
  words?: string; // of a marker
}

/** Both by rising time. */
export function withMarkers(events: readonly Listed[], markers: readonly TimedMarker[]): Listed[] {
  const marked = markers.map(({ time, words }): Listed => ({ time, event: "marker", times: 1, words }));
  return [...events, ...marked].sort((a, b) => a.time - b.time);
}

/** As many devices back as were lost within the second before: one line for both. */
export function withBlinks(events: readonly TimedEvent[]): Listed[] {
  const found: Listed[] = [];
  for (const one of events) {
    const before = found.at(-1);
    const blink = one.event === "deviceBack" && before?.event === "deviceLost" && !before.blink && before.times === one.times && one.time - before.time < BURST_S;
    if (blink) found[found.length - 1] = { ...before, blink };
    else found.push(one);
  }
  return found;
}

// ---- resection ---------------------------------------------------------------------------------------

function figure(label: string, value: string, unit: string, key = ""): HTMLElement {
  return h("div", { class: "figure" }, h("dt", {}, key && h("i", { class: `swatch ${key}`, "aria-hidden": "true" }), label), h("dd", {}, value, unit && h("small", {}, ` ${unit}`)));
}

export function resectionFigures(r: Resection, group: CaseGroup): HTMLElement {
  const words = text.session.resection;
  const planned = r.plannedMm3 > 0;
  const ofPlan = planned ? [
    figure(words.under, mm3(r.underMm3), text.units.mm3, "under"), figure(words.over, mm3(r.overMm3), text.units.mm3, "over"),
    figure(words.removed, mm3(r.removedMm3 + r.piecesMm3), text.units.mm3), figure(words.damage, mm3(r.damageMm3), text.units.mm3),
  ] : [];
  return h("section", { class: "resection-group" }, h("h2", { class: "group-name" }, group.label),
    ...(planned ? ofThePlan(r) : [amount(mm3(r.removedMm3 + r.piecesMm3), words.gone)]),
    h("dl", { class: "figures" }, ...ofPlan,
      ...(group.hasZones ? [figure(words.rim, format.number(r.rimMm, 1), text.units.mm), figure(words.step, format.number(r.stepMm, 1), text.units.mm)] : []),
      figure(words.volume, mm3(r.volumeMm3), text.units.mm3), figure(words.left, mm3(r.leftMm3), text.units.mm3),
      figure(words.touched, mm3(r.touchedUnseenMm3), text.units.mm3), figure(words.seen, mm3(r.seenUntouchedMm3), text.units.mm3),
      figure(words.cuts, format.number(r.cuts), ""), figure(words.refused, format.number(r.cutsRefused), ""),
      figure(words.pieces, format.number(r.pieces), "")),
    group.hasZones && r.wholeZoneMm3.length === 9 && zones(r));
}

const mm3 = (value: number): string => format.number(value, value < 10 ? 1 : 0);

function amount(value: string, words: string): HTMLElement {
  return h("p", { class: "resection-main" }, h("strong", {}, value), ` ${words}`);
}

/** What is gone of the plan, and what went beyond it, mm³. Each bar is a share of the plan, 0 to 1, so neither shrinks as the other grows. */
export function planDone({ plannedMm3, underMm3, overMm3 }: Pick<Resection, "plannedMm3" | "underMm3" | "overMm3">) {
  const done = Math.max(0, plannedMm3 - underMm3);
  const share = (volume: number): number => Math.min(1, Math.max(0, volume) / plannedMm3);
  return { done, doneShare: share(done), over: overMm3, overShare: share(overMm3) };
}

function ofThePlan(r: Resection): HTMLElement[] {
  const words = text.session.resection;
  const { done, doneShare, over, overShare } = planDone(r);
  const bar = (kind: string, share: number): HTMLElement => {
    const part = h("i", { class: kind });
    part.style.width = `${100 * share}%`;
    return h("div", { class: "plan-bar", "aria-hidden": "true" }, part);
  };
  return [amount(mm3(done), words.ofPlan(mm3(r.plannedMm3))), bar("done", doneShare), amount(mm3(over), words.beyond), bar("over", overShare)];
}

function zones(r: Resection): HTMLElement {
  const rows = text.session.zoneRows.map((row, i) => h("tr", {}, h("th", { scope: "row" }, row), ...text.session.zoneColumns.map((_, k) => zone(r, 3 * i + k))));
  return h("table", { class: "zones" }, h("caption", {}, text.session.zones),
    h("thead", {}, h("tr", {}, h("td", {}), ...text.session.zoneColumns.map((name) => h("th", { scope: "col" }, name)))), h("tbody", {}, ...rows));
}

function zone(r: Resection, at: number): HTMLElement {
  const [whole, removed, budget] = [r.wholeZoneMm3[at]!, r.removedZoneMm3[at] ?? 0, r.budgetZoneMm3[at] ?? 0];
  const over = removed > budget + 0.05;
  const bar = h("i", { class: "zone-bar" });
  bar.style.width = `${whole > 0 ? Math.min(100, (100 * removed) / whole) : 0}%`;
  const most = h("i", { class: "zone-budget" });
  most.style.left = `${whole > 0 ? Math.min(100, (100 * budget) / whole) : 0}%`;
  const title = text.session.zone(format.number(removed, 1), format.number(whole, 0), format.number(budget, 1));
  return h("td", { class: over ? "zone over" : "zone", title: over ? `${title}: ${text.session.overBudget}` : title },
    h("span", {}, whole > 0 ? format.percent(removed / whole, 0) : format.none, over && h("b", { "aria-label": text.session.overBudget }, " !")),
    h("span", { class: "zone-track", "aria-hidden": "true" }, bar, most));
}

// ---- metrics -----------------------------------------------------------------------------------------

/** A metric's value as a person reads it. */
export function metricValue({ value, unit }: Pick<Metric, "value" | "unit">, withUnit = true): string {
  if (!Number.isFinite(value)) return format.none;
  const digits = unit === "count" ? 0 : Math.abs(value) >= 100 ? 0 : Math.abs(value) >= 10 ? 1 : 2;
  return withUnit ? `${format.number(value, digits)} ${text.session.units[unit] ?? unit}`.trim() : format.number(value, digits);
}

export function subjectName(subject: string, groups: Groups | undefined): string {
  const names = subject.split(/[ ,/]+/).map((word, i) => groups?.find(({ name }) => name === word)?.label ?? (i ? word.replaceAll("_", " ") : nameInWords(word)));
  return names.map((name, i) => (i ? name.toLowerCase() : name)).join(", ");
}

function metricsTable(metrics: readonly Metric[], groups: Groups | undefined): HTMLElement {
  if (!metrics.length) return empty(text.session.noMetrics);
  const rows = metrics.filter(({ value }) => Number.isFinite(value)).map((metric) => {
    const cell = h("td", { class: "number" });
    setText(cell, metricValue(metric));
    return h("tr", {}, h("th", { scope: "row" }, text.session.metricNames[metric.name] ?? metric.name.replaceAll("_", " ")), h("td", {}, subjectName(metric.subject, groups)), cell);
  });
  return h("table", { class: "metrics" }, h("thead", {}, h("tr", {}, h("th", {}, text.session.metric), h("th", {}, text.session.of), h("th", { class: "number" }, text.session.value))),
    h("tbody", {}, ...rows));
}
