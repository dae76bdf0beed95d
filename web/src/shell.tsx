// The frame around the views: skip link, navigation, the state of the connection, the account.
import { useSignal } from "@preact/signals";
import { render } from "preact";
import { useRef } from "preact/hooks";
import type { Role } from "./api";
import type { App } from "./app";
import { announcer, Button, confirm, Field, Icon, openForm, toast, toastFault, useEverySecond } from "./kit";
import type { Route } from "./router";
import { text } from "./text";
import { setTheme, theme, type Theme } from "./theme";

interface Entry {
  name: string; // of the route
  href: string;
  label: string;
  also: string[]; // routes that belong to it
  roles: Role[];
}

const ENTRIES: Entry[] = [
  { name: "wall", href: "#/wall", label: text.views.wall, also: ["station", "scope"], roles: ["instructor", "technician"] },
  { name: "today", href: "#/today", label: text.views.today, also: [], roles: ["trainee"] },
  { name: "course", href: "#/course", label: text.views.course, also: [], roles: ["trainee"] },
  { name: "sessions", href: "#/sessions", label: text.views.sessions, also: ["session"], roles: ["instructor"] },
  { name: "sessions", href: "#/sessions", label: text.views.mySessions, also: ["session"], roles: ["trainee"] },
  { name: "courses", href: "#/courses", label: text.views.courses, also: ["research", "exams", "rate"], roles: ["instructor"] },
  { name: "library", href: "#/library/cases", label: text.views.library, also: [], roles: ["instructor", "technician"] },
  { name: "admin", href: "#/admin/stations", label: text.views.admin, also: [], roles: ["instructor", "technician"] },
];

/** Puts the view's root into the frame, which is kept from view to view. */
export function frame(root: HTMLElement, route: Route, app: App): void {
  render(<Frame key={app.account!.name} route={route} app={app} />, document.getElementById("app")!);
  document.querySelector("main.framed")!.replaceChildren(root);
}

/** The view alone. */
export function bare(root: HTMLElement): void {
  render(<main id="content" class="bare" tabIndex={-1} key="bare" />, document.getElementById("app")!);
  document.querySelector("main.bare")!.replaceChildren(root);
}

function Frame({ route, app }: { route: Route; app: App }) {
  const entries = ENTRIES.filter(({ roles }) => roles.includes(app.account!.role));
  const skip = (event: Event): void => {
    event.preventDefault(); // the hash is the route's
    document.getElementById("content")?.focus();
  };
  return (
    <>
      <header class="top">
        <a href="#content" class="skip" onClick={skip}>{text.skip}</a>
        <a class="brand" href="#/"><span class="mark" aria-hidden="true"><Icon name="mark" /></span><span>{text.product}</span></a>
        <nav class="main" aria-label={text.navigation}>
          {entries.map(({ name, href, label, also }) => (
            <a key={name} href={href} aria-current={name === route.name || also.includes(route.name) ? "page" : undefined}>{label}</a>))}
        </nav>
        <LinkSign app={app} />
        <AccountMenu app={app} />
      </header>
      <main id="content" class="framed" tabIndex={-1} />
    </>
  );
}

// The state of the connection.
function LinkSign({ app: { feed } }: { app: App }) {
  const shown = useSignal({ state: "", words: "" });
  const tell = useRef(announcer());
  useEverySecond(() => {
    const { link } = feed;
    const lost = feed.lostMs();
    let state: string = link.state;
    let words = "";
    if (link.state === "open") {
      if (lost !== undefined) state = "quiet";
      words = lost !== undefined ? text.link.quiet(lost) : text.link.open;
    } else if (link.state !== "idle" && lost !== undefined) {
      state = "broken";
      words = text.link.brokenAndRetry(lost, link.state === "broken" ? link.retryAt - feed.now() : 0);
    } else if (link.state === "connecting") words = text.link.connecting;
    shown.value = { state, words };
    tell.current(state === "quiet" || state === "broken" ? state : "", words);
  });
  return <div class="link-sign" data-state={shown.value.state}><span class="dot" aria-hidden="true" /><span class="link-text">{shown.value.words}</span></div>;
}

const THEMES: Theme[] = ["system", "light", "dark"];
const closeMenu = (): void => document.getElementById("account-menu")?.hidePopover();

function AccountMenu({ app }: { app: App }) {
  const { name, role } = app.account!;
  return (
    <div class="account">
      <button type="button" class="button quiet" popovertarget="account-menu" aria-label={text.account.menu(name)}>
        <Icon name="person" /><span class="account-name">{name}</span><Icon name="down" />
      </button>
      <div id="account-menu" class="menu" popover="auto">
        <p class="menu-name">{name}</p><p class="menu-role">{text.roles[role] ?? role}</p>
        <fieldset class="choices">
          <legend>{text.account.theme}</legend>
          <div>{THEMES.map((kind) => (
            <label key={kind}><input type="radio" name="theme" value={kind} defaultChecked={theme() === kind} onChange={() => setTheme(kind)} /><span>{text.account[kind]}</span></label>))}</div>
        </fieldset>
        <div class="menu-actions">
          <Button class="wide" onClick={() => changePassword(app)}>{text.account.password}</Button>
          <Button class="wide" onClick={() => void app.signOut().catch(toastFault)}>{text.account.signOut}</Button>
          <Button class="wide" onClick={() => signOutEverywhere(app)}>{text.account.signOutEverywhere}</Button>
        </div>
      </div>
    </div>
  );
}

function signOutEverywhere(app: App): void {
  closeMenu();
  confirm(text.account.everywhereTitle, text.account.everywhereHint, text.account.signOutEverywhere, () => app.signOut(true));
}

function changePassword(app: App): void {
  closeMenu();
  openForm(text.account.password, text.save, <>
    <Field label={text.account.current}><input name="password" type="password" autocomplete="current-password" maxLength={128} /></Field>
    <Field label={text.account.fresh} hint={text.first.passwordHint}><input name="new_password" type="password" autocomplete="new-password" maxLength={128} /></Field>
  </>, async ({ password, new_password }) => {
    await app.api.patch("/me", { password, new_password });
    toast(text.account.changed);
    await app.signOut(); // the server has done so
  });
}
