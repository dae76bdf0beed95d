// Signing in with a password or a trainee's code, and the first account of a new server.
import type { Account } from "../api";
import type { App, View } from "../app";
import { mark } from "../shell";
import { text } from "../text";
import { button, explain, field, fill, h, roving, setFault, setText } from "../ui";

const PASSWORD_LEAST = 10;
const CODE_LENGTH = 8;

interface Answer {
  account: Account;
}

/** #/sign-in */
export const signIn: View = (root, route, app) => {
  app.title(text.signIn.title);
  const form = h("div", { id: "sign-in-form", role: "tabpanel" });
  const tabs = (["password", "code"] as const).map((kind) =>
    h("button", { type: "button", role: "tab", class: "tab", "aria-controls": "sign-in-form", data: { kind }, on: { click: () => choose(kind) } }, text.signIn[kind]));
  const choose = (kind: "password" | "code"): void => {
    for (const tab of tabs) {
      tab.setAttribute("aria-selected", String(tab.dataset.kind === kind));
      tab.tabIndex = tab.dataset.kind === kind ? 0 : -1;
    }
    fill(form, kind === "password" ? passwordForm(app) : codeForm(app));
    form.querySelector("input")?.focus();
  };
  const list = h("div", { class: "tabs", role: "tablist", "aria-label": text.signIn.title }, ...tabs);
  roving(list, () => tabs);
  root.append(card(text.signIn.title, list, form));
  choose(route.query.has("code") ? "code" : "password");
  return () => {};
};

/** #/first/SECRET */
export const first: View = (root, route, app) => {
  app.title(text.first.title);
  const name = h("input", { autocomplete: "username", maxlength: 63, spellcheck: "false" });
  const password = h("input", { type: "password", autocomplete: "new-password", maxlength: 128 });
  const again = h("input", { type: "password", autocomplete: "new-password", maxlength: 128 });
  const form = submitting(text.first.submit, [
    field(text.first.name, name, text.first.nameHint),
    field(text.first.password, password, text.first.passwordHint),
    field(text.first.again, again),
  ], () => {
    const faults: [HTMLInputElement, string][] = [
      [name, name.value.trim() ? "" : text.first.needName],
      [password, password.value.length < PASSWORD_LEAST ? text.first.short : ""],
      [again, again.value === password.value ? "" : text.first.different],
    ];
    return !show(faults) && app.api.post<Answer>("/first", { secret: route.args[0] ?? "", name: name.value.trim(), password: password.value });
  }, app);
  root.append(card(text.first.title, h("p", { class: "lead" }, text.first.hint), form));
  name.focus();
  return () => {};
};

function passwordForm(app: App): HTMLElement {
  const name = h("input", { autocomplete: "username", maxlength: 63, spellcheck: "false", autocapitalize: "none" });
  const password = h("input", { type: "password", autocomplete: "current-password", maxlength: 128 });
  return submitting(text.signIn.submit, [field(text.signIn.name, name), field(text.signIn.secret, password)], () => {
    const faults: [HTMLInputElement, string][] = [
      [name, name.value.trim() ? "" : text.signIn.needName],
      [password, password.value ? "" : text.signIn.needPassword],
    ];
    return !show(faults) && app.api.post<Answer>("/sign-in", { name: name.value.trim(), password: password.value });
  }, app);
}

function codeForm(app: App): HTMLElement {
  const code = h("input", { class: "code", autocomplete: "one-time-code", maxlength: CODE_LENGTH + 1, spellcheck: "false", autocapitalize: "characters" });
  return submitting(text.signIn.submit, [field(text.signIn.codeLabel, code, text.signIn.codeHint)], () => {
    const plain = code.value.replace(/[\s-]/g, "").toUpperCase();
    return !show([[code, plain.length === CODE_LENGTH ? "" : text.signIn.needCode]]) && app.api.post<Answer>("/sign-in", { code: plain });
  }, app);
}

// Shows what is wrong and goes to the first of it; true where anything is.
function show(faults: [HTMLInputElement, string][]): boolean {
  for (const [input, fault] of faults) setFault(input, fault);
  const bad = faults.find(([, fault]) => fault);
  bad?.[0].focus();
  return bad !== undefined;
}

function submitting(label: string, parts: HTMLElement[], send: () => false | Promise<Answer>, app: App): HTMLElement {
  const fault = h("p", { class: "fault form-fault", role: "alert" });
  const go = button(label, () => {}, { kind: "primary", type: "submit", class: "wide" });
  const submit = async (event: Event): Promise<void> => {
    event.preventDefault();
    setText(fault, "");
    const sent = send();
    if (!sent) return;
    go.disabled = true;
    try {
      app.signedIn((await sent).account);
    } catch (error) {
      setText(fault, explain(error));
    }
    go.disabled = false;
  };
  return h("form", { class: "form", novalidate: true, on: { submit: (event: Event) => void submit(event) } }, ...parts, fault, go);
}

function card(title: string, ...content: HTMLElement[]): HTMLElement {
  return h("div", { class: "sign-in-page" }, h("div", { class: "sign-in-card" },
    h("div", { class: "brand large" }, mark(), h("span", {}, text.product)), h("h1", {}, title), ...content));
}
