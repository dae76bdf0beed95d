import { part } from "../../api";
import type { App } from "../../app";
import { Button, confirm, Empty, Field, Head, Listing, openDialog, openForm, RowButton, showSecret, toast, toastFault, useLoaded } from "../../kit";
import { routeTo } from "../../router";
import { format, text } from "../../text";
import type { Part } from "./part";

interface Trainee {
  name: string;
  full_name: string | null;
  created_utc_s: number;
  sessions: number;
  erased: boolean;
}

const path = ({ name }: Trainee, action = ""): string => `/trainees/${part(name)}${action}`;

export const Trainees: Part = ({ app }) => {
  const t = text.admin.trainees;
  const list = useLoaded(async () => (await app.api.get<{ trainees: Trainee[] }>("/trainees")).trainees.filter((trainee) => !trainee.erased));
  return (
    <>
      <Head title={text.admin.parts.trainees} hint={t.hint}><Button kind="primary" icon="plus" onClick={() => create(app, list.reload)}>{t.add}</Button></Head>
      <Listing caption={text.admin.parts.trainees} of={list} none={<Empty title={t.none} hint={t.noneHint} />} keyOf={(trainee) => trainee.name} columns={[
        { label: t.name, cell: (trainee) => <b>{trainee.name}</b> },
        { label: t.fullName, cell: (trainee) => trainee.full_name || format.none },
        { label: t.sessions, number: true, cell: (trainee) => <a href={routeTo("sessions", [], { trainee: trainee.name })}>{format.number(trainee.sessions)}</a> },
        { label: t.created, cell: (trainee) => <span class="number">{format.date(trainee.created_utc_s * 1000)}</span> },
        { label: t.actions, hidden: true, cell: (trainee) => <Actions app={app} of={trainee} changed={list.reload} /> },
      ]} />
    </>
  );
};

function Actions({ app, of, changed }: { app: App; of: Trainee; changed(): void }) {
  const t = text.admin.trainees;
  const signOut = (): void => confirm(t.signOutTitle(of.name), t.signOutHint, t.signOut, async () => {
    await app.api.post(path(of, "/sign-out"));
    toast(t.signedOut(of.name));
  });
  const remove = (): void => confirm(t.removeTitle(of.name), t.removeHint, t.remove, async () => {
    await app.api.delete(path(of));
    changed();
  });
  const erase = (): void => confirm(t.eraseTitle(of.name), t.eraseHint(of.sessions), t.erase, async () => {
    const erased = await app.api.post<{ pseudonym: string; sessions: string[] }>(path(of, "/erase"));
    changed();
    return () => showErased(of, erased);
  });
  return (
    <span class="row-actions">
      <RowButton onClick={() => void showNewCode(app, of)}>{t.code}</RowButton>
      <RowButton onClick={() => change(app, of, changed)}>{t.change}</RowButton>
      <RowButton onClick={signOut}>{t.signOut}</RowButton>
      {of.sessions ? <RowButton onClick={erase}>{t.erase}</RowButton> : <RowButton onClick={remove}>{t.remove}</RowButton>}
    </span>
  );
}

async function showNewCode(app: App, trainee: Trainee): Promise<void> {
  const t = text.admin.trainees;
  try {
    const made = await app.api.post<{ code: string; until_utc_s: number }>(path(trainee, "/code"));
    showSecret(t.codeTitle(trainee.full_name || trainee.name), made.code, t.codeHint(format.time(made.until_utc_s * 1000)));
  } catch (error) {
    toastFault(error);
  }
}

// The traces, which the server does not change, still have the name.
function showErased({ name }: Trainee, { pseudonym, sessions }: { pseudonym: string; sessions: string[] }): void {
  const t = text.admin.trainees;
  openDialog({
    title: t.erasedTitle(name, pseudonym),
    body: () => <><p>{t.erasedHint(sessions.length)}</p><ul class="names">{sessions.map((id) => <li key={id}><a href={routeTo("session", [id])}>{id}</a></li>)}</ul></>,
  });
}

const NameInput = ({ value = "", ...field }: { value?: string; name?: string }) => <input {...field} defaultValue={value} maxLength={63} autocomplete="off" spellcheck={false} />;
const FullNameInput = ({ value = "", ...field }: { value?: string; name?: string }) => <input {...field} defaultValue={value} maxLength={200} autocomplete="off" />;

function create(app: App, changed: () => void): void {
  const t = text.admin.trainees;
  openForm(t.add, t.add, <>
    <Field label={t.name} hint={t.nameHint}><NameInput name="name" /></Field>
    <Field label={t.fullName} hint={t.fullNameHint}><FullNameInput name="full_name" /></Field>
  </>, async ({ name, full_name: full }) => {
    await app.api.post("/trainees", { name: name!.trim(), ...(full!.trim() ? { full_name: full!.trim() } : {}) });
    toast(t.added(name!.trim()));
    changed();
  });
}

function change(app: App, trainee: Trainee, changed: () => void): void {
  const t = text.admin.trainees;
  openForm(t.changeTitle(trainee.name), text.save, <>
    <Field label={t.fullName} hint={t.fullNameHint}><FullNameInput name="full_name" value={trainee.full_name ?? ""} /></Field>
    <Field label={t.name} hint={t.renameHint}><NameInput name="name" value={trainee.name} /></Field>
  </>, async (values) => {
    const wanted = { name: values.name!.trim(), full_name: values.full_name!.trim() };
    const body: Partial<Record<"name" | "full_name", string | null>> = {};
    if (wanted.name !== trainee.name) body.name = wanted.name;
    if (wanted.full_name !== (trainee.full_name ?? "")) body.full_name = wanted.full_name || null;
    if (!Object.keys(body).length) return;
    await app.api.patch(path(trainee), body);
    toast(t.changed(wanted.name));
    changed();
  });
}
