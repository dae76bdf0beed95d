// #/sessions?trainee=&course=&case=&before=: what was trained, newest first.
import { part } from "../api";
import type { App, View } from "../app";
import { listing } from "../listing";
import { routeTo } from "../router";
import { format, text } from "../text";
import { button, confirm, empty, explain, h, select, setText, toast, type Props } from "../ui";

interface Session {
  id: string;
  station: string;
  trainee: string | null;
  case: string;
  start_utc_s: number;
  end_utc_s: number | null;
  state: string;
  steps: number;
  missing: number;
}

const LIMIT = 50;
const FILTERS = ["trainee", "course", "case"] as const;
type Filter = (typeof FILTERS)[number];

export const sessions: View = (root, route, app) => {
  const t = text.sessions;
  app.title(text.views.sessions);
  const asked: Record<string, string> = Object.fromEntries([...FILTERS, "before"].map((name) => [name, route.query.get(name) ?? ""]));
  const chosen = new Set<string>();
  let next: string | null = null;

  const load = async (): Promise<Session[]> => {
    const answer = await app.api.get<{ sessions: Session[]; next: string | number | null }>("/sessions", { ...asked, limit: LIMIT });
    next = answer.next === null ? null : String(answer.next);
    chosen.clear();
    showPaging();
    return answer.sessions;
  };
  const filtered = (): boolean => FILTERS.some((name) => asked[name] !== "");
  const none = (): HTMLElement => (filtered() ? empty(t.noneFound, t.noneFoundHint, button(t.clear, () => go({ trainee: "", course: "", case: "", before: "" })))
    : empty(t.none, t.noneHint));

  const compare = button(t.compare, () => {
    const [one, other] = [...chosen];
    location.hash = routeTo("session", [one!], { with: other! });
  }, { disabled: true });
  const older = button(t.older, () => go({ before: next ?? "" }));
  const newest = button(t.newest, () => go({ before: "" }));
  const hint = h("p", { class: "hint", role: "status" });
  const showPaging = (): void => {
    older.disabled = next === null;
    newest.disabled = asked.before === "";
    compare.disabled = chosen.size !== 2;
    setText(hint, chosen.size === 1 ? t.chooseOther : chosen.size > 2 ? t.chooseTwo : "");
  };
  const choose = (id: string, on: boolean): void => {
    if (on) chosen.add(id);
    else chosen.delete(id);
    showPaging();
  };

  const list = listing<Session>(text.views.sessions, columns(app, choose, () => list.reload()), load, none);
  const go = (change: Record<string, string>): void => {
    Object.assign(asked, change);
    history.pushState(null, "", routeTo("sessions", [], asked));
    for (const name of FILTERS) filters[name].value = asked[name]!;
    list.reload();
  };
  const filters = Object.fromEntries(FILTERS.map((name) => {
    const input = select([["", t.all[name]]], "", { "aria-label": t.filters[name], on: { change: () => go({ [name]: input.value, before: "" }) } });
    return [name, input];
  })) as Record<Filter, HTMLSelectElement>;
  void fillFilters(app, filters, asked).catch((error) => toast(explain(error), "fault"));

  root.append(h("div", { class: "page" },
    h("div", { class: "page-head" }, h("h1", {}, text.views.sessions),
      h("div", { class: "filters" }, app.account!.role === "trainee" ? null : filters.trainee, filters.course, filters.case)),
    list.element,
    h("div", { class: "paging" }, hint, compare, newest, older)));
  showPaging();
  return () => list.end();
};

async function fillFilters(app: App, filters: Record<Filter, HTMLSelectElement>, asked: Record<string, string>): Promise<void> {
  const own = app.account!.role === "trainee";
  const [trainees, courses, cases] = await Promise.all([
    own ? [] : app.api.get<{ trainees: { name: string; full_name: string }[] }>("/trainees").then((answer) => answer.trainees),
    own ? app.api.get<{ courses: string[] }>("/me").then((answer) => answer.courses) : app.api.get<{ courses: { name: string }[] }>("/courses").then((answer) => answer.courses.map((course) => course.name)),
    app.api.get<{ cases: { name: string }[] }>("/cases").then((answer) => answer.cases),
  ]);
  const options: Record<Filter, [string, string][]> = {
    trainee: trainees.map(({ name, full_name }) => [name, full_name || name]),
    course: courses.map((name) => [name, name]),
    case: cases.map(({ name }) => [name, name]),
  };
  for (const name of FILTERS) {
    // One that was asked for stays to be seen, even where it is gone.
    if (asked[name] && !options[name].some(([value]) => value === asked[name])) options[name].push([asked[name]!, asked[name]!]);
    filters[name].append(...options[name].map(([value, label]) => h("option", { value }, label)));
    filters[name].value = asked[name] ?? "";
  }
}

function columns(app: App, choose: (id: string, on: boolean) => void, changed: () => void): Parameters<typeof listing<Session>>[1] {
  const t = text.sessions;
  const pick = (session: Session): HTMLElement => {
    const input = h("input", { type: "checkbox", "aria-label": t.choose(format.time(session.start_utc_s * 1000)) });
    input.addEventListener("change", () => choose(session.id, input.checked));
    return input;
  };
  const remove = (session: Session): void => confirm(t.removeTitle, t.removeHint(format.time(session.start_utc_s * 1000), session.trainee ?? t.nobody), t.remove, async () => {
    await app.api.delete(`/sessions/${part(session.id)}`);
    changed();
  });
  const link = (href: string, label: string, more: Props = {}): HTMLElement => h("a", { class: "button quiet small", href, ...more }, label);
  const links = (session: Session): HTMLElement => (session.state === "open"
    ? h("span", { class: "row-actions" }, link(routeTo("station", [session.station]), t.live), link(routeTo("scope", [session.station]), t.scope))
    : h("span", { class: "row-actions" },
      link(`/api/v1/sessions/${part(session.id)}/report`, t.report, { target: "_blank", rel: "noopener" }),
      link(`/api/v1/sessions/${part(session.id)}/trace`, t.trace, { download: true }),
      app.account!.role === "instructor" && button(t.remove, () => remove(session), { kind: "quiet", class: "small" })));
  return [
    { label: t.pick, hidden: true, cell: pick },
    { label: t.start, cell: (session) => h("a", { class: "number", href: routeTo("session", [session.id]) }, format.time(session.start_utc_s * 1000)) },
    ...(app.account!.role === "trainee" ? [] : [{ label: t.trainee, cell: (session: Session) => session.trainee ?? h("span", { class: "quiet-text" }, t.nobody) }]),
    { label: t.case, cell: (session) => session.case },
    { label: t.station, cell: (session) => session.station },
    { label: t.length, number: true, cell: (session) => (session.end_utc_s === null ? format.none : format.clock(session.end_utc_s - session.start_utc_s)) },
    { label: t.state, cell: (session) => h("span", { class: `badge ${t.kinds[session.state] ?? ""}` }, t.states[session.state] ?? session.state) },
    { label: t.missing, number: true, wide: true, cell: (session) => (session.missing ? h("span", { class: "fault" }, format.number(session.missing)) : format.number(0)) },
    { label: t.actions, hidden: true, cell: links },
  ];
}
