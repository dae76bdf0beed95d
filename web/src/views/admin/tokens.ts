import { part } from "../../api";
import type { App } from "../../app";
import { listing } from "../../listing";
import { format, text } from "../../text";
import { button, confirm, empty, field, formDialog, h } from "../../ui";
import type { Part } from "../admin";
import { head, showCode } from "./shared";

interface Token {
  id: string | number;
  kind: "cookie" | "token";
  name: string;
  created_utc_s: number;
  until_utc_s: number;
  used_utc_s: number | null;
  current: boolean;
}

export const tokens: Part = (root, app) => {
  const t = text.admin.tokens;
  const remove = (token: Token): void => confirm(t.removeTitle, t.removeHint, t.remove, async () => {
    await app.api.delete(`/tokens/${part(String(token.id))}`);
    list.reload();
  });
  const date = (utc: number | null): HTMLElement => h("span", { class: "number" }, utc ? format.time(utc * 1000) : format.none);
  const list = listing<Token>(text.admin.parts.tokens, [
    { label: t.kind, cell: (token) => t.kinds[token.kind] },
    { label: t.name, cell: (token) => (token.current ? h("span", { class: "badge good" }, t.current) : h("b", {}, token.name || format.none)) },
    { label: t.created, cell: (token) => date(token.created_utc_s) },
    { label: t.used, cell: (token) => date(token.used_utc_s) },
    { label: t.until, cell: (token) => date(token.until_utc_s) },
    { label: t.actions, hidden: true, cell: (token) => button(t.remove, () => remove(token), { kind: "quiet", class: "small", disabled: token.current }) },
  ], async () => (await app.api.get<{ tokens: Token[] }>("/tokens")).tokens, () => empty(t.none));
  root.append(head(text.admin.parts.tokens, t.hint, button(t.add, () => make(app, list.reload), { kind: "primary", icon: "plus" })), list.element);
  return () => list.end();
};

function make(app: App, made: () => void): void {
  const t = text.admin.tokens;
  const name = h("input", { name: "name", maxlength: 63, autocomplete: "off" });
  formDialog(t.add, [field(t.name, name, t.nameHint)], t.add, async () => {
    const answer = await app.api.post<{ token: string; until_utc_s: number }>("/tokens", { name: name.value.trim() });
    made();
    return () => showCode(t.codeTitle(name.value.trim()), answer.token, t.codeHint(format.time(answer.until_utc_s * 1000)));
  });
}
