// #/station/NAME: one station's session, as it happens.
import { SessionState } from "wire";
import type { View } from "../app";
import { Dashboard } from "../dashboard";
import { STATE } from "../history";
import { QUIET_MS } from "../live";
import { routeTo } from "../router";
import { FeedSource, markerAt } from "../source";
import { format, text } from "../text";
import { announcer, empty, everySecond, fill, h, icon, loading, setClass, setText, type IconName } from "../ui";
import { SessionControls } from "./session_controls";

const RATE_HZ = 30;

const STATES: Record<SessionState, [icon: IconName, words: keyof typeof text.wall.statuses]> = {
  [SessionState.WAITING]: ["waiting", "waiting"],
  [SessionState.RUNNING]: ["running", "running"],
  [SessionState.PAUSED]: ["paused", "paused"],
  [SessionState.CLOSED]: ["closed", "closed"],
};
const STALE: [icon: IconName, words: string] = ["gone", text.station.unknown];

export const station: View = (root, route, app) => {
  const name = route.args[0] ?? "";
  app.title(text.station.title(name));
  const { feed } = app;
  const source = FeedSource.live(feed, name, RATE_HZ);
  const began = feed.now();
  let heard = 0; // when the last moment came
  const state = (): SessionState | undefined =>
    source.history.count ? source.history.value(source.history.count - 1, STATE) : undefined;

  const badge = h("span", { class: "badge state-badge" });
  const clock = h("span", { class: "session-clock number" });
  const about = h("p", { class: "about quiet-text" });
  const tell = announcer();
  const stale = h("p", { class: "stale badge now" });
  const note = h("p", { class: "badge act", role: "status" });
  const dashboard = new Dashboard(source, { onMarker: (marker) => controls?.placeMarker(marker) });
  const controls = app.account?.role === "instructor" ? new SessionControls(app, {
    station: name,
    case: () => source.session?.caseName ?? "",
    strength: () => source.session?.strength ?? 1,
    trainee: () => source.session?.trainee ?? "",
  }) : undefined;
  if (controls) {
    controls.onPicking = (on) => {
      dashboard.viewport.picking = on;
      setClass(root, "picking", on);
    };
  }
  const trainee = app.account?.role === "trainee";
  const [home, homeName] = trainee ? ["#/sessions", text.views.sessions] : ["#/wall", text.station.wall];
  const waiting = h("div", { class: "station-waiting" }, loading(text.station.waiting(name)));
  root.append(h("header", { class: "station-head" },
    h("div", { class: "station-name" }, h("a", { href: home, class: "button quiet back" }, icon("back"), homeName), h("h1", {}, name), badge, clock, stale, note),
    about, h("a", { class: "button", href: routeTo("scope", [name]) }, text.station.scope)),
    ...(controls ? [controls.element] : []), h("div", { class: "station-main" }, dashboard.element, waiting));

  // For how long nothing is heard, and in which words; undefined: what is shown is how it is.
  const staleness = (): string | undefined => {
    const lost = feed.lostMs();
    if (lost !== undefined) return text.station.lost(lost);
    const age = heard && source.history.count ? feed.now() - heard : 0;
    return age >= QUIET_MS && state() !== SessionState.CLOSED ? text.station.stale(age) : undefined;
  };

  const showBadge = (old: boolean): void => {
    const now = state();
    const key = old ? "old" : String(now);
    if (badge.dataset.state === key) return;
    badge.dataset.state = key;
    const [sign, words] = STATES[now ?? SessionState.WAITING];
    fill(badge, ...(old ? [icon(STALE[0]), STALE[1]] : [icon(sign), text.wall.statuses[words]]));
  };

  const showInstead = (): void => {
    waiting.hidden = source.session !== undefined || source.history.count > 0;
    dashboard.element.inert = !waiting.hidden;
    badge.hidden = source.refused;
    if (waiting.hidden) return;
    const words = text.station;
    const late = feed.link.state === "open" && feed.now() - began > QUIET_MS;
    const key = source.refused ? "refused" : feed.lostMs() !== undefined ? "lost" : source.trouble || late ? "none" : "waiting";
    if (waiting.dataset.kind === key) return;
    waiting.dataset.kind = key;
    const back = h("a", { class: "button", href: home }, homeName);
    if (key === "refused") fill(waiting, trainee ? empty(words.notYours, words.notYoursHint, back) : empty(words.notThere, source.trouble, back));
    else if (key === "lost") fill(waiting, empty(text.wall.unreachable, words.comesBack));
    else if (key === "none") fill(waiting, empty(words.noSession, source.trouble || words.noSessionHint));
    else fill(waiting, loading(words.waiting(name)));
  };

  const showHead = (): void => {
    const now = state();
    const { session } = source;
    const old = staleness();
    showBadge(old !== undefined);
    setText(clock, source.history.count ? format.clock(source.history.end) : "");
    setText(about, session ? [session.trainee || text.station.nobody, session.caseName, text.station.strength(format.percent(session.strength, 0))].join(" · ") : "");
    setText(stale, old ?? "");
    setText(note, source.note);
    note.hidden = !source.note;
    tell(old !== undefined && feed.lostMs() === undefined ? "quiet" : "", old ?? text.link.open); // the frame announces a silent server
    setClass(root, "old", old !== undefined);
    controls?.setReachable(feed.lostMs() === undefined);
    controls?.setState(now);
    controls?.setMarker(markerAt(source, Infinity));
    showInstead();
  };

  const key = (event: KeyboardEvent): void => {
    if (!controls || event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) return;
    if ((event.target as HTMLElement).matches("input, select, textarea")) return;
    if (event.key === "t" && dashboard.viewport.picking) controls.placeMarker(dashboard.viewport.markerAtTip());
    else if (event.key === "Escape" && dashboard.viewport.picking) controls.setPicking(false);
  };
  document.addEventListener("keydown", key);
  const ends = [
    source.onChange((change) => {
      if (change === "moment") heard = feed.now();
      else showHead();
    }),
    everySecond(showHead),
    feed.onLink(showHead),
    () => document.removeEventListener("keydown", key),
    () => dashboard.close(),
    () => source.close(),
  ];
  return () => {
    for (const end of ends) end();
  };
};
