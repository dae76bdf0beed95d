import { part } from "../../api";
import type { App } from "../../app";
import { listing } from "../../listing";
import { routeTo } from "../../router";
import { format, text } from "../../text";
import { button, empty, explain, field, formDialog, h, toast } from "../../ui";
import type { Part } from "../admin";
import { head, showCode } from "./shared";

interface Trainee {
  name: string;
  full_name: string | null;
  created_utc_s: number;
  sessions: number;
  erased: boolean;
}

export const trainees: Part = (root, app) => {
  const t = text.admin.trainees;
  const code = async (trainee: Trainee): Promise<void> => {
    try {
      const made = await app.api.post<{ code: string; until_utc_s: number }>(`/trainees/${part(trainee.name)}/code`);
      showCode(t.codeTitle(trainee.full_name || trainee.name), made.code, t.codeHint(format.time(made.until_utc_s * 1000)));
    } catch (error) {
      toast(explain(error), "fault");
    }
  };
  const list = listing<Trainee>(text.admin.parts.trainees, [
    { label: t.name, cell: (trainee) => h("b", {}, trainee.name) },
    { label: t.fullName, cell: (trainee) => trainee.full_name || format.none },
    { label: t.sessions, number: true, cell: (trainee) => h("a", { href: routeTo("sessions", [], { trainee: trainee.name }) }, format.number(trainee.sessions)) },
    { label: t.created, cell: (trainee) => h("span", { class: "number" }, format.date(trainee.created_utc_s * 1000)) },
    { label: t.actions, hidden: true, cell: (trainee) => button(t.code, () => void code(trainee), { kind: "quiet", class: "small" }) },
  ], async () => (await app.api.get<{ trainees: Trainee[] }>("/trainees")).trainees.filter((trainee) => !trainee.erased), () => empty(t.none, t.noneHint));
  root.append(head(text.admin.parts.trainees, t.hint, button(t.add, () => make(app, list.reload), { kind: "primary", icon: "plus" })), list.element);
  return () => list.end();
};

function make(app: App, made: () => void): void {
  const t = text.admin.trainees;
  const name = h("input", { name: "name", maxlength: 63, autocomplete: "off", spellcheck: "false" });
  const full = h("input", { name: "full_name", maxlength: 200, autocomplete: "off" });
  formDialog(t.add, [field(t.name, name, t.nameHint), field(t.fullName, full, t.fullNameHint)], t.add, async () => {
    await app.api.post("/trainees", { name: name.value.trim(), ...(full.value.trim() ? { full_name: full.value.trim() } : {}) });
    toast(t.added(name.value.trim()));
    made();
  });
}
