// Tables, and what is asked for from the server: waiting, empty, broken and filled.
import { useSignal } from "@preact/signals";
import type { ComponentChildren, Key } from "preact";
import { useEffect, useLayoutEffect, useRef } from "preact/hooks";
import { explain } from "../explain";
import { text } from "../text";
import { Broken, Loading } from "./parts";

export interface Loaded<T> {
  value: T | undefined; // what came last; it stays while it is asked for again
  error: unknown; // undefined: none
  busy: boolean;
  reload(): void;
}

/** Asks at first, and again where one of `inputs` changed. An older answer that comes later is not shown. */
export function useLoaded<T>(load: () => Promise<T>, inputs: readonly unknown[] = []): Loaded<T> {
  const state = useSignal<Omit<Loaded<T>, "reload">>({ value: undefined, error: undefined, busy: true });
  const turn = useRef(0);
  const newest = useRef(load);
  newest.current = load;
  const reload = useRef(() => {
    const mine = ++turn.current;
    const take = (taken: Partial<Loaded<T>>): void => {
      if (mine === turn.current) state.value = { ...state.peek(), busy: false, ...taken };
    };
    state.value = { ...state.peek(), busy: true };
    newest.current().then((value) => take({ value, error: undefined }), (error: unknown) => take({ error: error ?? new Error() }));
  }).current;
  useEffect(() => {
    reload();
    return () => void turn.current++;
  }, inputs);
  return { ...state.value, reload };
}

/** One of the states that what is asked for can be in. */
export function Await<T>({ of, children }: { of: Loaded<T>; children(value: T): ComponentChildren }) {
  if (of.error !== undefined) return <Broken title={text.listBroken} hint={explain(of.error)} again={of.reload} />;
  return of.value === undefined ? <Loading /> : <>{children(of.value)}</>;
}

export interface Column<T> {
  label: string;
  number?: boolean;
  hidden?: boolean; // its label is for readers only: actions
  wide?: boolean; // not on a narrow screen
  cell(row: T): ComponentChildren;
}

export interface TableProps<T> {
  caption: string;
  columns: readonly Column<T>[];
  rows: readonly T[];
  keyOf(row: T): Key; // a row keeps its elements, and the focus, while its key stays
  classOf?(row: T): string;
}

const kindOf = <T,>({ number, hidden, wide }: Column<T>): string => [number && "number", hidden && "actions", wide && "wide-only"].filter(Boolean).join(" ");

export function Table<T>({ caption, columns, rows, keyOf, classOf }: TableProps<T>) {
  return (
    <div class="table-scroll" tabIndex={0} role="region" aria-label={caption}>
      <table>
        <caption class="unseen">{caption}</caption>
        <thead><tr>{columns.map((column) => (
          <th key={column.label} scope="col" class={kindOf(column)}>{column.hidden ? <span class="unseen">{column.label}</span> : column.label}</th>))}</tr></thead>
        <tbody>{rows.map((row) => (
          <tr key={keyOf(row)} class={classOf?.(row)}>{columns.map((column) => <td key={column.label} class={kindOf(column)}>{column.cell(row)}</td>)}</tr>))}</tbody>
      </table>
    </div>
  );
}

interface ListingProps<T> extends Omit<TableProps<T>, "rows"> {
  of: Loaded<readonly T[]>;
  none: ComponentChildren; // what to show where there are no rows
}

/** A table of what `useLoaded` asks for. Where the element with the focus goes, the table gets it. */
export function Listing<T>({ of, none, ...table }: ListingProps<T>) {
  const panel = useRef<HTMLDivElement>(null);
  const focused = document.activeElement;
  const held = panel.current?.contains(focused) ? focused : undefined;
  useLayoutEffect(() => {
    if (!held || (held.isConnected && !held.matches(":disabled"))) return;
    (panel.current!.querySelector<HTMLElement>(".table-scroll, .button") ?? panel.current!).focus();
  });
  return (
    <div class={`panel listing ${of.busy ? "busy" : ""}`} tabIndex={-1} aria-busy={of.busy} ref={panel}>
      <Await of={of}>{(rows) => (rows.length ? <Table {...table} rows={rows} /> : none)}</Await>
    </div>
  );
}
