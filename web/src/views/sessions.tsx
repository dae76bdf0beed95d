// #/sessions?trainee=&course=&case=&before=: what was trained, newest first.
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { part } from "../api";
import type { App, View } from "../app";
import { Badge, Button, confirm, Empty, Listing, RowButton, Select, toastFault, useLoaded, view, type Column } from "../kit";
import { routeTo } from "../router";
import { format, text } from "../text";

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
type Asked = Record<Filter | "before", string>;
type Options = Record<Filter, readonly (readonly [value: string, label: string])[]>;
const NONE: Asked = { trainee: "", course: "", case: "", before: "" };

export const sessions: View = view(({ route, app }) => {
  const t = text.sessions;
  const asked = useSignal<Asked>({ ...NONE, ...Object.fromEntries([...FILTERS, "before"].map((name) => [name, route.query.get(name) ?? ""])) });
  const chosen = useSignal<readonly string[]>([]); // ids
  const list = useLoaded(async () => {
    const answer = await app.api.get<{ sessions: Session[]; next: string | number | null }>("/sessions", { ...asked.value, limit: LIMIT });
    chosen.value = [];
    return answer;
  }, [asked.value]);
  const next = list.value?.next ?? null;
  const go = (change: Partial<Asked>): void => {
    asked.value = { ...asked.value, ...change };
    history.pushState(null, "", routeTo("sessions", [], asked.value));
  };
  const choose = (id: string, on: boolean): void => void (chosen.value = on ? [...chosen.value, id] : chosen.value.filter((one) => one !== id));
  const size = chosen.value.length;
  const title = text.views.sessionsOf(app.account?.role);
  useEffect(() => app.title(title), []);
  return (
    <div class="page">
      <div class="page-head"><h1>{title}</h1><Filters app={app} asked={asked.value} go={go} /></div>
      <Listing caption={title} of={{ ...list, value: list.value?.sessions }} none={<None asked={asked.value} go={go} />}
        keyOf={(session) => session.id} columns={columns(app, chosen.value, choose, list.reload)} />
      <div class="paging">
        <p class="hint" role="status">{size === 1 ? t.chooseOther : size > 2 ? t.chooseTwo : ""}</p>
        <Button disabled={size !== 2} onClick={() => (location.hash = routeTo("session", [chosen.value[0]!], { with: chosen.value[1]! }))}>{t.compare}</Button>
        <Button disabled={asked.value.before === ""} onClick={() => go({ before: "" })}>{t.newest}</Button>
        <Button disabled={next === null} onClick={() => go({ before: String(next) })}>{t.older}</Button>
      </div>
    </div>
  );
});

interface Asking {
  asked: Asked;
  go(change: Partial<Asked>): void;
}

function None({ asked, go }: Asking) {
  const t = text.sessions;
  if (FILTERS.every((name) => asked[name] === "")) return <Empty title={t.none} hint={t.noneHint} />;
  return <Empty title={t.noneFound} hint={t.noneFoundHint}><Button onClick={() => go(NONE)}>{t.clear}</Button></Empty>;
}

function Filters({ app, asked, go }: Asking & { app: App }) {
  const t = text.sessions;
  const options = useSignal<Options>({ trainee: [], course: [], case: [] });
  useEffect(() => void loadOptions(app).then((loaded) => (options.value = loaded), toastFault), []);
  const shown = FILTERS.filter((name) => name !== "trainee" || app.account!.role !== "trainee");
  // One that was asked for stays to be seen, even where it is gone.
  const all = (name: Filter): Options[Filter] => {
    const known = options.value[name];
    const gone = asked[name] && !known.some(([value]) => value === asked[name]) ? [[asked[name], asked[name]] as const] : [];
    return [["", t.all[name]], ...known, ...gone];
  };
  return (
    <div class="filters">
      {shown.map((name) => <Select key={name} label={t.filters[name]} options={all(name)} value={asked[name]} onChoose={(value) => go({ [name]: value, before: "" })} />)}
    </div>
  );
}

async function loadOptions(app: App): Promise<Options> {
  const own = app.account!.role === "trainee";
  const [trainees, courses, cases] = await Promise.all([
    own ? [] : app.api.get<{ trainees: { name: string; full_name: string }[] }>("/trainees").then((answer) => answer.trainees),
    own ? app.api.get<{ courses: string[] }>("/me").then((answer) => answer.courses) : app.api.get<{ courses: { name: string }[] }>("/courses").then((answer) => answer.courses.map((course) => course.name)),
    app.api.get<{ cases: { name: string }[] }>("/cases").then((answer) => answer.cases),
  ]);
  return {
    trainee: trainees.map(({ name, full_name }) => [name, full_name || name]),
    course: courses.map((name) => [name, name]),
    case: cases.map(({ name }) => [name, name]),
  };
}

function columns(app: App, chosen: readonly string[], choose: (id: string, on: boolean) => void, changed: () => void): Column<Session>[] {
  const t = text.sessions;
  const start = (session: Session): string => format.time(session.start_utc_s * 1000);
  const trainee: Column<Session> = { label: t.trainee, cell: (session) => session.trainee ?? <span class="quiet-text">{t.nobody}</span> };
  return [
    { label: t.pick, hidden: true, cell: (session) => (
      <input type="checkbox" aria-label={t.choose(start(session))} checked={chosen.includes(session.id)} onChange={(event) => choose(session.id, event.currentTarget.checked)} />) },
    { label: t.start, cell: (session) => <a class="number" href={routeTo("session", [session.id])}>{start(session)}</a> },
    ...(app.account!.role === "trainee" ? [] : [trainee]),
    { label: t.case, cell: (session) => session.case },
    { label: t.station, cell: (session) => session.station },
    { label: t.length, number: true, cell: (session) => (session.end_utc_s === null ? format.none : format.clock(session.end_utc_s - session.start_utc_s)) },
    { label: t.state, cell: (session) => <Badge kind={t.kinds[session.state] ?? ""}>{t.states[session.state] ?? session.state}</Badge> },
    { label: t.missing, number: true, wide: true, cell: (session) => (session.missing ? <span class="fault">{format.number(session.missing)}</span> : format.number(0)) },
    { label: t.actions, hidden: true, cell: (session) => <Actions app={app} of={session} start={start(session)} changed={changed} /> },
  ];
}

function Actions({ app, of, start, changed }: { app: App; of: Session; start: string; changed(): void }) {
  const t = text.sessions;
  const remove = (): void => confirm(t.removeTitle, t.removeHint(start, of.trainee ?? t.nobody), t.remove, async () => {
    await app.api.delete(`/sessions/${part(of.id)}`);
    changed();
  });
  const link = "button quiet small";
  if (of.state === "open")
    return <span class="row-actions"><a class={link} href={routeTo("station", [of.station])}>{t.live}</a><a class={link} href={routeTo("scope", [of.station])}>{t.scope}</a></span>;
  return (
    <span class="row-actions">
      <a class={link} href={`/api/v1/sessions/${part(of.id)}/report`} target="_blank" rel="noopener">{t.report}</a>
      <a class={link} href={`/api/v1/sessions/${part(of.id)}/trace`} download>{t.trace}</a>
      {app.account!.role === "instructor" && <RowButton onClick={remove}>{t.remove}</RowButton>}
    </span>
  );
}
