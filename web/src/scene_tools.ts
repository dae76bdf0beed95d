// What stands over the joint's picture: where to look from, what is shown, colour maps and their legend.
import type { Instrument } from "wire";
import { showLegend } from "./legend";
import type { ColourMap, MapName } from "./scene/colours";
import { colourOf, nameOf, type Instruments } from "./instruments";
import type { Show } from "./scene/joint";
import { PRESETS, type PresetName } from "./scene/orbit";
import { text } from "./text";
import { button, drop, h, select } from "./ui";

export interface ToolbarActions {
  show(show: Show): void;
  preset(name: PresetName): void;
  follow(on: boolean): void;
}

type Switch = keyof typeof text.session.shows;
const SWITCHES: Switch[] = ["ghost", "raw", "trails", "seeThrough", "femur", "patella", "ligaments", "skin"];

export class Toolbar {
  readonly element: HTMLElement;
  private readonly legend = h("div", { class: "legend", hidden: true });
  private readonly key = h("ul", { class: "tool-key" });
  private instruments: Instruments | undefined;
  private tools: HTMLElement[] = [];

  constructor(private show: Show, private readonly actions: ToolbarActions) {
    const presets = PRESETS.map((name, i) =>
      h("button", { type: "button", class: "tool", title: `${text.session.presets[name]} (${i + 1})`, "aria-label": text.session.presets[name],
        on: { click: () => actions.preset(name) } }, text.session.presetKeys[name]));
    const follow = button(text.session.follow, () => {
      const on = follow.getAttribute("aria-pressed") !== "true";
      follow.setAttribute("aria-pressed", String(on));
      actions.follow(on);
    }, { class: "tool wide-tool", "aria-pressed": "false" });
    const maps = select((Object.entries(text.session.maps) as [MapName, string][]), "none", { "aria-label": text.session.map,
      on: { change: () => this.set({ map: maps.value as MapName }) } });
    this.element = h("div", { class: "scene-tools" },
      h("div", { class: "tools-left", role: "group", "aria-label": text.session.views }, h("div", { class: "tool-row" }, ...presets), follow),
      h("div", { class: "tools-right" }, maps, this.switches()),
      this.legend, this.key);
  }

  /** Whose trails are named: of the instruments that were seen. */
  showTools(instruments: Instruments, seen: (instrument: number) => boolean): void {
    if (instruments !== this.instruments) this.key.replaceChildren(...(this.tools = instruments.map(toolKey)));
    this.instruments = instruments;
    this.tools.forEach((tool, instrument) => (tool.hidden = !seen(instrument)));
  }

  private set(change: Partial<Show>): void {
    this.show = { ...this.show, ...change };
    this.actions.show(this.show);
  }

  private switches(): HTMLElement {
    const boxes = SWITCHES.map((name) => {
      const input = h("input", { type: "checkbox", on: { change: () => this.set({ [name]: input.checked }) } });
      input.checked = this.show[name];
      return h("label", { class: "switch" }, input, h("span", {}, text.session.shows[name]));
    });
    return drop(text.session.show, [...boxes, h("p", { class: "hint" }, text.session.sceneHelp)]);
  }

  showLegend(name: MapName, map: ColourMap | undefined): void {
    showLegend(this.legend, name, map);
  }
}

// Whose trail is whose.
function toolKey(instrument: Instrument, place: number): HTMLElement {
  const sign = h("i", { "aria-hidden": "true" });
  sign.style.background = `#${colourOf(instrument, place).toString(16).padStart(6, "0")}`;
  return h("li", { hidden: true }, sign, nameOf(instrument));
}

