// What the colours of a map mean.
import type { ColourMap, MapName } from "./scene/colours";
import { format, text } from "./text";
import { add, fill, h } from "./ui";

/** Without a map there is none to be seen. */
export function showLegend(legend: HTMLElement, name: MapName, map: ColourMap | undefined): void {
  legend.hidden = !map || name === "none";
  if (!map || name === "none") return;
  const bar = h("div", { class: "legend-bar" });
  bar.style.background = `linear-gradient(to right, ${map.table.map(([r, g, b]) => `rgb(${r} ${g} ${b})`).join(", ")})`;
  const at = (value: number): string => `${(100 * (value - map.from)) / (map.to - map.from)}%`;
  for (const value of map.marks ?? []) {
    const mark = h("i", { class: "legend-mark" });
    mark.style.left = at(value);
    bar.append(mark);
  }
  const ticks = h("div", { class: "legend-ticks" });
  const digits = Math.max(...map.ticks.map((value) => (Number.isInteger(value) ? 0 : Number.isInteger(10 * value) ? 1 : 2)));
  for (const value of map.ticks) {
    const tick = h("span", {}, format.number(value, digits));
    tick.style.left = at(value);
    add(ticks, tick);
  }
  fill(legend, h("p", {}, h("strong", {}, text.session.maps[name]), map.unit && ` ${map.unit}`), bar, ticks, h("p", { class: "legend-hint" }, text.session.mapHints[name]));
}
