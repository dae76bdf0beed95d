import { part } from "../../api";
import type { App } from "../../app";
import { Badge, Button, confirm, Empty, Field, Head, Listing, openForm, RowButton, showSecret, useLoaded } from "../../kit";
import { format, text } from "../../text";
import type { Part } from "./part";

interface Token {
  id: string | number;
  kind: "cookie" | "token";
  name: string;
  created_utc_s: number;
  until_utc_s: number;
  used_utc_s: number | null;
  current: boolean;
}

const When = ({ utc }: { utc: number | null }) => <span class="number">{utc ? format.time(utc * 1000) : format.none}</span>;

export const Tokens: Part = ({ app }) => {
  const t = text.admin.tokens;
  const list = useLoaded(async () => (await app.api.get<{ tokens: Token[] }>("/tokens")).tokens);
  const remove = (token: Token): void => confirm(t.removeTitle, t.removeHint, t.remove, async () => {
    await app.api.delete(`/tokens/${part(String(token.id))}`);
    list.reload();
  });
  return (
    <>
      <Head title={text.admin.parts.tokens} hint={t.hint}><Button kind="primary" icon="plus" onClick={() => make(app, list.reload)}>{t.add}</Button></Head>
      <Listing caption={text.admin.parts.tokens} of={list} none={<Empty title={t.none} />} keyOf={(token) => token.id} columns={[
        { label: t.kind, cell: (token) => t.kinds[token.kind] },
        { label: t.name, cell: (token) => (token.current ? <Badge kind="good">{t.current}</Badge> : <b>{token.name || format.none}</b>) },
        { label: t.created, cell: (token) => <When utc={token.created_utc_s} /> },
        { label: t.used, cell: (token) => <When utc={token.used_utc_s} /> },
        { label: t.until, cell: (token) => <When utc={token.until_utc_s} /> },
        { label: t.actions, hidden: true, cell: (token) => <RowButton disabled={token.current} onClick={() => remove(token)}>{t.remove}</RowButton> },
      ]} />
    </>
  );
};

function make(app: App, made: () => void): void {
  const t = text.admin.tokens;
  openForm(t.add, t.add, <Field label={t.name} hint={t.nameHint}><input name="name" maxLength={63} autocomplete="off" /></Field>, async ({ name }) => {
    const answer = await app.api.post<{ token: string; until_utc_s: number }>("/tokens", { name: name!.trim() });
    made();
    return () => showSecret(t.codeTitle(name!.trim()), answer.token, t.codeHint(format.time(answer.until_utc_s * 1000)));
  });
}
