// Small helpers over the DOM. No style attributes: the pages' policy forbids them; use classes, or
// element.style for what is computed.

type Child = Node | string | undefined | null | false;
type Listener = (event: never) => void;
interface Props {
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
  for (const child of children) if (child !== undefined && child !== null && child !== false) element.append(child);
  return element;
}

/** Sets a text only where it is another: nothing is laid out again for what stays the same. */
export function setText(element: Element, value: string): void {
  if (element.textContent !== value) element.textContent = value;
}

export function setClass(element: Element, name: string, on: boolean): void {
  if (element.classList.contains(name) !== on) element.classList.toggle(name, on);
}
