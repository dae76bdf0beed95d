// #/admin/PART: accounts, trainees, stations, cases, courses, the audit log, tokens.
import type { Role } from "../api";
import type { App, View } from "../app";
import { routeTo } from "../router";
import { text } from "../text";
import { empty, h } from "../ui";
import { accounts } from "./admin/accounts";
import { audit } from "./admin/audit";
import { cases } from "./admin/cases";
import { courses } from "./admin/courses";
import { stations } from "./admin/stations";
import { tokens } from "./admin/tokens";
import { trainees } from "./admin/trainees";

/** Fills `root` with its heading and list; returns its clean-up. */
export type Part = (root: HTMLElement, app: App) => () => void;

const PARTS: [name: keyof typeof text.admin.parts, part: Part, roles: Role[]][] = [
  ["stations", stations, ["instructor", "technician"]],
  ["cases", cases, ["instructor", "technician"]],
  ["trainees", trainees, ["instructor"]],
  ["courses", courses, ["instructor"]],
  ["accounts", accounts, ["instructor", "technician"]],
  ["tokens", tokens, ["instructor", "technician"]],
  ["audit", audit, ["instructor", "technician"]],
];

export const admin: View = (root, route, app) => {
  const name = route.args[0] ?? "stations";
  const allowed = PARTS.filter(([, , roles]) => roles.includes(app.account!.role));
  const chosen = allowed.find(([one]) => one === name);
  app.title(chosen ? text.admin.parts[chosen[0]] : text.views.admin);
  const links = allowed.map(([one]) => h("a", { class: "tab", href: routeTo("admin", [one]), "aria-current": one === name ? "page" : undefined }, text.admin.parts[one]));
  const content = h("div", { class: "admin-part" });
  root.append(h("div", { class: "page" }, h("nav", { class: "tabs", "aria-label": text.views.admin }, ...links), content));
  if (chosen) return chosen[1](content, app);
  content.append(empty(text.notFound.title, text.notFound.hint));
  return () => {};
};
