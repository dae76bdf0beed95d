// #/admin/PART: accounts, trainees, stations, cases, courses, the audit log, tokens.
import { useEffect } from "preact/hooks";
import type { Role } from "../api";
import type { View } from "../app";
import { Empty, view } from "../kit";
import { routeTo } from "../router";
import { text } from "../text";
import { Accounts } from "./admin/accounts";
import { Audit } from "./admin/audit";
import { Cases } from "./admin/cases";
import { Courses } from "./admin/courses";
import type { Part } from "./admin/part";
import { Stations } from "./admin/stations";
import { Tokens } from "./admin/tokens";
import { Trainees } from "./admin/trainees";

const PARTS: [name: keyof typeof text.admin.parts, part: Part, roles: Role[]][] = [
  ["stations", Stations, ["instructor", "technician"]],
  ["cases", Cases, ["instructor", "technician"]],
  ["trainees", Trainees, ["instructor"]],
  ["courses", Courses, ["instructor"]],
  ["accounts", Accounts, ["instructor", "technician"]],
  ["tokens", Tokens, ["instructor", "technician"]],
  ["audit", Audit, ["instructor", "technician"]],
];

export const admin: View = view(({ route, app }) => {
  const name = route.args[0] ?? "stations";
  const allowed = PARTS.filter(([, , roles]) => roles.includes(app.account!.role));
  const chosen = allowed.find(([one]) => one === name);
  useEffect(() => app.title(chosen ? text.admin.parts[chosen[0]] : text.views.admin), [name]);
  const Chosen = chosen?.[1];
  return (
    <div class="page">
      <nav class="tabs" aria-label={text.views.admin}>
        {allowed.map(([one]) => <a key={one} class="tab" href={routeTo("admin", [one])} aria-current={one === name ? "page" : undefined}>{text.admin.parts[one]}</a>)}
      </nav>
      <div class="admin-part">{Chosen ? <Chosen app={app} /> : <Empty title={text.notFound.title} hint={text.notFound.hint} />}</div>
    </div>
  );
});
