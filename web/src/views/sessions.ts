// #/sessions?trainee=&course=&case=&before=: what was trained, newest first.
import { part } from "../api";
import type { App, View } from "../app";
import { explain } from "../explain";
import { listing, type Listing } from "../listing";
import { routeTo, type Route } from "../router";
import { format, text } from "../text";
import { toast } from "../kit/dialog";
import { button, confirm, empty, h, select, setText, type Props } from "../ui";

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
  const page = new Sessions(root, route, app);
  return () => page.close();
};

class Sessions {
  private readonly asked: Record<string, string>;
  private readonly chosen = new Set<string>(); // ids of sessions
  private next: string | null = null; // where the next page begins
  private readonly filters: Record<Filter, HTMLSelectElement>;
  private readonly compare = button(text.sessions.compare, () => this.openBoth(), { disabled: true });
  private readonly older = button(text.sessions.older, () => this.go({ before: this.next ?? "" }));
  private readonly newest = button(text.sessions.newest, () => this.go({ before: "" }));
  private readonly hint = h("p", { class: "hint", role: "status" });
  private readonly list: Listing;

  constructor(root: HTMLElement, route: Route, private readonly app: App) {
    app.title(text.views.sessions);
    this.asked = Object.fromEntries([...FILTERS, "before"].map((name) => [name, route.query.get(name) ?? ""]));
    this.filters = Object.fromEntries(FILTERS.map((name) => [name, this.filter(name)])) as Record<Filter, HTMLSelectElement>;
    this.list = listing<Session>(text.views.sessions, columns(app, (id, on) => this.choose(id, on), () => this.list.reload()), () => this.load(), () => this.none());
    void fillFilters(app, this.filters, this.asked).catch((error) => toast(explain(error), "fault"));
    const { filters } = this;
    root.append(h("div", { class: "page" },
      h("div", { class: "page-head" }, h("h1", {}, text.views.sessions),
        h("div", { class: "filters" }, app.account!.role === "trainee" ? null : filters.trainee, filters.course, filters.case)),
      this.list.element,
      h("div", { class: "paging" }, this.hint, this.compare, this.newest, this.older)));
    this.showPaging();
  }

  close(): void {
    this.list.end();
  }

  private filter(name: Filter): HTMLSelectElement {
    const t = text.sessions;
    const input = select([["", t.all[name]]], "", { "aria-label": t.filters[name], on: { change: () => this.go({ [name]: input.value, before: "" }) } });
    return input;
  }

  private async load(): Promise<Session[]> {
    const answer = await this.app.api.get<{ sessions: Session[]; next: string | number | null }>("/sessions", { ...this.asked, limit: LIMIT });
    this.next = answer.next === null ? null : String(answer.next);
    this.chosen.clear();
    this.showPaging();
    return answer.sessions;
  }

  private none(): HTMLElement {
    const t = text.sessions;
    if (FILTERS.every((name) => this.asked[name] === "")) return empty(t.none, t.noneHint);
    return empty(t.noneFound, t.noneFoundHint, button(t.clear, () => this.go({ trainee: "", course: "", case: "", before: "" })));
  }

  private go(change: Record<string, string>): void {
    Object.assign(this.asked, change);
    history.pushState(null, "", routeTo("sessions", [], this.asked));
    for (const name of FILTERS) this.filters[name].value = this.asked[name]!;
    this.list.reload();
  }

  private choose(id: string, on: boolean): void {
    if (on) this.chosen.add(id);
    else this.chosen.delete(id);
    this.showPaging();
  }

  private openBoth(): void {
    const [one, other] = [...this.chosen];
    location.hash = routeTo("session", [one!], { with: other! });
  }

  private showPaging(): void {
    const t = text.sessions;
    const { size } = this.chosen;
    this.older.disabled = this.next === null;
    this.newest.disabled = this.asked.before === "";
    this.compare.disabled = size !== 2;
    setText(this.hint, size === 1 ? t.chooseOther : size > 2 ? t.chooseTwo : "");
  }
}

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
