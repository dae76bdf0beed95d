// A table that is asked for: waiting, empty, broken and filled.
import { explain } from "./explain";
import { text } from "./text";
import { broken, fill, h, loading, setClass, type Child } from "./ui";

export interface Column<T> {
  label: string;
  number?: boolean;
  hidden?: boolean; // its label is for readers only
  wide?: boolean; // not on a narrow screen
  cell(row: T): Child;
}

export interface Listing {
  element: HTMLElement;
  reload(): void; // what was there stays until the new rows are
  end(): void;
}

// A rebuilt list would lose the focus: it moves to the element now in the same place, or to the list.
function keepFocus(element: HTMLElement, change: () => void): void {
  const all = (): Element[] => [...element.querySelectorAll("td :is(a, button, input, select)")];
  const focused = document.activeElement;
  const before = element.contains(focused) ? all() : undefined;
  change();
  if (!before) return;
  const after = all();
  const place = after.length === before.length ? after[before.indexOf(focused!)] : undefined;
  (place?.matches(":enabled, a") ? (place as HTMLElement) : (element.querySelector<HTMLElement>(".table-scroll, .button") ?? element)).focus();
}

/** `load` says what the rows are, `none` what to show where there are none. */
export function listing<T>(caption: string, columns: Column<T>[], load: () => Promise<T[]>, none: () => HTMLElement): Listing {
  const element = h("div", { class: "panel listing", tabindex: -1 }, loading());
  let turn = 0;
  const show = (rows: T[]): void => {
    if (rows.length === 0) {
      fill(element, none());
      return;
    }
    const kind = (column: Column<T>): string => [column.number && "number", column.hidden && "actions", column.wide && "wide-only"].filter(Boolean).join(" ");
    fill(element, h("div", { class: "table-scroll", tabindex: 0, role: "region", "aria-label": caption }, h("table", {},
      h("caption", { class: "unseen" }, caption),
      h("thead", {}, h("tr", {}, ...columns.map((column) => h("th", { scope: "col", class: kind(column) }, column.hidden ? h("span", { class: "unseen" }, column.label) : column.label)))),
      h("tbody", {}, ...rows.map((row) => h("tr", {}, ...columns.map((column) => h("td", { class: kind(column) }, column.cell(row)))))))));
  };
  const reload = async (): Promise<void> => {
    const mine = ++turn;
    setClass(element, "busy", true);
    element.setAttribute("aria-busy", "true");
    try {
      const rows = await load();
      if (mine === turn) keepFocus(element, () => show(rows));
    } catch (error) {
      if (mine === turn) keepFocus(element, () => fill(element, broken(text.listBroken, explain(error), () => void reload())));
    }
    if (mine !== turn) return;
    setClass(element, "busy", false);
    element.removeAttribute("aria-busy");
  };
  void reload();
  return { element, reload: () => void reload(), end: () => void turn++ };
}
