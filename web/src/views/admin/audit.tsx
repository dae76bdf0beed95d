import { useSignal } from "@preact/signals";
import { Button, Empty, Head, Listing, Select, useLoaded } from "../../kit";
import { routeTo } from "../../router";
import { format, text } from "../../text";
import type { Part } from "./part";

interface Entry {
  utc_s: number;
  actor: string;
  action: string;
  subject: string;
}

// A session's id is a link, and as long as is needed to tell it from others.
function Subject({ words }: { words: string }) {
  const parts = words.split(/\b([0-9a-f]{32})\b/);
  return <span>{words ? parts.map((part, i) => (i % 2 ? <a href={routeTo("session", [part])} title={part} class="mono">{part.slice(0, 8)}</a> : part)) : format.none}</span>;
}

export const Audit: Part = ({ app }) => {
  const t = text.admin.audit;
  const limit = useSignal("100");
  const list = useLoaded(async () => (await app.api.get<{ audit: Entry[] }>("/audit", { limit: limit.value })).audit, [limit.value]);
  return (
    <>
      <Head title={text.admin.parts.audit} hint={t.hint}>
        <Select label={t.howMany} options={[["100", t.last(100)], ["1000", t.last(1000)]]} value={limit.value} onChoose={(chosen) => (limit.value = chosen)} />
        <Button onClick={list.reload}>{text.reload}</Button>
      </Head>
      <Listing caption={text.admin.parts.audit} of={list} none={<Empty title={t.none} />}
        keyOf={(entry) => `${entry.utc_s} ${entry.actor} ${entry.action} ${entry.subject}`} columns={[
          { label: t.time, cell: (entry) => <span class="number">{format.second(entry.utc_s * 1000)}</span> },
          { label: t.actor, cell: (entry) => <b>{entry.actor || t.server}</b> },
          { label: t.action, cell: (entry) => t.actionOf(entry.action) },
          { label: t.subject, cell: (entry) => <Subject words={entry.subject} /> },
        ]} />
    </>
  );
};
