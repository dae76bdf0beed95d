// A chart by uPlot: columns of numbers over a common x, in the colours of the page.
import { useLayoutEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import { format } from "../text";
import { onTheme, themeColour } from "../theme";

export interface Series {
  label: string;
  unit?: string;
  digits?: number;
  colour: string; // a custom property, as "--plot-1"
  values: readonly (number | null)[];
  kind?: "line" | "points" | "steps" | "bars"; // a line if not said
  dashed?: boolean;
}

export interface ChartProps {
  label: string; // what it shows, for readers
  x: readonly number[]; // they rise
  xText?(x: number): string; // at the axis
  series: readonly Series[];
  height?: number; // px
  least?: number; // what the y axis shows at least
  most?: number;
  marks?: readonly { y: number; colour: string; label: string }[]; // lines across, such as a pass mark
  onPick?(index: number): void; // a click on the nearest x
}

const FONT = "12px system-ui, sans-serif";

function seriesOf({ label, colour, kind = "line", dashed, digits = 0, unit = "" }: Series): uPlot.Series {
  const stroke = themeColour(colour);
  const value = (_: uPlot, y: number | null): string => `${format.number(y ?? undefined, digits)} ${unit}`.trim();
  const common = { label, stroke, value, width: 1.5, ...(dashed ? { dash: [4, 4] } : {}) };
  if (kind === "points") return { ...common, paths: () => null, points: { show: true, size: 6, fill: stroke } };
  if (kind === "steps") return { ...common, paths: uPlot.paths.stepped!({ align: 1 }), points: { show: false } };
  if (kind === "bars") return { ...common, fill: stroke, paths: uPlot.paths.bars!({ size: [0.8, 48] }), points: { show: false } };
  return { ...common, points: { show: false } };
}

function drawMarks(chart: uPlot, marks: NonNullable<ChartProps["marks"]>): void {
  const { ctx, bbox } = chart;
  ctx.save();
  ctx.font = FONT;
  for (const { y, colour, label } of marks) {
    const at = Math.round(chart.valToPos(y, "y", true)) + 0.5;
    ctx.strokeStyle = ctx.fillStyle = themeColour(colour);
    ctx.setLineDash([6, 4]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, at);
    ctx.lineTo(bbox.left + bbox.width, at);
    ctx.stroke();
    ctx.textAlign = "right";
    ctx.fillText(label, bbox.left + bbox.width - 4, at - 4);
  }
  ctx.restore();
}

function optionsOf({ xText = (x) => format.number(x), series, height = 220, least, most, marks = [] }: ChartProps, width: number): uPlot.Options {
  const axis: uPlot.Axis = { stroke: themeColour("--text-quiet"), grid: { stroke: themeColour("--line"), width: 1 }, ticks: { show: false }, font: FONT };
  const range: uPlot.Range.Function = (_, low, high) => {
    const all = [low, high, least, most, ...marks.map(({ y }) => y)].filter((value): value is number => Number.isFinite(value));
    const [bottom, top] = [Math.min(...all), Math.max(...all)];
    return [bottom === least ? bottom : bottom - (top - bottom) * 0.05, top + (top - bottom || 1) * 0.05];
  };
  return {
    width, height, scales: { x: { time: false }, y: { range } },
    series: [{ value: (_, x) => (x === null ? format.none : xText(x)) }, ...series.map(seriesOf)],
    axes: [{ ...axis, values: (_, ticks) => ticks.map(xText) }, { ...axis, size: 48 }],
    cursor: { drag: { x: false, y: false } }, legend: { live: true },
    hooks: { draw: [(chart) => drawMarks(chart, marks)] },
  };
}

/** Drawn anew where its props are others: keep what you give it while it stays the same. Its figures stand below, and in a table for readers. */
export function Chart(props: ChartProps) {
  const place = useRef<HTMLDivElement>(null);
  const { label, x, series, onPick } = props;
  useLayoutEffect(() => {
    const at = place.current!;
    let chart: uPlot | undefined;
    const draw = (): void => {
      chart?.destroy();
      chart = new uPlot(optionsOf(props, at.clientWidth), [[...x], ...series.map(({ values }) => [...values])] as uPlot.AlignedData, at);
      chart.over.addEventListener("click", () => chart!.cursor.idx != null && onPick?.(chart!.cursor.idx));
    };
    draw();
    const resize = new ResizeObserver(() => chart!.setSize({ width: at.clientWidth, height: props.height ?? 220 }));
    resize.observe(at);
    const endTheme = onTheme(draw);
    return () => {
      endTheme();
      resize.disconnect();
      chart?.destroy();
    };
  }, [x, series, props.marks, props.least, props.most]);
  return <div class="chart" role="img" aria-label={label} ref={place} />;
}
