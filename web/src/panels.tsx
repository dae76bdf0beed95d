// What a session's page says beside the pictures, in tabs: resection, events, remarks, metrics.
import { signal } from "@preact/signals";
import { render, type ComponentChildren } from "preact";
import { useLayoutEffect } from "preact/hooks";
import type { CaseGroup, Metric, Resection } from "wire";
import { lastBefore } from "./axes";
import { groupOf, nameInWords, type Groups } from "./groups";
import type { Change, TimedEvent, TimedMarker, Source } from "./source";
import { resectionsAt } from "./source";
import { Empty, Tabs } from "./kit";
import { format, text } from "./text";

type Tab = keyof typeof text.session.tabs;
const TABS = Object.keys(text.session.tabs) as Tab[];
const QUIET: string[] = ["contact", "release"]; // events that only come on demand
const LIST_MOST = 300;

const TAB_LABELS = TABS.map((tab) => [tab, text.session.tabs[tab]] as const);

let made = 0;

export class Panels {
  readonly element = document.createElement("section");
  readonly id = `panel-${++made}`;
  readonly open = signal<Tab>("resection");
  readonly touches = signal(false);
  readonly drawn = signal(0); // counts up where the open tab is to be drawn again
  events: Listed[] = []; // in the list
  time = 0;
  private shown = ""; // what the resection tab shows
  private eventsKnown = -1; // how many the list is made of

  constructor(readonly source: Source, readonly jump: (time: number) => void,
    readonly metrics: (metrics: readonly Metric[]) => ComponentChildren = (metrics) => <MetricsTable metrics={metrics} groups={source.session?.groups} />) {
    this.element.className = "panels panel";
    render(<View of={this} />, this.element);
  }

  close(): void {
    render(null, this.element);
  }

  changed(change: Change): void {
    const kinds: Partial<Record<Change, Tab[]>> = { session: TABS, resection: ["resection"], remark: ["remarks", "events"], device: ["events"], metrics: ["metrics"] };
    // A record comes faster than a list is made.
    const more = change === (this.source.recorded ? "progress" : "moment") && this.eventsKnown !== this.source.events.length + this.source.markers.length;
    if (kinds[change]?.includes(this.open.peek()) || (more && this.open.peek() === "events")) this.draw();
  }

  showTime(time: number): void {
    this.time = time;
    if (this.open.peek() === "resection" && this.shown !== this.keyOf(this.resections())) this.draw();
    if (this.open.peek() === "events") this.markEvent();
  }

  draw(): void {
    this.drawn.value++;
  }

  resections(): Resection[] {
    return [...resectionsAt(this.source, this.time).values()];
  }

  keyOf(found: readonly Resection[]): string {
    return `${this.source.session?.id.join()} ${found.map(({ group, meshNumber, cuts, cutsRefused }) => [group, meshNumber, cuts, cutsRefused].join()).join(" ")}`;
  }

  /** What is worked on: where nothing is, all. */
  takeResections(): Resection[] {
    const found = this.resections();
    this.shown = this.keyOf(found);
    const worked = found.filter(({ plannedMm3, cuts }) => plannedMm3 > 0 || cuts > 0);
    return worked.length ? worked : found;
  }

  takeEvents(): Listed[] {
    const { source } = this;
    this.eventsKnown = source.events.length + source.markers.length;
    const happened = withBlinks(inBursts(source.events.filter(({ event }) => this.touches.value || !QUIET.includes(event))));
    const events = withMarkers(happened, source.markers);
    return (this.events = source.recorded ? events : events.slice(-LIST_MOST).reverse()); // what happens now is on top
  }

  /** The last one that has happened at the moment that is shown. */
  markEvent(): void {
    if (!this.source.recorded) return;
    const at = lastBefore(this.events.length, (index) => this.events[index]!.time, this.time);
    const items = this.element.querySelectorAll(".event");
    const before = this.element.querySelector(".event[aria-current]");
    if (before === (items[at] ?? null)) return;
    before?.removeAttribute("aria-current");
    items[at]?.setAttribute("aria-current", "true");
    const list = this.element.querySelector(".tab-body")!;
    if (!items[at] || list.contains(document.activeElement)) return;
    const away = items[at]!.getBoundingClientRect().top - list.getBoundingClientRect().top;
    if (away < 0 || away > list.clientHeight - 40) list.scrollTop += away - list.clientHeight / 2;
  }
}

function View({ of }: { of: Panels }) {
  void of.drawn.value;
  const tab = of.open.value;
  return (
    <>
      <Tabs label={text.session.panels} tabs={TAB_LABELS} chosen={tab} panel={of.id} onChoose={(chosen) => (of.open.value = chosen)} />
      <div key={tab} class={`tab-body ${tab}`} role="tabpanel" id={of.id} aria-label={text.session.tabs[tab]} tabIndex={0}>
        {tab === "resection" && <Resections of={of} />}
        {tab === "events" && <Events of={of} />}
        {tab === "remarks" && <Remarks of={of} />}
        {tab === "metrics" && of.metrics(of.source.metrics)}
      </div>
    </>
  );
}

function Resections({ of }: { of: Panels }) {
  const found = of.takeResections();
  if (!found.length) return <Empty title={text.session.noResection} />;
  return <>{found.map((one) => <ResectionFigures key={one.group} of={one} group={groupOf(of.source.session?.groups, one.group)} />)}</>;
}

function Events({ of }: { of: Panels }) {
  void of.drawn.value; // who reads a signal is drawn again by signals alone
  const listed = of.takeEvents();
  useLayoutEffect(() => of.markEvent());
  const told = ({ event, times, blink, words, devices }: Listed): string =>
    words ?? text.session.eventOf(blink ? text.session.blink : text.session.events[event]!, devices) + text.session.times(times);
  return (
    <>
      <label class="switch"><input type="checkbox" checked={of.touches.value} onChange={(event) => (of.touches.value = event.currentTarget.checked)} /><span>{text.session.touches}</span></label>
      {listed.length === 0 ? <Empty title={text.session.noEvents} /> : (
        <ol class="events-list">{listed.map((one) => (
          <li key={`${one.event} ${one.time}`}>
            <button type="button" class="event" data-event={one.event} data-time={String(one.time)} onClick={() => of.jump(one.time)}>
              <time>{of.source.recorded ? format.tenths(one.time) : format.clock(one.time)}</time><span>{told(one)}</span>
            </button>
          </li>))}</ol>)}
    </>
  );
}

function Remarks({ of }: { of: Panels }) {
  const all = [...of.source.remarks].reverse();
  if (!all.length) return <Empty title={text.session.noRemarks} />;
  return (
    <ol class="remarks-list">{all.map(({ number, timeNs, author, text: words, withdrawn }) => {
      const time = Number(timeNs) * 1e-9;
      return (
        <li key={String(number)} class="remark">
          <button type="button" class="event" onClick={() => of.jump(time)}><time>{format.clock(time)}</time><span class="remark-author">{author}</span></button>
          <p>{words || text.session.marker}{withdrawn && <small> ({text.session.withdrawn})</small>}</p>
        </li>);
    })}</ol>
  );
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

type Row = [label: string, value: string, unit?: string, key?: string];

function Figure({ row: [label, value, unit, key] }: { row: Row }) {
  return <div class="figure"><dt>{key && <i class={`swatch ${key}`} aria-hidden="true" />}{label}</dt><dd>{value}{unit && <small> {unit}</small>}</dd></div>;
}

function ResectionFigures({ of: r, group }: { of: Resection; group: CaseGroup }) {
  const words = text.session.resection;
  const planned = r.plannedMm3 > 0;
  const rows: Row[] = [
    ...(planned ? [
      [words.under, mm3(r.underMm3), text.units.mm3, "under"], [words.over, mm3(r.overMm3), text.units.mm3, "over"],
      [words.removed, mm3(r.removedMm3 + r.piecesMm3), text.units.mm3], [words.damage, mm3(r.damageMm3), text.units.mm3],
    ] as Row[] : []),
    ...(group.hasZones ? [[words.rim, format.number(r.rimMm, 1), text.units.mm], [words.step, format.number(r.stepMm, 1), text.units.mm]] as Row[] : []),
    [words.volume, mm3(r.volumeMm3), text.units.mm3], [words.left, mm3(r.leftMm3), text.units.mm3],
    [words.touched, mm3(r.touchedUnseenMm3), text.units.mm3], [words.seen, mm3(r.seenUntouchedMm3), text.units.mm3],
    [words.cuts, format.number(r.cuts)], [words.refused, format.number(r.cutsRefused)], [words.pieces, format.number(r.pieces)],
  ];
  return (
    <section class="resection-group">
      <h2 class="group-name">{group.label}</h2>
      {planned ? <OfThePlan of={r} /> : <Amount value={mm3(r.removedMm3 + r.piecesMm3)} words={words.gone} />}
      <dl class="figures">{rows.map((row) => <Figure key={row[0]} row={row} />)}</dl>
      {group.hasZones && r.wholeZoneMm3.length === 9 && <Zones of={r} />}
    </section>
  );
}

const mm3 = (value: number): string => format.number(value, value < 10 ? 1 : 0);
const percent = (share: number): string => `${100 * share}%`;

const Amount = ({ value, words }: { value: string; words: string }) => <p class="resection-main"><strong>{value}</strong> {words}</p>;

/** What is gone of the plan, and what went beyond it, mm³. Each bar is a share of the plan, 0 to 1, so neither shrinks as the other grows. */
export function planDone({ plannedMm3, underMm3, overMm3 }: Pick<Resection, "plannedMm3" | "underMm3" | "overMm3">) {
  const done = Math.max(0, plannedMm3 - underMm3);
  const share = (volume: number): number => Math.min(1, Math.max(0, volume) / plannedMm3);
  return { done, doneShare: share(done), over: overMm3, overShare: share(overMm3) };
}

function OfThePlan({ of }: { of: Resection }) {
  const words = text.session.resection;
  const { done, doneShare, over, overShare } = planDone(of);
  const bar = (kind: string, share: number) => <div class="plan-bar" aria-hidden="true"><i class={kind} style={{ width: percent(share) }} /></div>;
  return (
    <>
      <Amount value={mm3(done)} words={words.ofPlan(mm3(of.plannedMm3))} />{bar("done", doneShare)}
      <Amount value={mm3(over)} words={words.beyond} />{bar("over", overShare)}
    </>
  );
}

function Zones({ of }: { of: Resection }) {
  const t = text.session;
  return (
    <table class="zones">
      <caption>{t.zones}</caption>
      <thead><tr><td />{t.zoneColumns.map((name) => <th key={name} scope="col">{name}</th>)}</tr></thead>
      <tbody>{t.zoneRows.map((row, i) => <tr key={row}><th scope="row">{row}</th>{t.zoneColumns.map((name, k) => <Zone key={name} of={of} at={3 * i + k} />)}</tr>)}</tbody>
    </table>
  );
}

function Zone({ of, at }: { of: Resection; at: number }) {
  const t = text.session;
  const [whole, removed, budget] = [of.wholeZoneMm3[at]!, of.removedZoneMm3[at] ?? 0, of.budgetZoneMm3[at] ?? 0];
  const over = removed > budget + 0.05;
  const share = (volume: number): string => percent(whole > 0 ? Math.min(1, volume / whole) : 0);
  const title = t.zone(format.number(removed, 1), format.number(whole, 0), format.number(budget, 1));
  return (
    <td class={over ? "zone over" : "zone"} title={over ? `${title}: ${t.overBudget}` : title}>
      <span>{whole > 0 ? format.percent(removed / whole, 0) : format.none}{over && <b aria-label={t.overBudget}> !</b>}</span>
      <span class="zone-track" aria-hidden="true"><i class="zone-bar" style={{ width: share(removed) }} /><i class="zone-budget" style={{ left: share(budget) }} /></span>
    </td>
  );
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

/** A name that these pages do not know is said in words. */
export const metricName = (name: string): string => text.session.metricNames[name] ?? nameInWords(name);

function MetricsTable({ metrics, groups }: { metrics: readonly Metric[]; groups: Groups | undefined }) {
  const t = text.session;
  if (!metrics.length) return <Empty title={t.noMetrics} />;
  return (
    <table class="metrics">
      <thead><tr><th>{t.metric}</th><th>{t.of}</th><th class="number">{t.value}</th></tr></thead>
      <tbody>{metrics.filter(({ value }) => Number.isFinite(value)).map((metric) => (
        <tr key={`${metric.name} ${metric.subject}`}><th scope="row">{metricName(metric.name)}</th><td>{subjectName(metric.subject, groups)}</td><td class="number">{metricValue(metric)}</td></tr>))}</tbody>
    </table>
  );
}
