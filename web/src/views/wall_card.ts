// A station's card on the wall.
import type { Place } from "wire";
import type { StationState } from "../live";
import { routeTo } from "../router";
import { format, text } from "../text";
import type { IconName } from "../kit/icon";
import { fill, h, icon, setClass, setText } from "../ui";
import { nameOf, quietFor, runningSeconds, short, statusOf, sumOfDevices, URGENCY_NAMES, warningOf, type Status, type Warning } from "./wall_model";

interface Value {
  element: HTMLElement;
  set(value: string, unit?: string): void;
}

function value(label: string, title: string, kind = ""): Value {
  const figure = h("span", { class: "figure" });
  const unit = h("span", { class: "unit" });
  const element = h("div", { class: `value ${kind}`, title }, h("dt", {}, label), h("dd", {}, figure, unit));
  return {
    element,
    set(words, of = "") {
      setText(figure, words);
      setText(unit, words === format.none ? "" : of);
    },
  };
}

export class Card {
  readonly item: HTMLElement;
  readonly scene = h("div", { class: "mini" }); // where the picture goes
  private readonly sign = h("span", { class: "sign" });
  private readonly link = h("a", { class: "name", tabindex: -1 }); // its area is the whole card
  private readonly time = h("span", { class: "time number" });
  private readonly age = h("span", { class: "age" });
  private readonly who = h("span", { class: "who" });
  private readonly what = h("span", { class: "what" });
  private readonly done = h("p", { class: "done number" });
  private readonly values = makeValues();
  private readonly warning = h("span", { class: "warning" });
  private readonly card = h("article", { class: "card" },
    h("div", { class: "card-head" }, this.sign, this.link, this.time),
    h("div", { class: "card-scene" }, this.scene, this.age),
    h("div", { class: "card-who" }, this.who, this.what), this.done,
    h("dl", { class: "values" }, ...Object.values(this.values).map((one) => one.element)),
    this.warning);

  constructor() {
    this.card.addEventListener("click", (event) => event.target !== this.link && this.link.click());
    this.item = h("li", {}, this.card);
  }

  /** `lostMs`: for how long the server has been silent; undefined: it is not. */
  update(station: StationState, now: number, lostMs: number | undefined): void {
    const t = text.wall;
    const place = station.place!;
    const kind = statusOf(place);
    const quiet = lostMs ?? quietFor(station, now);
    const warned = warningOf(station, now, lostMs !== undefined);
    this.link.href = routeTo("station", [nameOf(station)]);
    this.card.dataset.status = kind;
    this.card.dataset.urgency = URGENCY_NAMES[warned?.urgency ?? 0];
    setClass(this.card, "old", quiet !== undefined);
    setSign(this.sign, quiet !== undefined ? "gone" : kind, quiet !== undefined ? t.noData : t.statuses[kind]);
    setText(this.link, nameOf(station));
    const seconds = runningSeconds(station, Date.now());
    setText(this.time, kind === "gone" || seconds === undefined ? "" : format.clock(seconds));
    setText(this.age, quiet !== undefined ? t.oldFor(quiet) : kind === "gone" ? t.statuses.gone : "");
    setText(this.who, place.trainee || t.nobody);
    setClass(this.who, "quiet-text", !place.trainee);
    setText(this.what, place.info?.caseName ?? "");
    setText(this.done, t.done(place.cuts, format.number(place.removedMm3)));
    this.showValues(place, kind !== "gone");
    showWarning(this.warning, warned);
  }

  private showValues(place: Place, there: boolean): void {
    const { values } = this;
    const { info } = place;
    const devices = sumOfDevices(place.devices);
    values.roundTrip.set(there ? short((info?.rttP50Us ?? NaN) / 1000, 1) : format.none, text.units.ms);
    values.loss.set(there ? short(place.lossShare * 100, 1) : format.none, text.units.percent);
    values.clock.set(there ? `±${short((info?.clockUncertaintyUs ?? NaN) / 1000, 1)}` : format.none, text.units.ms);
    values.rate.set(there ? short(devices.slowestHz, 0) : format.none, text.units.hertz);
    values.dropouts.set(there ? short(devices.dropouts, 0) : format.none);
    values.devices.set(there ? `${devices.there}/${devices.count}` : format.none);
    setClass(values.devices.element, "bad", there && devices.there < devices.count);
    values.displacement.set(there ? format.number(place.warpMm, 1) : format.none, text.units.mm);
  }
}

function makeValues() {
  const t = text.wall;
  return {
    roundTrip: value(t.roundTrip, t.titles.roundTrip), loss: value(t.loss, t.titles.loss), clock: value(t.clock, t.titles.clock, "tight"),
    rate: value(t.rate, t.titles.rate), dropouts: value(t.dropouts, t.titles.dropouts), devices: value(t.devices, t.titles.devices),
    displacement: value(t.displacement, t.titles.displacement),
  };
}

function setSign(sign: HTMLElement, kind: Status, words: string): void {
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
