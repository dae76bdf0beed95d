// Small helpers over the DOM. No style attributes: the pages' policy forbids them; use classes, or
// element.style for what is computed.
import { ApiError } from "./api";
import { explain } from "./explain";
import { ICONS, type IconName } from "./kit/icon";
import { sentence, text } from "./text";

export type Child = Node | string | undefined | null | false;
type Listener = (event: never) => void;
export interface Props {
  class?: string;
  on?: { [event: string]: Listener };
  data?: Record<string, string>;
  [attribute: string]: unknown; // true: without a value; false, undefined: not there
}

/** An element with attributes, listeners and children. */
export function h<K extends keyof HTMLElementTagNameMap>(tag: K, props: Props = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (name === "on") for (const [event, listener] of Object.entries(props.on!)) element.addEventListener(event, listener as EventListener);
    else if (name === "data") Object.assign(element.dataset, value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== undefined) element.setAttribute(name, String(value));
  }
  add(element, ...children);
  return element;
}

export function add(parent: Element, ...children: Child[]): void {
  for (const child of children) if (child !== undefined && child !== null && child !== false) parent.append(child);
}

/** Replaces all children. */
export function fill(parent: Element, ...children: Child[]): void {
  parent.replaceChildren();
  add(parent, ...children);
}

/** Sets a text only where it is another: nothing is laid out again for what stays the same. */
export function setText(element: Element, value: string): void {
  if (element.textContent !== value) element.textContent = value;
}

export function setClass(element: Element, name: string, on: boolean): void {
  if (element.classList.contains(name) !== on) element.classList.toggle(name, on);
}

// ---- icons -----------------------------------------------------------------------------------------

export function icon(name: IconName): SVGSVGElement {
  const space = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(space, "svg");
  svg.setAttribute("viewBox", "0 0 16 16");
  svg.setAttribute("class", "icon");
  svg.setAttribute("aria-hidden", "true");
  const path = document.createElementNS(space, "path");
  path.setAttribute("d", ICONS[name]);
  svg.append(path);
  return svg;
}

// ---- time ------------------------------------------------------------------------------------------

/** Now and then once a second, until the returned function is called. */
export function everySecond(what: () => void): () => void {
  what();
  const timer = setInterval(what, 1000);
  return () => clearInterval(timer);
}

// ---- form parts ------------------------------------------------------------------------------------

export interface ButtonProps extends Props {
  kind?: "primary" | "plain" | "danger" | "quiet";
  icon?: IconName;
}

export function button(label: string, click: (event: MouseEvent) => void, { kind = "plain", icon: glyph, ...props }: ButtonProps = {}): HTMLButtonElement {
  return h("button", { type: "button", ...props, class: `button ${kind} ${props.class ?? ""}`, on: { click } }, glyph && icon(glyph), label);
}

let fields = 0;

/** A label over its input, with a line for a hint or for what is wrong that is there from the start. */
export function field(label: string, input: HTMLInputElement | HTMLSelectElement | HTMLTextAreaElement, hint = ""): HTMLElement {
  input.id = `field-${++fields}`;
  const line = h("p", { class: "hint", id: `${input.id}-hint`, data: { hint } }, hint);
  input.setAttribute("aria-describedby", line.id);
  return h("div", { class: "field" }, h("label", { for: input.id }, label), input, line);
}

/** What is wrong with an input that `field` was made of, for eyes and readers; "" for nothing. */
export function setFault(input: HTMLElement, fault: string): void {
  input.setAttribute("aria-invalid", String(fault !== ""));
  const line = document.getElementById(`${input.id}-hint`);
  if (!line) return;
  setText(line, fault || line.dataset.hint!);
  setClass(line, "fault", fault !== "");
}

export function select(options: [value: string, label: string][], chosen = "", props: Props = {}): HTMLSelectElement {
  const element = h("select", props, ...options.map(([value, label]) => h("option", { value }, label)));
  element.value = chosen;
  return element;
}

// ---- states of a whole panel -----------------------------------------------------------------------

export function loading(what: string = text.loading): HTMLElement {
  return h("div", { class: "state loading", role: "status" }, h("span", { class: "spinner", "aria-hidden": "true" }), what);
}

export function empty(title: string, hint = "", ...actions: Child[]): HTMLElement {
  return h("div", { class: "state empty" }, h("p", { class: "state-title" }, title), hint && h("p", {}, hint), ...actions);
}

export function broken(title: string, hint: string, again?: () => void): HTMLElement {
  return h("div", { class: "state broken", role: "alert" }, icon("act"), h("p", { class: "state-title" }, title), h("p", {}, hint),
    again && button(text.tryAgain, again));
}

// ---- dialogs ---------------------------------------------------------------------------------------

export interface Dialog {
  element: HTMLDialogElement;
  close(): void;
}

/** A modal dialog: the browser keeps the focus inside, Escape closes, the focus goes back after. */
export function dialog(title: string, body: Child[], actions: Child[] = [], closed: () => void = () => {}): Dialog {
  const before = document.activeElement;
  const close = h("button", { type: "button", class: "button quiet icon-only", "aria-label": text.close, on: { click: () => element.close() } }, icon("close"));
  const heading = h("h2", { id: `dialog-${++fields}` }, title);
  const element = h("dialog", { class: "dialog", "aria-labelledby": heading.id },
    h("header", {}, heading, close), h("div", { class: "dialog-body" }, ...body), actions.length > 0 && h("footer", {}, ...actions));
  element.addEventListener("close", () => {
    element.remove();
    if (before instanceof HTMLElement && before.isConnected) before.focus();
    closed();
  });
  // A drag that ends on the backdrop is a click on the dialog, too: selecting text must not close it.
  const outside = ({ clientX, clientY }: MouseEvent): boolean => {
    const { left, right, top, bottom } = element.getBoundingClientRect();
    return clientX < left || clientX > right || clientY < top || clientY > bottom;
  };
  let pressed = false; // on the backdrop
  element.addEventListener("pointerdown", (event) => (pressed = event.target === element && outside(event)));
  element.addEventListener("click", (event) => {
    if (pressed && event.target === element && outside(event)) element.close();
  });
  document.body.append(element);
  element.showModal();
  return { element, close: () => element.close() };
}

/**
 * A form in a dialog. `save` may fail: the form stays, and shows what is wrong beside the input that the
 * server names, or below all. What `save` gives is called once the form has closed.
 */
export function formDialog(title: string, parts: Child[], label: string, save: () => Promise<void | (() => void)>): Dialog {
  const fault = h("p", { class: "fault", role: "alert" });
  const go = h("button", { type: "submit", class: "button primary" }, label);
  const form = h("form", { class: "form", novalidate: true, on: { submit: (event: Event) => void run(event) } },
    ...parts, fault, h("div", { class: "form-actions" }, button(text.cancel, () => shown.close()), go));
  let then: void | (() => void);
  const shown = dialog(title, [form], [], () => then?.());
  form.querySelector<HTMLElement>("input, select, textarea")?.focus();
  const run = async (event: Event): Promise<void> => {
    event.preventDefault();
    setText(fault, "");
    for (const input of form.querySelectorAll<HTMLElement>("[aria-invalid]")) setFault(input, "");
    go.disabled = true;
    try {
      then = await save();
      shown.close();
    } catch (error) {
      if (!showAtField(form, error)) setText(fault, explain(error));
    }
    go.disabled = false;
  };
  return shown;
}

function showAtField(form: HTMLFormElement, error: unknown): boolean {
  const name = error instanceof ApiError ? error.field : "";
  const input = name && form.querySelector<HTMLElement>(`[name="${CSS.escape(name)}"]`);
  if (!input) return false;
  setFault(input, sentence((error as ApiError).message.replace(`${name}: `, "")));
  input.focus();
  return true;
}
