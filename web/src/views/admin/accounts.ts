import { part, type Role } from "../../api";
import type { App } from "../../app";
import { listing } from "../../listing";
import { format, text } from "../../text";
import { toast } from "../../kit/dialog";
import { button, confirm, empty, field, formDialog, h, select } from "../../ui";
import type { Part } from "../admin";
import { head } from "./shared";

interface Listed {
  name: string;
  role: Role;
  trainee: string;
  can_sign_in: boolean;
  created_utc_s: number;
}

const ROLES: Role[] = ["instructor", "technician", "trainee"];

/** Whose accounts one makes and changes; the server refuses others. */
const managed = (app: App): Role[] => (app.account!.role === "instructor" ? ROLES : [app.account!.role]);

export const accounts: Part = (root, app) => {
  const t = text.admin.accounts;
  const remove = (one: Listed): void => confirm(t.removeTitle(one.name), t.removeHint, t.remove, async () => {
    await app.api.delete(`/accounts/${part(one.name)}`);
    list.reload();
  });
  const signOut = (one: Listed): void => confirm(t.signOutTitle(one.name), t.signOutHint, t.signOut, async () => {
    await app.api.post(`/accounts/${part(one.name)}/sign-out`);
    toast(t.signedOut(one.name));
  });
  const actions = (one: Listed): HTMLElement[] => [
    button(t.change, () => change(app, one, list.reload), { kind: "quiet", class: "small" }),
    button(t.signOut, () => signOut(one), { kind: "quiet", class: "small" }),
    button(t.remove, () => remove(one), { kind: "quiet", class: "small", disabled: one.name === app.account!.name }),
  ];
  const list = listing<Listed>(text.admin.parts.accounts, [
    { label: t.name, cell: (one) => h("b", {}, one.name) },
    { label: t.role, cell: (one) => text.roles[one.role] ?? one.role },
    { label: t.trainee, cell: (one) => one.trainee || format.none },
    { label: t.signIn, cell: (one) => h("span", { class: `badge ${one.can_sign_in ? "good" : ""}` }, one.can_sign_in ? t.can : t.cannot) },
    { label: t.created, cell: (one) => h("span", { class: "number" }, format.date(one.created_utc_s * 1000)) },
    { label: t.actions, hidden: true, cell: (one) => h("span", { class: "row-actions" }, ...(managed(app).includes(one.role) ? actions(one) : [])) },
  ], async () => (await app.api.get<{ accounts: Listed[] }>("/accounts")).accounts, () => empty(t.none));
  root.append(head(text.admin.parts.accounts, t.hint, button(t.add, () => void make(app, list.reload), { kind: "primary", icon: "plus" })), list.element);
  return () => list.end();
};

const roleOptions = (app: App): [string, string][] => managed(app).map((role) => [role, text.roles[role]!]);

async function make(app: App, made: () => void): Promise<void> {
  const t = text.admin.accounts;
  const known = await app.api.get<{ trainees: { name: string }[] }>("/trainees").then((answer) => answer.trainees, () => []);
  const name = h("input", { name: "name", maxlength: 63, autocomplete: "off", spellcheck: "false" });
  const role = select(roleOptions(app), app.account!.role, { name: "role" });
  const trainee = select([["", t.chooseTrainee], ...known.map((one): [string, string] => [one.name, one.name])], "", { name: "trainee" });
  const password = h("input", { name: "password", type: "password", autocomplete: "new-password", maxlength: 128 });
  const who = field(t.trainee, trainee, t.traineeHint);
  who.hidden = true;
  role.addEventListener("change", () => (who.hidden = role.value !== "trainee"));
  formDialog(t.add, [field(t.name, name), field(t.role, role), who, field(t.password, password, t.passwordHint)], t.add, async () => {
    await app.api.post("/accounts", { name: name.value.trim(), role: role.value, password: password.value, ...(role.value === "trainee" ? { trainee: trainee.value } : {}) });
    toast(t.added(name.value.trim()));
    made();
  });
}

function change(app: App, one: Listed, changed: () => void): void {
  const t = text.admin.accounts;
  const name = h("input", { name: "name", value: one.name, maxlength: 63, autocomplete: "off", spellcheck: "false" });
  const role = select(roleOptions(app).filter(([value]) => value !== "trainee" || one.role === "trainee"), one.role, { name: "role", disabled: one.role === "trainee" });
  const password = h("input", { name: "password", type: "password", autocomplete: "new-password", maxlength: 128 });
  formDialog(t.changeTitle(one.name), [field(t.name, name), field(t.role, role), field(t.newPassword, password, t.keepHint), h("p", { class: "quiet-text" }, t.changeHint)], text.save, async () => {
    const wanted = name.value.trim();
    const body = { ...(wanted !== one.name ? { name: wanted } : {}), ...(role.value !== one.role ? { role: role.value } : {}), ...(password.value ? { password: password.value } : {}) };
    if (Object.keys(body).length) await app.api.patch(`/accounts/${part(one.name)}`, body);
    if (one.name === app.account!.name && wanted !== one.name) return () => location.reload(); // the frame has the name, too
    toast(t.changed(wanted));
    changed();
  });
}
