// Dialogs, questions and forms in dialogs, and short words at the edge. They are opened by what happens, not by
// what a view's state is; each is a small tree of its own.
import { signal, useSignal } from "@preact/signals";
import { render, type ComponentChildren } from "preact";
import { useEffect, useId, useLayoutEffect, useRef } from "preact/hooks";
import { ApiError } from "../api";
import { explain } from "../explain";
import { text } from "../text";
import { Icon } from "./icon";
import { Button, FaultsOf, type Faults } from "./parts";

export interface DialogOptions {
  title: string;
  wide?: boolean;
  focus?: string; // selector of what has the focus at first; else the browser chooses
  body(close: () => void): ComponentChildren;
  footer?(close: () => void): ComponentChildren;
  closed?(): void; // however it was closed; the focus is back then
}

/** A modal dialog: the browser keeps the focus inside, Escape closes, the focus goes back after. Returns what closes it. */
export function openDialog({ closed, ...options }: DialogOptions): () => void {
  const before = document.activeElement;
  const place = document.createElement("div");
  document.body.append(place);
  const end = (): void => {
    render(null, place);
    place.remove();
    if (before instanceof HTMLElement && before.isConnected) before.focus();
    closed?.();
  };
  render(<Dialog {...options} end={end} />, place);
  return () => place.querySelector("dialog")?.close();
}

function Dialog({ title, wide, focus, body, footer, end }: Omit<DialogOptions, "closed"> & { end(): void }) {
  const id = useId();
  const element = useRef<HTMLDialogElement>(null);
  const close = (): void => element.current!.close();
  useLayoutEffect(() => {
    element.current!.showModal();
    if (focus) element.current!.querySelector<HTMLElement>(focus)?.focus();
  }, []);
  // A drag that ends on the backdrop is a click on the dialog, too: selecting text must not close it.
  const outside = ({ target, clientX, clientY }: MouseEvent): boolean => {
    const { left, right, top, bottom } = element.current!.getBoundingClientRect();
    return target === element.current && (clientX < left || clientX > right || clientY < top || clientY > bottom);
  };
  const pressed = useRef(false); // on the backdrop
  return (
    <dialog class={`dialog ${wide ? "wide" : ""}`} aria-labelledby={id} ref={element} onClose={end}
      onPointerDown={(event) => (pressed.current = outside(event))} onClick={(event) => pressed.current && outside(event) && close()}>
      <header><h2 id={id}>{title}</h2><button type="button" class="button quiet icon-only" aria-label={text.close} onClick={close}><Icon name="close" /></button></header>
      <div class="dialog-body">{body(close)}</div>
      {footer && <footer>{footer(close)}</footer>}
    </dialog>
  );
}

/** What an action gives: nothing, or what to do once the dialog has closed. */
export type Then = void | (() => void);

/** Asks before an action that cannot be undone. `act` may fail: the dialog stays and says why. */
export function confirm(title: string, hint: string, label: string, act: () => Promise<Then>): void {
  const fault = signal("");
  const busy = signal(false);
  let then: Then;
  const run = async (close: () => void): Promise<void> => {
    busy.value = true;
    try {
      then = await act();
      close();
    } catch (error) {
      fault.value = explain(error);
      busy.value = false;
    }
  };
  const Footer = ({ close }: { close(): void }) => (
    <><Button onClick={close}>{text.cancel}</Button><Button kind="danger" disabled={busy.value} onClick={() => void run(close)}>{label}</Button></>);
  const Fault = () => <p class="fault" role="alert">{fault.value}</p>;
  openDialog({ title, focus: "footer button", body: () => <><p>{hint}</p><Fault /></>, footer: (close) => <Footer close={close} />, closed: () => then?.() });
}

/** What a form's inputs hold, by their names. A box that is not ticked is "". */
export type Values = Readonly<Record<string, string>>;

export interface FormProps {
  label: string; // of the button that sends it
  class?: string; // of that button
  children: ComponentChildren; // fields whose inputs have names
  check?(values: Values): Faults; // what can be told before it is sent
  send(values: Values): Promise<void>; // may fail: the form says why, beside the input that the server names
  cancel?: () => void;
}

/** A form that reads its inputs when it is sent. */
export function Form({ label, class: names, children, check, send, cancel }: FormProps) {
  const faults = useSignal<Faults>({});
  const fault = useSignal("");
  const busy = useSignal(false);
  const element = useRef<HTMLFormElement>(null);
  useEffect(() => {
    const first = Object.entries(faults.value).find(([, words]) => words)?.[0];
    if (first) element.current?.querySelector<HTMLElement>(`[name="${CSS.escape(first)}"]`)?.focus();
  }, [faults.value]);
  const run = async (event: Event): Promise<void> => {
    event.preventDefault();
    const values = valuesOf(element.current!);
    fault.value = "";
    faults.value = check?.(values) ?? {};
    if (Object.values(faults.value).some(Boolean)) return;
    busy.value = true;
    try {
      await send(values);
    } catch (error) {
      const name = error instanceof ApiError ? error.field : "";
      if (name && name in values) faults.value = { [name]: explain(error) };
      else fault.value = explain(error);
    }
    busy.value = false;
  };
  const go = <button type="submit" class={`button primary ${names ?? ""}`} disabled={busy.value}>{label}</button>;
  return (
    <FaultsOf.Provider value={faults}>
      <form class="form" noValidate ref={element} onSubmit={(event) => void run(event)}>
        {children}
        <p class="fault form-fault" role="alert">{fault.value}</p>
        {cancel ? <div class="form-actions"><Button onClick={cancel}>{text.cancel}</Button>{go}</div> : go}
      </form>
    </FaultsOf.Provider>
  );
}

function valuesOf(form: HTMLFormElement): Values {
  const values: Record<string, string> = {};
  for (const input of form.querySelectorAll<HTMLInputElement>("[name]"))
    if (input.type !== "radio" || input.checked) values[input.name] = input.type === "checkbox" && !input.checked ? "" : input.value;
  return values;
}

/** A form in a dialog, which closes once it is sent. */
export function openForm(title: string, label: string, fields: ComponentChildren, send: (values: Values) => Promise<Then>, check?: (values: Values) => Faults): void {
  let then: Then;
  openDialog({
    title, focus: "input, select, textarea", closed: () => then?.(),
    body: (close) => (
      <Form label={label} cancel={close} {...(check ? { check } : {})} send={async (values) => {
        then = await send(values);
        close();
      }}>{fields}</Form>),
  });
}

// ---- words that come and go ----------------------------------------------------------------------------

const TOAST_MS = { done: 4000, fault: 8000 };
const toasts = signal<readonly { id: number; message: string; kind: keyof typeof TOAST_MS }[]>([]);
let made = 0;

/** A short word at the edge, read aloud; goes by itself. */
export function toast(message: string, kind: keyof typeof TOAST_MS = "done"): void {
  const id = ++made;
  toasts.value = [...toasts.value, { id, message, kind }];
  setTimeout(() => (toasts.value = toasts.value.filter((one) => one.id !== id)), TOAST_MS[kind]);
}

/** What went wrong, as a word at the edge. */
export const toastFault = (error: unknown): void => toast(explain(error), "fault");

export function Toasts() {
  return <>{toasts.value.map(({ id, message, kind }) => (
    <div key={id} class={`toast ${kind}`}><Icon name={kind === "done" ? "quiet" : "act"} /><span>{message}</span></div>))}</>;
}

// ---- secrets --------------------------------------------------------------------------------------------

/** A secret that is shown once, and the command that it is for where there is one. */
export function showSecret(title: string, secret: string, hint: string, command = ""): void {
  const copy = async (): Promise<void> => {
    try {
      await navigator.clipboard.writeText(command || secret);
      toast(text.copied);
    } catch {
      toast(text.copyYourself, "fault");
    }
  };
  openDialog({
    title, wide: command !== "",
    body: () => <><output class={`secret ${command && "command"}`} tabIndex={0}>{command || secret}</output><p class="quiet-text">{hint}</p></>,
    footer: (close) => <><Button icon="copy" onClick={() => void copy()}>{command ? text.copyCommand : text.copy}</Button><Button kind="primary" onClick={close}>{text.done}</Button></>,
  });
}
