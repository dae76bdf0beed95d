import { part } from "../../api";
import type { App } from "../../app";
import { explain } from "../../explain";
import { listing } from "../../listing";
import { routeTo } from "../../router";
import { format, text } from "../../text";
import { toast } from "../../kit/dialog";
import { button, confirm, dialog, empty, field, formDialog, h } from "../../ui";
import type { Part } from "../admin";
import { head, showCode } from "./shared";

interface Trainee {
  name: string;
  full_name: string | null;
  created_utc_s: number;
  sessions: number;
  erased: boolean;
}

const path = ({ name }: Trainee, action = ""): string => `/trainees/${part(name)}${action}`;

export const trainees: Part = (root, app) => {
  const t = text.admin.trainees;
  const list = listing<Trainee>(text.admin.parts.trainees, [
    { label: t.name, cell: (trainee) => h("b", {}, trainee.name) },
    { label: t.fullName, cell: (trainee) => trainee.full_name || format.none },
    { label: t.sessions, number: true, cell: (trainee) => h("a", { href: routeTo("sessions", [], { trainee: trainee.name }) }, format.number(trainee.sessions)) },
    { label: t.created, cell: (trainee) => h("span", { class: "number" }, format.date(trainee.created_utc_s * 1000)) },
    { label: t.actions, hidden: true, cell: (trainee) => h("span", { class: "row-actions" }, ...actions(app, trainee, () => list.reload())) },
  ], async () => (await app.api.get<{ trainees: Trainee[] }>("/trainees")).trainees.filter((trainee) => !trainee.erased), () => empty(t.none, t.noneHint));
  root.append(head(text.admin.parts.trainees, t.hint, button(t.add, () => create(app, list.reload), { kind: "primary", icon: "plus" })), list.element);
  return () => list.end();
};

function actions(app: App, trainee: Trainee, changed: () => void): HTMLElement[] {
  const t = text.admin.trainees;
  const small = (label: string, click: () => void): HTMLElement => button(label, click, { kind: "quiet", class: "small" });
  const signOut = (): void => confirm(t.signOutTitle(trainee.name), t.signOutHint, t.signOut, async () => {
    await app.api.post(path(trainee, "/sign-out"));
    toast(t.signedOut(trainee.name));
  });
  const remove = (): void => confirm(t.removeTitle(trainee.name), t.removeHint, t.remove, async () => {
    await app.api.delete(path(trainee));
    changed();
  });
  const erase = (): void => confirm(t.eraseTitle(trainee.name), t.eraseHint(trainee.sessions), t.erase, async () => {
    const erased = await app.api.post<{ pseudonym: string; sessions: string[] }>(path(trainee, "/erase"));
    changed();
    return () => showErased(trainee, erased);
  });
  return [
    small(t.code, () => void showNewCode(app, trainee)), small(t.change, () => change(app, trainee, changed)), small(t.signOut, signOut),
    trainee.sessions ? small(t.erase, erase) : small(t.remove, remove),
  ];
}

async function showNewCode(app: App, trainee: Trainee): Promise<void> {
  const t = text.admin.trainees;
  try {
    const made = await app.api.post<{ code: string; until_utc_s: number }>(path(trainee, "/code"));
    showCode(t.codeTitle(trainee.full_name || trainee.name), made.code, t.codeHint(format.time(made.until_utc_s * 1000)));
  } catch (error) {
    toast(explain(error), "fault");
  }
}

// The traces, which the server does not change, still have the name.
function showErased({ name }: Trainee, { pseudonym, sessions }: { pseudonym: string; sessions: string[] }): void {
  const t = text.admin.trainees;
  dialog(t.erasedTitle(name, pseudonym), [
    h("p", {}, t.erasedHint(sessions.length)),
    h("ul", { class: "names" }, ...sessions.map((id) => h("li", {}, h("a", { href: routeTo("session", [id]) }, id)))),
  ]);
}

const nameInput = (value = ""): HTMLInputElement => h("input", { name: "name", value, maxlength: 63, autocomplete: "off", spellcheck: "false" });
const fullNameInput = (value = ""): HTMLInputElement => h("input", { name: "full_name", value, maxlength: 200, autocomplete: "off" });

function create(app: App, changed: () => void): void {
  const t = text.admin.trainees;
  const [name, full] = [nameInput(), fullNameInput()];
  formDialog(t.add, [field(t.name, name, t.nameHint), field(t.fullName, full, t.fullNameHint)], t.add, async () => {
    await app.api.post("/trainees", { name: name.value.trim(), ...(full.value.trim() ? { full_name: full.value.trim() } : {}) });
    toast(t.added(name.value.trim()));
    changed();
  });
}

function change(app: App, trainee: Trainee, changed: () => void): void {
  const t = text.admin.trainees;
  const [name, full] = [nameInput(trainee.name), fullNameInput(trainee.full_name ?? "")];
  formDialog(t.changeTitle(trainee.name), [field(t.fullName, full, t.fullNameHint), field(t.name, name, t.renameHint)], text.save, async () => {
    const wanted = { name: name.value.trim(), full_name: full.value.trim() };
    const body: Partial<Record<"name" | "full_name", string | null>> = {};
    if (wanted.name !== trainee.name) body.name = wanted.name;
    if (wanted.full_name !== (trainee.full_name ?? "")) body.full_name = wanted.full_name || null;
    if (!Object.keys(body).length) return;
    await app.api.patch(path(trainee), body);
    toast(t.changed(wanted.name));
    changed();
  });
}
