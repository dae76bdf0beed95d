// #/scope/NAME: what the trainee sees, in full screen. On the station's PC poses come from the station
// itself, so that the network is not between hand and eye; the rest comes from the server.
import { useSignal, type ReadonlySignal } from "@preact/signals";
import { useLayoutEffect, useMemo } from "preact/hooks";
import type { App } from "../app";
import { view, type ViewProps } from "../kit";
import { Legend } from "../legend";
import { routeTo, type Route } from "../router";
import { MAPS } from "../scene/colours";
import { ScopeFrame } from "../scope_stage";
import { text } from "../text";
import { LiveScope, type ScopePlace, type Sign } from "./scope_live";
import { askSettings, POST_STEP_DEG, settingsOf } from "./scope_settings";

export const scope = view((props: ViewProps) => {
  useLayoutEffect(() => props.app.title(text.scope.title(props.route.args[0] ?? "")), []);
  return <Scope {...props} />;
});

/** As large as the element that it is in. It stays with the place and the station that it began with. */
export function Scope({ route, app, place }: { route: Route; app: App; place?: ScopePlace }) {
  const name = route.args[0] ?? "";
  const live = useMemo(() => new LiveScope(name, app, settingsOf(route), place), []);
  const keys = useSignal(false);
  useLayoutEffect(() => live.open(), []); // what watches ends before the next view watches
  useLayoutEffect(() => {
    const press = (event: KeyboardEvent): void => {
      if (event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) return;
      if (event.key === "?") keys.value = !keys.value;
      else if (!pressed(event.key, live, name, place)) return;
      event.preventDefault();
    };
    document.addEventListener("keydown", press);
    document.documentElement.classList.add("scope-page");
    return () => {
      document.removeEventListener("keydown", press);
      document.documentElement.classList.remove("scope-page");
    };
  }, []);
  const { signs } = live;
  return <>
    <ScopeFrame stage={live.stage} />
    <div class="scope-top"><SignLine kind="stale" words={signs.stale} /><SignLine kind="state" words={signs.state} /></div>
    <div class="scope-bottom"><SignLine kind="marker" words={signs.marker} /><SignLine kind="note" words={signs.note} /></div>
    <div class="scope-corner">
      <SignLine kind="source" words={signs.source} /><Timing words={live.timing} />
      <details class="scope-keys" open={keys.value} onToggle={(event) => (keys.value = event.currentTarget.open)}>
        <summary>{text.scope.keysTitle}</summary>
        <dl>{text.scope.keys.map(([key, what]) => <div key={key}><dt>{key}</dt><dd>{what}</dd></div>)}</dl>
      </details>
    </div>
    <MapLegend live={live} />
    <h1 class="unseen">{text.scope.title(name)}</h1>
  </>;
}

/** What the key does; false: nothing. In a place there is no way back, and in an exam no hint. */
function pressed(key: string, live: LiveScope, name: string, place: ScopePlace | undefined): boolean {
  const { optic } = live;
  const turn = (degrees: number): void => live.chooseOptic({ ...optic, postDeg: optic.postDeg + degrees });
  if (key === "f") live.turnTiming();
  else if (key === "o") live.chooseOptic({ ...optic, tiltDeg: optic.tiltDeg === 30 ? 70 : 30 });
  else if (key === ",") turn(-POST_STEP_DEG);
  else if (key === ".") turn(POST_STEP_DEG);
  else if (key === "t" && !place?.plain) live.colour(live.map.value === "none" ? "mismatch" : "none");
  else if (key === "s") askSettings(live.choice, ({ optic: next, place: from, map }) => {
    live.choose(next, from);
    if (map) live.colour(map);
  });
  else if (key === "Escape" && !place) location.hash = routeTo("station", [name]);
  else return false;
  return true;
}

function SignLine({ kind, words }: { kind: Sign; words: ReadonlySignal<string | undefined> }) {
  return <p class={`scope-sign ${kind}`} {...(kind === "stale" ? {} : { role: "status" })}>{words.value}</p>; // that ticks
}

function Timing({ words }: { words: ReadonlySignal<string | undefined> }) {
  return <p class="scope-timing number" hidden={words.value === undefined}>{words.value}</p>;
}

function MapLegend({ live: { map: { value: name } } }: { live: LiveScope }) {
  return <Legend name={name} map={name === "none" ? undefined : MAPS[name]} />;
}
