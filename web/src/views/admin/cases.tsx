import { part } from "../../api";
import type { App } from "../../app";
import { Await, Badge, Empty, Head, Listing, openDialog, RowButton, Table, useLoaded } from "../../kit";
import { format, text } from "../../text";
import type { Part } from "./part";

interface Case {
  name: string;
  title: string;
  hash: string;
  grade: string;
  grade_reason: string;
  groups: { name: string; label: string; cuttable: boolean }[];
}

interface Finding {
  level: string;
  where: string;
  text: string;
}

interface Check {
  date: string;
  software: string;
  quick: boolean;
  faults: number;
  findings: Finding[];
  field?: { gain_p999?: number; gain_max?: number; fold_share?: number; jumps?: number };
}

type Kind = "good" | "look" | "act" | "now" | "";
const KINDS: Record<string, Kind> = { fit: "good", "fit with warnings": "act", unfit: "now", outdated: "look", unchecked: "look", broken: "now" };
const LEVELS = ["fault", "error", "warning", "note"];
const LEVEL_KINDS: Record<string, Kind> = { warning: "act", note: "" };

export const Cases: Part = ({ app }) => {
  const t = text.admin.cases;
  const list = useLoaded(async () => (await app.api.get<{ cases: Case[] }>("/cases")).cases);
  return (
    <>
      <Head title={text.admin.parts.cases} hint={t.hint} />
      <Listing caption={text.admin.parts.cases} of={list} none={<Empty title={t.none} hint={t.noneHint} />} keyOf={(one) => one.name} columns={[
        { label: t.name, cell: (one) => <b>{one.name}</b> },
        { label: t.title, cell: (one) => one.title || format.none },
        { label: t.groups, number: true, wide: true, cell: (one) => format.number(one.groups?.length ?? 0) },
        { label: t.cuttable, cell: (one) => cuttable(one) || format.none },
        { label: t.grade, cell: (one) => <Grade of={one} /> },
        { label: t.hash, wide: true, cell: (one) => <code>{one.hash || format.none}</code> },
        { label: t.actions, hidden: true, cell: (one) => one.grade !== "unchecked" && <RowButton onClick={() => report(app, one)}>{t.report}</RowButton> },
      ]} />
    </>
  );
};

// One after the other, as in a sentence.
function cuttable({ groups = [] }: Case): string {
  const names = groups.filter((group) => group.cuttable).map(({ label }) => label);
  return names.map((name, i) => (i ? name.toLowerCase() : name)).join(", ");
}

const gradeOf = ({ grade }: Case): string => text.admin.cases.grades[grade] ?? grade;

function Grade({ of }: { of: Case }) {
  return <Badge kind={KINDS[of.grade] ?? ""} title={of.grade_reason}>{gradeOf(of)}</Badge>;
}

const report = (app: App, one: Case): void => void openDialog({
  title: text.admin.cases.reportOf(one.name), wide: true, body: () => <div class="report"><Report app={app} of={one} /></div>,
});

function Report({ app, of }: { app: App; of: Case }) {
  const told = useLoaded(() => app.api.get<{ check: Check | null }>(`/cases/${part(of.name)}`));
  return <Await of={told}>{({ check }) => (check ? <Findings of={of} check={check} /> : <Empty title={gradeOf(of)} hint={of.grade_reason} />)}</Await>;
}

function Findings({ of, check }: { of: Case; check: Check }) {
  const t = text.admin.cases;
  const figures: [label: string, value: string][] = [
    [t.checked, `${format.time(Date.parse(check.date))}${check.quick ? ` ${t.quick}` : ""}`],
    [t.folds, format.percent(check.field?.fold_share, 3)],
    [t.gain, format.number(check.field?.gain_p999, 2)],
    [t.gainMost, format.number(check.field?.gain_max, 2)],
    [t.jumps, format.number(check.field?.jumps)],
  ];
  const sorted = [...check.findings].sort((a, b) => LEVELS.indexOf(a.level) - LEVELS.indexOf(b.level));
  return (
    <>
      <dl class="figures">
        <div><dt>{t.grade}</dt><dd><Grade of={of} /></dd></div>
        {figures.map(([label, value]) => <div key={label}><dt>{label}</dt><dd class="number">{value}</dd></div>)}
      </dl>
      <Table caption={t.findings} rows={sorted} keyOf={(finding) => sorted.indexOf(finding)} columns={[
        { label: t.level, cell: ({ level }) => <Badge kind={LEVEL_KINDS[level] ?? "now"}>{t.levels[level] ?? level}</Badge> },
        { label: t.where, cell: (finding) => finding.where },
        { label: t.finding, cell: (finding) => finding.text },
      ]} />
    </>
  );
}
