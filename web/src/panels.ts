// What a session's page says beside the pictures, in tabs: resection, events, remarks, metrics.
import type { Metric, Resection } from "wire";
import { lastBefore } from "./axes";
import type { Change, TimedEvent, Source } from "./source";
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
    private readonly metrics: (metrics: readonly Metric[]) => HTMLElement = metricsTable) {
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
    if (change === "metrics") this.stale.add("metrics");
    // A record comes faster than a list is made.
    if (change === (this.source.recorded ? "progress" : "moment") && this.eventsShown !== this.source.events.length) this.stale.add("events");
    this.refresh();
  }
  private eventsShown = -1;

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
    fill(this.bodies.resection, ...(found.length ? (worked.length ? worked : found).map(resectionFigures) : [empty(text.session.noResection)]));
  }

  private refreshEvents(): void {
    this.eventsShown = this.source.events.length;
    const events = withBlinks(inBursts(this.source.events.filter(({ event }) => this.touches.checked || !QUIET.includes(event))));
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

  private event({ time, event, times, blink }: Listed): HTMLElement {
    return h("li", {}, h("button", { type: "button", class: "event", data: { event, time: String(time) }, on: { click: () => this.jump(time) } },
      h("time", {}, this.source.recorded ? format.tenths(time) : format.clock(time)), h("span", {}, (blink ? text.session.blink : text.session.events[event]!) + text.session.times(times))));
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
    if (burst?.event === one.event && one.time - last < BURST_S) found[found.length - 1] = { ...burst, times: burst.times + one.times };
    else found.push({ ...one });
    last = one.time;
  }
  return found;
}

export interface Listed extends TimedEvent {
  blink?: boolean; // lost, and back within a second
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

export function resectionFigures(r: Resection): HTMLElement {
  const words = text.session.resection;
  const removed = r.removedMm3 + r.piecesMm3;
  const mm3 = (value: number): string => format.number(value, value < 10 ? 1 : 0);
  const head = h("div", { class: "resection-head" }, h("h2", { class: "group-name" }, text.session.groups[r.group] ?? r.group),
    h("p", { class: "resection-main" }, h("strong", {}, mm3(removed)), ` ${text.units.mm3}`, r.plannedMm3 > 0 && h("span", { class: "quiet-text" },
      ` · ${words.share(format.percent((r.plannedMm3 - r.underMm3) / r.plannedMm3, 0))}`)));
  const ofPlan = r.plannedMm3 > 0 ? [
    figure(words.planned, mm3(r.plannedMm3), text.units.mm3), figure(words.under, mm3(r.underMm3), text.units.mm3, "under"),
    figure(words.over, mm3(r.overMm3), text.units.mm3, "over"), figure(words.damage, mm3(r.damageMm3), text.units.mm3),
  ] : [];
  return h("section", { class: "resection-group" }, head, planBar(r),
    h("dl", { class: "figures" }, ...ofPlan,
      figure(words.rim, format.number(r.rimMm, 1), text.units.mm), figure(words.step, format.number(r.stepMm, 1), text.units.mm),
      figure(words.volume, mm3(r.volumeMm3), text.units.mm3), figure(words.left, mm3(r.leftMm3), text.units.mm3),
      figure(words.touched, mm3(r.touchedUnseenMm3), text.units.mm3), figure(words.seen, mm3(r.seenUntouchedMm3), text.units.mm3),
      figure(words.cuts, format.number(r.cuts), ""), figure(words.refused, format.number(r.cutsRefused), ""),
      figure(words.pieces, format.number(r.pieces), "")),
    r.wholeZoneMm3.length === 9 && zones(r));
}

// What was planned and is gone, what is still there, and what went beside it.
function planBar(r: Resection): HTMLElement | false {
  if (!(r.plannedMm3 > 0)) return false;
  const whole = r.plannedMm3 + r.overMm3;
  const part = (kind: string, value: number): HTMLElement => {
    const bar = h("i", { class: kind });
    bar.style.flexGrow = String(Math.max(0, value) / whole);
    return bar;
  };
  return h("div", { class: "plan-bar", "aria-hidden": "true" }, part("done", r.plannedMm3 - r.underMm3), part("under", r.underMm3), part("over", r.overMm3));
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

export function subjectName(subject: string): string {
  const names = subject.split(/[ ,/]+/).map((word) => text.session.groups[word] ?? word.replaceAll("_", " "));
  return names.map((name, i) => (i ? name.toLowerCase() : name)).join(", ");
}

function metricsTable(metrics: readonly Metric[]): HTMLElement {
  if (!metrics.length) return empty(text.session.noMetrics);
  const rows = metrics.filter(({ value }) => Number.isFinite(value)).map((metric) => {
    const cell = h("td", { class: "number" });
    setText(cell, metricValue(metric));
    return h("tr", {}, h("th", { scope: "row" }, text.session.metricNames[metric.name] ?? metric.name.replaceAll("_", " ")), h("td", {}, subjectName(metric.subject)), cell);
  });
  return h("table", { class: "metrics" }, h("thead", {}, h("tr", {}, h("th", {}, text.session.metric), h("th", {}, text.session.of), h("th", { class: "number" }, text.session.value))),
    h("tbody", {}, ...rows));
}
