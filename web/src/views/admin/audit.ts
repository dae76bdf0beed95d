import { listing } from "../../listing";
import { routeTo } from "../../router";
import { format, text } from "../../text";
import { button, empty, h, select, type Child } from "../../ui";
import type { Part } from "../admin";
import { head } from "./shared";

interface Entry {
  utc_s: number;
  actor: string;
  action: string;
  subject: string;
}

// A session's id is a link, and as long as is needed to tell it from others.
function subject(words: string): Child[] {
  const parts = words.split(/\b([0-9a-f]{32})\b/);
  return words ? parts.map((part, i) => (i % 2 ? h("a", { href: routeTo("session", [part]), title: part, class: "mono" }, part.slice(0, 8)) : part)) : [format.none];
}

export const audit: Part = (root, app) => {
  const t = text.admin.audit;
  const limit = select([["100", t.last(100)], ["1000", t.last(1000)]], "100", { "aria-label": t.howMany, on: { change: () => list.reload() } });
  const list = listing<Entry>(text.admin.parts.audit, [
    { label: t.time, cell: (entry) => h("span", { class: "number" }, format.second(entry.utc_s * 1000)) },
    { label: t.actor, cell: (entry) => h("b", {}, entry.actor) },
    { label: t.action, cell: (entry) => entry.action },
    { label: t.subject, cell: (entry) => h("span", {}, ...subject(entry.subject)) },
  ], async () => (await app.api.get<{ audit: Entry[] }>("/audit", { limit: limit.value })).audit, () => empty(t.none));
  root.append(head(text.admin.parts.audit, t.hint, limit, button(text.reload, () => list.reload())), list.element);
  return () => list.end();
};
