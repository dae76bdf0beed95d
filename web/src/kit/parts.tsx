// Buttons, fields, tabs, badges and the states of a panel.
import { cloneElement, createContext, type ButtonHTMLAttributes, type ComponentChildren, type VNode } from "preact";
import { signal, type ReadonlySignal } from "@preact/signals";
import { useContext, useId, useLayoutEffect, useRef } from "preact/hooks";
import { text } from "../text";
import { Icon, type IconName } from "./icon";
import { walk } from "./keys";

export type ButtonKind = "primary" | "plain" | "danger" | "quiet";

export interface ButtonProps extends Omit<ButtonHTMLAttributes, "icon"> {
  kind?: ButtonKind;
  icon?: IconName;
}

/** Classes beside its kind: small, wide, icon-only. */
export function Button({ kind = "plain", icon, class: names = "", children, ...props }: ButtonProps) {
  return <button type="button" {...props} class={`button ${kind} ${names}`}>{icon && <Icon name={icon} />}{children}</button>;
}

/** A quiet button in a row of a table. */
export function RowButton(props: ButtonProps) {
  return <Button kind="quiet" {...props} class={`small ${props.class ?? ""}`} />;
}

export function Badge({ kind = "", icon, title, children }: { kind?: "good" | "look" | "act" | "now" | ""; icon?: IconName; title?: string | undefined; children: ComponentChildren }) {
  return <span class={`badge ${kind}`} title={title || undefined}>{icon && <Icon name={icon} />}{children}</span>;
}

interface DropProps {
  label: string;
  class?: string;
  children: ComponentChildren;
}

/** A button that opens a panel. It closes where the focus leaves it, and with Escape. */
export function Drop({ label, class: names = "", children }: DropProps) {
  const element = useRef<HTMLDetailsElement>(null);
  const left = ({ relatedTarget: to }: FocusEvent): void => {
    if (to && !element.current!.contains(to as Node)) element.current!.open = false;
  };
  const escape = (event: KeyboardEvent): void => {
    if (event.key !== "Escape" || !element.current!.open) return;
    element.current!.open = false;
    element.current!.querySelector("summary")!.focus();
    event.stopPropagation();
  };
  return (
    <details class={`drop ${names}`} ref={element} onFocusOut={left} onKeyDown={escape}>
      <summary class="button">{label}</summary><div class="drop-panel" tabIndex={-1}>{children}</div>
    </details>
  );
}

// ---- fields -----------------------------------------------------------------------------------------

/** What is wrong with the inputs of a form, by their names. */
export type Faults = Readonly<Record<string, string>>;
export const FaultsOf = createContext<ReadonlySignal<Faults>>(signal({}));

interface FieldProps {
  label: string;
  hint?: string | undefined;
  hidden?: boolean;
  shown?: ComponentChildren; // beside the label, such as the value of a slider
  children: VNode<{ name?: string }>; // the input, select or textarea
}

/** A label over its input, with a line for a hint or for what is wrong that is there from the start. */
export function Field({ label, hint = "", hidden, shown, children }: FieldProps) {
  const id = useId();
  const fault = useContext(FaultsOf).value[children.props.name ?? ""] ?? "";
  const input = cloneElement<object>(children as VNode<object>, { id, "aria-describedby": `${id}-hint`, "aria-invalid": fault !== "" });
  return (
    <div class="field" hidden={hidden}>
      <label for={id}>{label}{shown && <> {shown}</>}</label>
      {input}
      <p class={fault ? "hint fault" : "hint"} id={`${id}-hint`}>{fault || hint}</p>
    </div>
  );
}

export interface SelectProps {
  options: readonly (readonly [value: string, label: string])[];
  name?: string;
  value?: string; // chosen at first, or always where `onChoose` keeps it
  disabled?: boolean;
  label?: string; // for readers, where no field has one
  onChoose?(value: string): void;
  [attribute: string]: unknown; // of Field
}

export function Select({ options, value, label, onChoose, ...props }: SelectProps) {
  return (
    <select {...props} aria-label={label} onChange={(event) => onChoose?.(event.currentTarget.value)}>
      {options.map(([key, name]) => <option key={key} value={key} selected={key === value}>{name}</option>)}
    </select>
  );
}

// ---- tabs -------------------------------------------------------------------------------------------

interface TabsProps<K extends string> {
  label: string;
  tabs: readonly (readonly [name: K, label: string])[];
  chosen: K;
  panel: string; // id of the element that they switch
  onChoose(name: K): void;
}

/** Tabs in one tab stop: arrow keys, Home and End walk over them. */
export function Tabs<K extends string>({ label, tabs, chosen, panel, onChoose }: TabsProps<K>) {
  const keys = (event: KeyboardEvent): void => walk(event, [...(event.currentTarget as HTMLElement).querySelectorAll<HTMLElement>("[role=tab]")]);
  return (
    <div class="tabs" role="tablist" aria-label={label} onKeyDown={keys}>
      {tabs.map(([name, words]) => (
        <button key={name} type="button" role="tab" class="tab" aria-controls={panel} aria-selected={name === chosen} tabIndex={name === chosen ? 0 : -1}
          data-kind={name} onClick={() => onChoose(name)}>{words}</button>
      ))}
    </div>
  );
}

// ---- heads and states of a panel ----------------------------------------------------------------------

/** The heading of a page, with what can be done to all of it. */
export function Head({ title, hint, children }: { title: string; hint?: string; children?: ComponentChildren }) {
  return (
    <div class="page-head">
      <div><h1>{title}</h1>{hint && <p class="quiet-text">{hint}</p>}</div>
      <div class="head-actions">{children}</div>
    </div>
  );
}

export function Loading({ what = text.loading }: { what?: string }) {
  return <div class="state loading" role="status"><span class="spinner" aria-hidden="true" />{what}</div>;
}

export function Empty({ title, hint, children }: { title: string; hint?: string | undefined; children?: ComponentChildren }) {
  return <div class="state empty"><p class="state-title">{title}</p>{hint && <p>{hint}</p>}{children}</div>;
}

export function Broken({ title, hint, again }: { title: string; hint: string; again?: () => void }) {
  return (
    <div class="state broken" role="alert">
      <Icon name="act" /><p class="state-title">{title}</p><p>{hint}</p>
      {again && <Button onClick={again}>{text.tryAgain}</Button>}
    </div>
  );
}

/** An element that a class makes itself, inside a component: a 3D scene, the scope. `make` returns what ends it. */
export function Island({ class: names, make }: { class?: string; make(element: HTMLElement): () => void }) {
  const element = useRef<HTMLDivElement>(null);
  useLayoutEffect(() => make(element.current!), []); // closed before the next view begins
  return <div class={names} ref={element} />;
}
