// #/admin/PART: stations, trainees, accounts, sign-ins, the audit log. #/library/PART: cases and tasks.
import { useEffect } from "preact/hooks";
import type { Role } from "../api";
import type { View } from "../app";
import { Empty, view } from "../kit";
import { routeTo } from "../router";
import { text } from "../text";
import { Accounts } from "./admin/accounts";
import { Audit } from "./admin/audit";
import { Cases } from "./admin/cases";
import type { Part } from "./admin/part";
import { Stations } from "./admin/stations";
import { Tasks } from "./admin/tasks";
import { Tokens } from "./admin/tokens";
import { Trainees } from "./admin/trainees";

const STAFF: Role[] = ["instructor", "technician"];

type Parts = [name: keyof typeof text.admin.parts, part: Part, roles: Role[]][];

const SETUP: Parts = [
  ["stations", Stations, STAFF],
  ["trainees", Trainees, ["instructor"]],
  ["accounts", Accounts, STAFF],
  ["tokens", Tokens, STAFF],
  ["audit", Audit, STAFF],
];

const LIBRARY: Parts = [
  ["cases", Cases, STAFF],
  ["tasks", Tasks, STAFF],
];

const viewOf = (title: string, parts: Parts): View => view(({ route, app }) => {
  const name = route.args[0] ?? parts[0]![0];
  const allowed = parts.filter(([, , roles]) => roles.includes(app.account!.role));
  const chosen = allowed.find(([one]) => one === name);
  useEffect(() => app.title(chosen ? text.admin.parts[chosen[0]] : title), [name]);
  const Chosen = chosen?.[1];
  return (
    <div class="page">
      <nav class="tabs" aria-label={title}>
        {allowed.map(([one]) => <a key={one} class="tab" href={routeTo(route.name, [one])} aria-current={one === name ? "page" : undefined}>{text.admin.parts[one]}</a>)}
      </nav>
      <div class="admin-part">{Chosen ? <Chosen app={app} /> : <Empty title={text.notFound.title} hint={text.notFound.hint} />}</div>
    </div>
  );
});

export const admin = viewOf(text.views.admin, SETUP);
export const library = viewOf(text.views.library, LIBRARY);
