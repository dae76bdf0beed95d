// What stands over the joint's picture: where to look from, what is shown, colour maps and their legend.
import { signal } from "@preact/signals";
import { render } from "preact";
import type { Instrument } from "wire";
import { Button, Drop, Select } from "./kit";
import { Legend } from "./legend";
import type { ColourMap, MapName } from "./scene/colours";
import { colourOf, nameOf, type Instruments } from "./instruments";
import type { Show } from "./scene/joint";
import { PRESETS, type PresetName } from "./scene/orbit";
import { text } from "./text";

export interface ToolbarActions {
  show(show: Show): void;
  preset(name: PresetName): void;
  follow(on: boolean): void;
}

type Switch = keyof typeof text.session.shows;
const SWITCHES: Switch[] = ["ghost", "raw", "trails", "seeThrough", "femur", "patella", "ligaments", "skin"];

export class Toolbar {
  readonly element = document.createElement("div");
  readonly show: ReturnType<typeof signal<Show>>;
  readonly following = signal(false);
  readonly legend = signal<{ name: MapName; map: ColourMap | undefined }>({ name: "none", map: undefined });
  readonly tools = signal<readonly [place: number, instrument: Instrument][]>([]); // that were seen

  constructor(show: Show, readonly actions: ToolbarActions) {
    this.show = signal(show);
    this.element.className = "scene-tools";
    render(<Tools of={this} />, this.element);
  }

  close(): void {
    render(null, this.element);
  }

  /** Whose trails are named: of the instruments that were seen. */
  showTools(instruments: Instruments, seen: (instrument: number) => boolean): void {
    const tools = instruments.map((instrument, place): [number, Instrument] => [place, instrument]).filter(([place]) => seen(place));
    const before = this.tools.peek();
    if (tools.length !== before.length || tools.some(([, instrument], i) => instrument !== before[i]![1])) this.tools.value = tools;
  }

  set(change: Partial<Show>): void {
    this.actions.show((this.show.value = { ...this.show.peek()!, ...change }));
  }

  follow(): void {
    this.actions.follow((this.following.value = !this.following.peek()));
  }

  showLegend(name: MapName, map: ColourMap | undefined): void {
    this.legend.value = { name, map };
  }
}

function Tools({ of }: { of: Toolbar }) {
  const t = text.session;
  const show = of.show.value!;
  const maps = Object.entries(t.maps) as [MapName, string][];
  return (
    <>
      <div class="tools-left" role="group" aria-label={t.views}>
        <div class="tool-row">{PRESETS.map((name, i) => (
          <button key={name} type="button" class="tool" title={`${t.presets[name]} (${i + 1})`} aria-label={t.presets[name]} onClick={() => of.actions.preset(name)}>{t.presetKeys[name]}</button>))}</div>
        <Button class="tool wide-tool" aria-pressed={of.following.value} onClick={() => of.follow()}>{t.follow}</Button>
      </div>
      <div class="tools-right">
        <Select label={t.map} options={maps} value={show.map} onChoose={(map) => of.set({ map: map as MapName })} />
        <Drop label={t.show}>
          {SWITCHES.map((name) => (
            <label key={name} class="switch"><input type="checkbox" checked={show[name]} onChange={(event) => of.set({ [name]: event.currentTarget.checked })} /><span>{t.shows[name]}</span></label>))}
          <p class="hint">{t.sceneHelp}</p>
        </Drop>
      </div>
      <Legend {...of.legend.value} />
      <ul class="tool-key">{of.tools.value.map(([place, instrument]) => (
        <li key={place}><i aria-hidden="true" style={{ background: `#${colourOf(instrument, place).toString(16).padStart(6, "0")}` }} />{nameOf(instrument)}</li>))}</ul>
    </>
  );
}
