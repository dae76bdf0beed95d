// A station's card on the wall.
import type { Place } from "wire";
import type { RefCallback } from "preact";
import { Icon, type IconName } from "../kit/icon";
import type { StationState } from "../live";
import { routeTo } from "../router";
import { format, text } from "../text";
import { nameOf, quietFor, runningSeconds, short, statusOf, sumOfDevices, URGENCY_NAMES, warningOf } from "./wall_model";

interface CardProps {
  station: StationState;
  now: number;
  lostMs: number | undefined; // for how long the server has been silent; undefined: it is not
  stop: boolean; // one of the cards is a tab stop
  scene: RefCallback<HTMLDivElement>; // where the picture goes
}

export function Card({ station, now, lostMs, stop, scene }: CardProps) {
  const t = text.wall;
  const place = station.place!;
  const kind = statusOf(place);
  const quiet = lostMs ?? quietFor(station, now);
  const warned = warningOf(station, now, lostMs !== undefined);
  const seconds = kind === "gone" ? undefined : runningSeconds(station, Date.now());
  const link = (event: MouseEvent): HTMLAnchorElement => (event.currentTarget as HTMLElement).querySelector<HTMLAnchorElement>("a.name")!;
  return (
    <article class={`card ${quiet !== undefined ? "old" : ""}`} data-status={kind} data-urgency={URGENCY_NAMES[warned?.urgency ?? 0]}
      onClick={(event) => event.target !== link(event) && link(event).click()}>
      <div class="card-head">
        <span class="sign" data-kind={quiet !== undefined ? "gone" : kind}>
          <Icon name={quiet !== undefined ? "gone" : kind} /><span class="unseen">{quiet !== undefined ? t.noData : t.statuses[kind]}</span>
        </span>
        <a class="name" href={routeTo("station", [nameOf(station)])} tabIndex={stop ? 0 : -1} data-number={station.number}>{nameOf(station)}</a>
        <span class="time number">{seconds === undefined ? "" : format.clock(seconds)}</span>
      </div>
      <div class="card-scene"><div class="mini" ref={scene} /><span class="age">{quiet !== undefined ? t.oldFor(quiet) : kind === "gone" ? t.statuses.gone : ""}</span></div>
      <div class="card-who"><span class={place.trainee ? "who" : "who quiet-text"}>{place.trainee || t.nobody}</span><span class="what">{place.info?.caseName ?? ""}</span></div>
      <p class="done number">{t.done(place.cuts, format.number(place.removedMm3))}{place.server && ` · ${place.server}`}</p>
      <Values of={place} there={kind !== "gone"} />
      <span class="warning">{warned && <>
        <Icon name={URGENCY_NAMES[warned.urgency] as IconName} /><b>{t.urgencies[warned.urgency]}</b><span class="words">{warned.words}</span></>}</span>
    </article>
  );
}

function Values({ of, there }: { of: Place; there: boolean }) {
  const t = text.wall;
  const { info } = of;
  const devices = sumOfDevices(of.devices);
  const rows: [name: keyof typeof t.titles, value: string, unit: string, kind?: string][] = [
    ["roundTrip", short((info?.rttP50Us ?? NaN) / 1000, 1), text.units.ms],
    ["loss", short(of.lossShare * 100, 1), text.units.percent],
    ["clock", `±${short((info?.clockUncertaintyUs ?? NaN) / 1000, 1)}`, text.units.ms, "tight"],
    ["rate", short(devices.slowestHz, 0), text.units.hertz],
    ["dropouts", short(devices.dropouts, 0), ""],
    ["devices", `${devices.there}/${devices.count}`, "", there && devices.there < devices.count ? "bad" : ""],
    ["displacement", format.number(of.warpMm, 1), text.units.mm],
  ];
  return (
    <dl class="values">{rows.map(([name, value, unit, kind = ""]) => {
      const shown = there ? value : format.none;
      return (
        <div key={name} class={`value ${kind}`} title={t.titles[name]}>
          <dt>{t[name]}</dt><dd><span class="figure">{shown}</span><span class="unit">{shown === format.none ? "" : unit}</span></dd>
        </div>);
    })}</dl>
  );
}
