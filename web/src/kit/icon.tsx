// Icons: 16 x 16, drawn with strokes in the colour of the text.
const ICONS = {
  mark: "M5 1v4a3 3 0 0 0-1.200 2.300A2.200 2.200 0 0 0 8 8.400a2.200 2.200 0 0 0 4.200-1.100A3 3 0 0 0 11 5V1M3.500 11.300h9M5.200 11.500V15M10.800 11.500V15",
  now: "M8 1.500 15 14.500H1ZM8 6v4M8 12.200v.1",
  act: "M8 1.500 14.500 8 8 14.500 1.500 8ZM8 5v3.500M8 10.700v.1",
  look: "M8 2a6 6 0 1 0 0 12A6 6 0 0 0 8 2ZM8 5.500v.1M8 8v3",
  quiet: "M2.500 8.500 6 12l7.500-8",
  running: "M4.500 2.500v11l9-5.500Z",
  paused: "M5 3v10M11 3v10",
  waiting: "M8 2a6 6 0 1 0 0 12A6 6 0 0 0 8 2ZM8 4.500V8l2.500 1.500",
  closed: "M3.500 3.500h9v9h-9Z",
  gone: "M2 2l12 12M3 6.500a7 7 0 0 1 2.200-1.400M13 6.500a7 7 0 0 0-5-2M5.500 9.500A4 4 0 0 1 7 8.700M8 12.500v.1",
  plus: "M8 3v10M3 8h10",
  close: "M3.500 3.500l9 9M12.500 3.500l-9 9",
  person: "M8 2a3 3 0 1 0 0 6 3 3 0 0 0 0-6ZM2.500 14.500c.5-3 2.700-4.500 5.500-4.500s5 1.500 5.500 4.500",
  previous: "M4 3v10M12.500 3.500 6.500 8l6 4.500Z",
  next: "M12 3v10M3.500 3.500l6 4.500-6 4.500Z",
  back: "M10 3.500 5.500 8 10 12.500",
  down: "M3.500 6 8 10.500 12.500 6",
  open: "M6 3.500 10.500 8 6 12.500",
  file: "M8 2v8M4.500 7 8 10.500 11.500 7M2.500 13.500h11",
  copy: "M5.500 5.500h8v8h-8ZM10.500 5.500v-3h-8v8h3",
} as const;
export type IconName = keyof typeof ICONS;

export function Icon({ name }: { name: IconName }) {
  return <svg viewBox="0 0 16 16" class="icon" aria-hidden="true"><path d={ICONS[name]} /></svg>;
}
