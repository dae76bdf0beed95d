import { useSignal } from "@preact/signals";
import { part, type Role } from "../../api";
import type { App } from "../../app";
import { Badge, Button, confirm, Empty, Field, Head, Listing, openForm, RowButton, Select, toast, useLoaded } from "../../kit";
import { format, text } from "../../text";
import type { Part } from "./part";

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

export const Accounts: Part = ({ app }) => {
  const t = text.admin.accounts;
  const list = useLoaded(async () => (await app.api.get<{ accounts: Listed[] }>("/accounts")).accounts);
  const remove = (one: Listed): void => confirm(t.removeTitle(one.name), t.removeHint, t.remove, async () => {
    await app.api.delete(`/accounts/${part(one.name)}`);
    list.reload();
  });
  const signOut = (one: Listed): void => confirm(t.signOutTitle(one.name), t.signOutHint, t.signOut, async () => {
    await app.api.post(`/accounts/${part(one.name)}/sign-out`);
    toast(t.signedOut(one.name));
  });
  return (
    <>
      <Head title={text.admin.parts.accounts} hint={t.hint}>
        <Button kind="primary" icon="plus" onClick={() => void make(app, list.reload)}>{t.add}</Button>
      </Head>
      <Listing caption={text.admin.parts.accounts} of={list} none={<Empty title={t.none} />} keyOf={(one) => one.name} columns={[
        { label: t.name, cell: (one) => <b>{one.name}</b> },
        { label: t.role, cell: (one) => text.roles[one.role] ?? one.role },
        { label: t.trainee, cell: (one) => one.trainee || format.none },
        { label: t.signIn, cell: (one) => <Badge kind={one.can_sign_in ? "good" : ""}>{one.can_sign_in ? t.can : t.cannot}</Badge> },
        { label: t.created, cell: (one) => <span class="number">{format.date(one.created_utc_s * 1000)}</span> },
        { label: t.actions, hidden: true, cell: (one) => managed(app).includes(one.role) && (
          <span class="row-actions">
            <RowButton onClick={() => change(app, one, list.reload)}>{t.change}</RowButton>
            <RowButton onClick={() => signOut(one)}>{t.signOut}</RowButton>
            <RowButton disabled={one.name === app.account!.name} onClick={() => remove(one)}>{t.remove}</RowButton>
          </span>) },
      ]} />
    </>
  );
};

const roleOptions = (app: App): [string, string][] => managed(app).map((role) => [role, text.roles[role]!]);

function NewFields({ app, trainees }: { app: App; trainees: readonly string[] }) {
  const t = text.admin.accounts;
  const role = useSignal<string>(app.account!.role);
  return (
    <>
      <Field label={t.name}><input name="name" maxLength={63} autocomplete="off" spellcheck={false} /></Field>
      <Field label={t.role}><Select name="role" options={roleOptions(app)} value={role.value} onChoose={(chosen) => (role.value = chosen)} /></Field>
      <Field label={t.trainee} hint={t.traineeHint} hidden={role.value !== "trainee"}>
        <Select name="trainee" options={[["", t.chooseTrainee], ...trainees.map((name) => [name, name] as const)]} />
      </Field>
      <Field label={t.password} hint={t.passwordHint}><input name="password" type="password" autocomplete="new-password" maxLength={128} /></Field>
    </>
  );
}

async function make(app: App, made: () => void): Promise<void> {
  const t = text.admin.accounts;
  const known = await app.api.get<{ trainees: { name: string }[] }>("/trainees").then((answer) => answer.trainees, () => []);
  openForm(t.add, t.add, <NewFields app={app} trainees={known.map(({ name }) => name)} />, async ({ name, role, trainee, password }) => {
    await app.api.post("/accounts", { name: name!.trim(), role, password, ...(role === "trainee" ? { trainee } : {}) });
    toast(t.added(name!.trim()));
    made();
  });
}

function change(app: App, one: Listed, changed: () => void): void {
  const t = text.admin.accounts;
  const roles = roleOptions(app).filter(([value]) => value !== "trainee" || one.role === "trainee");
  openForm(t.changeTitle(one.name), text.save, <>
    <Field label={t.name}><input name="name" defaultValue={one.name} maxLength={63} autocomplete="off" spellcheck={false} /></Field>
    <Field label={t.role}><Select name="role" options={roles} value={one.role} disabled={one.role === "trainee"} /></Field>
    <Field label={t.newPassword} hint={t.keepHint}><input name="password" type="password" autocomplete="new-password" maxLength={128} /></Field>
    <p class="quiet-text">{t.changeHint}</p>
  </>, async ({ name, role, password }) => {
    const wanted = name!.trim();
    const body = { ...(wanted !== one.name ? { name: wanted } : {}), ...(role !== one.role ? { role } : {}), ...(password ? { password } : {}) };
    if (Object.keys(body).length) await app.api.patch(`/accounts/${part(one.name)}`, body);
    if (one.name === app.account!.name && wanted !== one.name) return () => location.reload(); // the frame has the name, too
    toast(t.changed(wanted));
    changed();
    return undefined;
  });
}
