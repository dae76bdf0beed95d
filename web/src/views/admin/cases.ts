import { part } from "../../api";
import type { App } from "../../app";
import { explain } from "../../explain";
import { listing } from "../../listing";
import { format, text } from "../../text";
import { broken, button, dialog, empty, fill, h, loading, type Child } from "../../ui";
import type { Part } from "../admin";
import { head } from "./shared";

interface Case {
  name: string;
  title: string;
  hash: string;
  grade: string;
  grade_reason: string;
  groups: { name: string; label: string; cuttable: boolean }[];
}

interface Check {
  date: string;
  software: string;
  quick: boolean;
  faults: number;
  findings: { level: string; where: string; text: string }[];
  field?: { gain_p999?: number; gain_max?: number; fold_share?: number; jumps?: number };
}

const KINDS: Record<string, string> = { fit: "good", "fit with warnings": "act", unfit: "now", outdated: "look", unchecked: "look", broken: "now" };
const LEVELS = ["fault", "error", "warning", "note"];

export const cases: Part = (root, app) => {
  const t = text.admin.cases;
  const list = listing<Case>(text.admin.parts.cases, [
    { label: t.name, cell: (one) => h("b", {}, one.name) },
    { label: t.title, cell: (one) => one.title || format.none },
    { label: t.groups, number: true, wide: true, cell: (one) => format.number(one.groups?.length ?? 0) },
    { label: t.cuttable, cell: (one) => cuttable(one) || format.none },
    { label: t.grade, cell: grade },
    { label: t.hash, wide: true, cell: (one) => h("code", {}, one.hash || format.none) },
    { label: t.actions, hidden: true, cell: (one) => one.grade !== "unchecked" && button(t.report, () => report(app, one), { kind: "quiet", class: "small" }) },
  ], async () => (await app.api.get<{ cases: Case[] }>("/cases")).cases, () => empty(t.none, t.noneHint));
  root.append(head(text.admin.parts.cases, t.hint), list.element);
  return () => list.end();
};

// One after the other, as in a sentence.
function cuttable({ groups = [] }: Case): string {
  const names = groups.filter((group) => group.cuttable).map(({ label }) => label);
  return names.map((name, i) => (i ? name.toLowerCase() : name)).join(", ");
}

function grade(one: Case): Child {
  return h("span", { class: `badge ${KINDS[one.grade] ?? ""}`, title: one.grade_reason || undefined }, text.admin.cases.grades[one.grade] ?? one.grade);
}

function report(app: App, one: Case): void {
  const t = text.admin.cases;
  const body = h("div", { class: "report" }, loading());
  const shown = dialog(t.reportOf(one.name), [body]);
  shown.element.classList.add("wide");
  app.api.get<{ check: Check | null }>(`/cases/${part(one.name)}`).then(
    ({ check }) => fill(body, ...(check ? findings(one, check) : [empty(t.grades[one.grade] ?? one.grade, one.grade_reason)])),
    (error: unknown) => fill(body, broken(text.listBroken, explain(error))));
}

function findings(one: Case, check: Check): Child[] {
  const t = text.admin.cases;
  const figure = (label: string, value: string): HTMLElement => h("div", {}, h("dt", {}, label), h("dd", { class: "number" }, value));
  const sorted = [...check.findings].sort((a, b) => LEVELS.indexOf(a.level) - LEVELS.indexOf(b.level));
  return [
    h("dl", { class: "figures" },
      h("div", {}, h("dt", {}, t.grade), h("dd", {}, grade(one))),
      figure(t.checked, `${format.time(Date.parse(check.date))}${check.quick ? ` ${t.quick}` : ""}`),
      figure(t.folds, format.percent(check.field?.fold_share, 3)),
      figure(t.gain, format.number(check.field?.gain_p999, 2)),
      figure(t.gainMost, format.number(check.field?.gain_max, 2)),
      figure(t.jumps, format.number(check.field?.jumps))),
    h("div", { class: "table-scroll", tabindex: 0, role: "region", "aria-label": t.findings }, h("table", {},
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, t.level), h("th", { scope: "col" }, t.where), h("th", { scope: "col" }, t.finding))),
      h("tbody", {}, ...sorted.map((finding) => h("tr", {},
        h("td", {}, h("span", { class: `badge ${finding.level === "warning" ? "act" : finding.level === "note" ? "" : "now"}` }, t.levels[finding.level] ?? finding.level)),
        h("td", {}, finding.where), h("td", {}, finding.text)))))),
  ];
}
