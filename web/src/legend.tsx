// What the colours of a map mean.
import type { ColourMap, MapName } from "./scene/colours";
import { format, text } from "./text";

/** Without a map there is none to be seen. */
export function Legend({ name, map }: { name: MapName; map: ColourMap | undefined }) {
  if (!map || name === "none") return null;
  const at = (value: number): string => `${(100 * (value - map.from)) / (map.to - map.from)}%`;
  const colours = map.table.map(([r, g, b]) => `rgb(${r} ${g} ${b})`).join(", ");
  const digits = Math.max(...map.ticks.map((value) => (Number.isInteger(value) ? 0 : Number.isInteger(10 * value) ? 1 : 2)));
  return (
    <div class="legend">
      <p><strong>{text.session.maps[name]}</strong>{map.unit && ` ${map.unit}`}</p>
      <div class="legend-bar" style={{ background: `linear-gradient(to right, ${colours})` }}>{(map.marks ?? []).map((value) => <i key={value} class="legend-mark" style={{ left: at(value) }} />)}</div>
      <div class="legend-ticks">{map.ticks.map((value) => <span key={value} style={{ left: at(value) }}>{format.number(value, digits)}</span>)}</div>
      <p class="legend-hint">{text.session.mapHints[name]}</p>
    </div>
  );
}
