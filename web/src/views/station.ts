// #/station/NAME: one station's session, as it happens.
import { SessionState } from "wire";
import type { View } from "../app";
import { Cockpit } from "../cockpit";
import { STATE } from "../history";
import { QUIET_MS } from "../live";
import { routeTo } from "../router";
import { FeedSource, markerAt } from "../source";
import { format, text } from "../text";
import { empty, everySecond, fill, h, icon, loading, setClass, setText, type IconName } from "../ui";
import { Steer } from "./steer";

const RATE_HZ = 30;

const STATES: Record<SessionState, [icon: IconName, words: keyof typeof text.wall.standings]> = {
  [SessionState.WAITING]: ["waiting", "waiting"],
  [SessionState.RUNNING]: ["running", "running"],
  [SessionState.PAUSED]: ["paused", "paused"],
  [SessionState.CLOSED]: ["closed", "closed"],
};

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
  const stale = h("p", { class: "stale badge now", role: "status" });
  const cockpit = new Cockpit(source, { onMarker: (marker) => steer?.place(marker) });
  const steer = app.account?.role === "instructor" ? new Steer(app, {
    station: name,
    case: () => source.session?.caseName ?? "",
    strength: () => source.session?.strength ?? 1,
    trainee: () => source.session?.trainee ?? "",
  }) : undefined;
  if (steer) {
    steer.onPicking = (on) => {
      cockpit.stage.picking = on;
      setClass(root, "picking", on);
    };
  }
  const waiting = h("div", { class: "station-waiting" }, loading(text.station.waiting(name)));
  root.append(h("header", { class: "station-head" },
    h("div", { class: "station-name" }, h("a", { href: "#/wall", class: "button quiet back" }, icon("back"), text.station.wall), h("h1", {}, name), badge, clock, stale),
    about, h("a", { class: "button", href: routeTo("scope", [name]) }, text.station.scope)),
    ...(steer ? [steer.element] : []), h("div", { class: "station-main" }, cockpit.element, waiting));

  const showHead = (): void => {
    const now = state();
    const { session } = source;
    if (badge.dataset.state !== String(now)) {
      badge.dataset.state = String(now);
      const [sign, words] = STATES[now ?? SessionState.WAITING];
      fill(badge, icon(sign), text.wall.standings[words]);
    }
    setText(clock, source.history.count ? format.clock(source.history.end) : "");
    setText(about, session ? [session.trainee || text.station.nobody, session.caseName, text.station.strength(format.percent(session.strength, 0))].join(" · ") : "");
    const age = heard ? feed.now() - heard : 0;
    const old = age >= QUIET_MS && now !== SessionState.CLOSED;
    setText(stale, old ? text.station.stale(age) : "");
    setClass(root, "old", old);
    steer?.setState(now);
    steer?.setMarker(markerAt(source, Infinity));
    waiting.hidden = session !== undefined || source.history.count > 0;
    const late = feed.link.state === "open" && feed.now() - began > QUIET_MS;
    if (!waiting.hidden && (source.trouble || late)) fill(waiting, empty(text.station.noSession, source.trouble || text.station.noSessionHint));
  };

  const key = (event: KeyboardEvent): void => {
    if (!steer || event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) return;
    if ((event.target as HTMLElement).matches("input, select, textarea")) return;
    if (event.key === "t" && cockpit.stage.picking) steer.place(cockpit.stage.markerAtTip());
    else if (event.key === "Escape" && cockpit.stage.picking) steer.setPicking(false);
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
    () => cockpit.close(),
    () => source.close(),
  ];
  return () => {
    for (const end of ends) end();
  };
};
