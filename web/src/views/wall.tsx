// #/wall: all stations at a glance.
import { useSignal } from "@preact/signals";
import { useEffect, useLayoutEffect, useRef } from "preact/hooks";
import { Watch_What } from "wire";
import type { App, View } from "../app";
import { announce, Empty, Icon, Loading, useEverySecond, useWatch, view, walk, type IconName } from "../kit";
import type { Feed, StationState } from "../live";
import { routeTo } from "../router";
import { isTechnical, TechnicalSwitch } from "../technical";
import { text } from "../text";
import { trainees, type Trainees } from "./attention";
import { Card } from "./wall_card";
import { arrange, byUrgency, certificateWarning, compareNames, grouped, isAbsent, nameOf, serverQuiet, statusOf, URGENCY_NAMES, warningOf, type Alarm, type Status, type Warning } from "./wall_model";
import { MiniScene, type Pictures } from "./wall_scene";

const RATE_HZ = 10;
const HOUR_MS = 3_600_000;
const SOON_MS = 2000; // by then the server has sent every station

export const wall: View = view(({ app }) => {
  const { feed } = app;
  const scenes = useRef(new Map<number, HTMLElement>());
  const pictures = useRef<Pictures>(new Map());
  const certificate = useSignal<Warning[]>([]);
  const openSince = useRef<number | undefined>(undefined); // without a station
  useEffect(() => app.title(text.views.wall), []);
  useWatch(feed, "wall", () => ({ what: Watch_What.WALL, rateHz: RATE_HZ }));
  useTicks(feed);
  useHourly(() => void app.api.get<{ certificate_until_utc_s: number | null }>("/server").then(
    ({ certificate_until_utc_s: until }) => (certificate.value = [certificateWarning(until, Date.now()) ?? []].flat()), () => undefined));
  const now = feed.now();
  const all = [...feed.stations.values()].filter(({ place }) => place).sort((a, b) => compareNames(nameOf(a), nameOf(b)));
  const present = all.filter(({ place }) => !isAbsent(place));
  const lost = all.length > 0 ? feed.lostMs() : undefined;
  if (all.length > 0 || feed.link.state !== "open") openSince.current = undefined;
  else openSince.current ??= now;
  const silent = lost !== undefined ? [serverQuiet(lost)] : [];
  const warnings = byUrgency([...silent, ...certificate.value, ...all.flatMap((station) => warningOf(station, now, lost !== undefined) ?? [])]);
  const grid = useGrid(feed, scenes.current, pictures.current);
  const layout = arrange(present.length, grid.width, grid.height);
  const small = layout.density === "small" || layout.density === "tiny";
  return (
    <div class={`wall-page ${isTechnical() ? "technical" : ""} ${small ? "figures-only" : ""}`}>
      <section class="wall-main">
        <div class="wall-head">
          <h1>{text.views.wall}</h1>
          <p class={`wall-summary number ${lost !== undefined ? "fault" : ""}`}>{lost !== undefined ? text.wall.lost(lost) : all.length ? text.wall.summary(count(present)) : ""}</p>
          <TechnicalSwitch label={text.wall.technical} />
        </div>
        <div class="wall-area">
          <div class="wall-grid" ref={grid.element}><Cards stations={present} now={now} lost={lost} density={layout.density} columns={layout.columns} scenes={scenes.current} /></div>
          <div class="wall-state" hidden={present.length > 0}>
            <Instead known={all.length > 0} feed={feed} waited={openSince.current !== undefined && now - openSince.current >= SOON_MS} />
          </div>
        </div>
        <Absent names={all.filter(({ place }) => isAbsent(place)).map(nameOf)} />
      </section>
      <Attention app={app} pictures={pictures.current} stations={present} warnings={warnings} known={all.length > 0} />
    </div>
  );
});

// Drawn again where a place came, the link changed, or a second passed; once for all until the next frame.
function useTicks(feed: Feed): void {
  const tick = useSignal(0);
  void tick.value; // what draws the view again
  useEffect(() => {
    let pending = 0;
    const soon = (): void => {
      pending ||= requestAnimationFrame(() => {
        pending = 0;
        tick.value++;
      });
    };
    const ends = [feed.on("place", soon), feed.onLink(soon), () => cancelAnimationFrame(pending)];
    return () => ends.forEach((end) => end());
  }, []);
  useEverySecond(() => tick.value++);
}

function useHourly(what: () => void): void {
  useEffect(() => {
    what();
    const timer = setInterval(what, HOUR_MS);
    return () => clearInterval(timer);
  }, []);
}

// The pictures over the cards, and the room that cards have.
function useGrid(feed: Feed, scenes: Map<number, HTMLElement>, pictures: Pictures) {
  const element = useRef<HTMLDivElement>(null);
  const size = useSignal({ width: 0, height: 0 });
  useLayoutEffect(() => {
    const place = element.current!;
    const picture = new MiniScene(place);
    let frame = 0;
    const draw = (): void => {
      frame = requestAnimationFrame(draw);
      const byName = new Map([...feed.stations.values()].map((station) => [nameOf(station), station]));
      picture.draw([...scenes].map(([number, slot]) => ({ station: feed.stations.get(number), slot })),
        [...pictures].map(([canvas, name]) => ({ canvas, station: byName.get(name) })));
    };
    draw();
    const resize = new ResizeObserver(() => (size.value = { width: place.clientWidth, height: place.clientHeight }));
    resize.observe(place);
    const endLink = feed.onLink(({ state }) => state === "open" && picture.renewCases());
    return () => {
      cancelAnimationFrame(frame);
      resize.disconnect();
      endLink();
      picture.end();
    };
  }, []);
  return { element, ...size.value };
}

function count(stations: readonly StationState[]): Record<Status, number> {
  const sum = { running: 0, paused: 0, waiting: 0, closed: 0, gone: 0 };
  for (const station of stations) sum[statusOf(station.place)]++;
  return sum;
}

interface CardsProps {
  stations: readonly StationState[];
  now: number;
  lost: number | undefined;
  density: string;
  columns: number;
  scenes: Map<number, HTMLElement>;
}

function Cards({ stations, now, lost, density, columns, scenes }: CardsProps) {
  const focused = useSignal<number | undefined>(undefined);
  const stop = stations.some(({ number }) => number === focused.value) ? focused.value : stations[0]?.number;
  const keys = (event: KeyboardEvent): void => walk(event, [...(event.currentTarget as HTMLElement).querySelectorAll<HTMLElement>(".card a.name")]);
  const focus = ({ target }: FocusEvent): void => void (target instanceof HTMLAnchorElement && (focused.value = Number(target.dataset.number)));
  return (
    <ul class="cards" aria-label={text.wall.stations} data-density={density} style={{ "--columns": String(columns) }} onKeyDown={keys} onFocusIn={focus}>
      {stations.map((station) => (
        <li key={station.number}>
          <Card station={station} now={now} lostMs={lost} stop={station.number === stop}
            scene={(slot) => void (slot ? scenes.set(station.number, slot) : scenes.delete(station.number))} />
        </li>))}
    </ul>
  );
}

// What stands where the cards would: waiting, no way to the server, or no stations at all.
function Instead({ known, feed, waited }: { known: boolean; feed: Feed; waited: boolean }) {
  const t = text.wall;
  if (known) return <Empty title={t.allAbsent} hint={t.allAbsentHint} />;
  if (feed.link.state === "broken") return <Empty title={t.unreachable} hint={t.unreachableHint} />;
  return waited ? <Empty title={t.none} hint={t.noneHint} /> : <Loading what={t.waiting} />;
}

// Stations that are not there, in one line.
function Absent({ names }: { names: readonly string[] }) {
  return (
    <details class="absent" hidden={!names.length}>
      <summary>{text.wall.absent(names.length)}</summary>
      <span class="absent-names">{names.map((name) => <a key={name} href={routeTo("station", [name])}>{name}</a>)}</span>
    </details>
  );
}

// ---- what needs somebody ----------------------------------------------------------------------------

// Trainees first; the equipment is folded, but for what is urgent.
function Attention({ app, pictures, stations, warnings, known }: { app: App; pictures: Pictures; stations: readonly StationState[]; warnings: readonly Warning[]; known: boolean }) {
  const t = text.wall;
  const people = useRef<HTMLDivElement>(null);
  const rail = useRef<Trainees | undefined>(undefined);
  const equipment = useRef<HTMLDetailsElement>(null);
  useLayoutEffect(() => {
    const shown = (rail.current = trainees(people.current!, app, pictures));
    return () => shown.end();
  }, []);
  useLayoutEffect(() => rail.current!.show(stations));
  useUrgent(warnings, () => (equipment.current!.open = true));
  const alarms = grouped(warnings);
  return (
    <aside class="attention" aria-label={t.attention}>
      <h2>{t.attention}</h2>
      <div class="attention-body">
        <div class="attention-people" ref={people} />
        <details class="equipment" open={app.account?.role === "technician"} ref={equipment}>
          <summary>{text.teach.attention.equipment(alarms.length)}</summary>
          <ol class="attention-list">
            {alarms.map((alarm) => <Entry key={keyOf(alarm)} of={alarm} />)}
            {known && alarms.length === 0 && <li class="all-quiet"><Icon name="quiet" />{t.allQuiet}</li>}
          </ol>
        </details>
      </div>
      <section class="key"><h3>{t.key}</h3><ol>{t.keys.map((one) => <li key={one}>{one}</li>)}</ol></section>
    </aside>
  );
}

const keyOf = ({ urgency, words }: Alarm): string => `${urgency} ${words}`;

// Screen readers announce new urgent alerts.
function useUrgent(warnings: readonly Warning[], fresh: () => void): void {
  const told = useRef(new Set<string>());
  const words = warnings.filter(({ urgency }) => urgency === 3)
    .map((warning) => (warning.station ? `${warning.station}: ${warning.words}` : `${text.wall.server}: ${text.wall.serverGone}`));
  useEffect(() => {
    const untold = words.filter((one) => !told.current.has(one));
    told.current = new Set(words);
    if (!untold.length) return;
    fresh();
    announce(untold.join(". "));
  }, [words.join()]);
}

const LISTED = 8; // stations of one warning; more are folded

function Entry({ of: { urgency, words, stations } }: { of: Alarm }) {
  const kind = URGENCY_NAMES[urgency];
  const parts = <>
    <Icon name={kind as IconName} />
    <span class="alarm-head"><b>{stations.length > 1 ? text.wall.several(stations.length) : (stations[0] ?? text.wall.server)}</b><span>{text.wall.urgencies[urgency]}</span></span>
    <span class="alarm-words">{words}</span>
  </>;
  const [station] = stations;
  if (stations.length === 1) return <li><a class={`alarm ${kind}`} href={routeTo("station", [station!])} data-station={station}>{parts}</a></li>;
  const links = stations.length > 1 && (
    <span class="alarm-stations">{stations.map((name) => <a key={name} href={routeTo("station", [name])} data-station={name}>{name}</a>)}</span>);
  return (
    <li class={`alarm ${kind}`}>
      {parts}{links && stations.length > LISTED ? <details data-words={words}><summary>{text.wall.which}</summary>{links}</details> : links}
    </li>
  );
}
