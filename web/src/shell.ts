// The frame around the views: skip link, navigation, the state of the connection, the account.
import type { Role } from "./api";
import type { App } from "./app";
import { explain } from "./explain";
import type { Route } from "./router";
import { text } from "./text";
import { setTheme, theme, type Theme } from "./theme";
import { toast } from "./kit/dialog";
import { announcer, button, confirm, everySecond, field, formDialog, h, icon, setText } from "./ui";

interface Entry {
  name: string; // of the route
  href: string;
  label: string;
  also: string[]; // routes that belong to it
  roles: Role[];
}

const ENTRIES: Entry[] = [
  { name: "wall", href: "#/wall", label: text.views.wall, also: ["station", "scope"], roles: ["instructor", "technician"] },
  { name: "course", href: "#/course", label: text.views.course, also: [], roles: ["trainee"] },
  { name: "sessions", href: "#/sessions", label: text.views.sessions, also: ["session"], roles: ["instructor", "trainee"] },
  { name: "courses", href: "#/courses", label: text.views.courses, also: ["research"], roles: ["instructor"] },
  { name: "exams", href: "#/exams", label: text.views.exams, also: ["rate"], roles: ["instructor"] },
  { name: "admin", href: "#/admin/stations", label: text.views.admin, also: [], roles: ["instructor", "technician"] },
];

/** Puts the view's root into the frame, which is kept from view to view. Returns its clean-up. */
export function frame(root: HTMLElement, route: Route, app: App): () => void {
  const page = document.getElementById("app")!;
  const account = app.account!;
  let content = page.querySelector<HTMLElement>("main.framed");
  if (!content || page.dataset.account !== account.name) {
    content = h("main", { id: "content", class: "framed", tabindex: -1 });
    page.dataset.account = account.name;
    page.replaceChildren(header(app), content);
  }
  for (const link of page.querySelectorAll<HTMLAnchorElement>("nav.main a")) {
    const here = link.dataset.name === route.name || link.dataset.also!.split(" ").includes(route.name);
    if (here) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  content.replaceChildren(root);
  const sign = page.querySelector<HTMLElement>(".link-sign")!;
  return everySecond(() => showLink(sign, app));
}

function header(app: App): HTMLElement {
  const links = ENTRIES.filter((entry) => entry.roles.includes(app.account!.role)).map((entry) =>
    h("a", { href: entry.href, data: { name: entry.name, also: entry.also.join(" ") } }, entry.label));
  const skip = h("a", { href: "#content", class: "skip", on: { click: (event: Event) => {
    event.preventDefault(); // the hash is the route's
    document.getElementById("content")?.focus();
  } } }, text.skip);
  return h("header", { class: "top" }, skip,
    h("a", { class: "brand", href: "#/" }, mark(), h("span", {}, text.product)),
    h("nav", { class: "main", "aria-label": text.navigation }, ...links),
    h("div", { class: "link-sign" }, h("span", { class: "dot", "aria-hidden": "true" }), h("span", { class: "link-text" })),
    accountMenu(app));
}

/** The product's sign. */
export function mark(): HTMLElement {
  return h("span", { class: "mark", "aria-hidden": "true" }, icon("mark"));
}

const tell = announcer();

function showLink(sign: HTMLElement, { feed }: App): void {
  const link = feed.link;
  let state: string = link.state;
  let words = "";
  const lost = feed.lostMs();
  if (link.state === "open") {
    if (lost !== undefined) state = "quiet";
    words = lost !== undefined ? text.link.quiet(lost) : text.link.open;
  } else if (link.state !== "idle" && lost !== undefined) {
    state = "broken";
    words = `${text.link.broken(lost)}. ${text.link.retry(link.state === "broken" ? link.retryAt - feed.now() : 0)}`;
  } else if (link.state === "connecting") words = text.link.connecting;
  sign.dataset.state = state;
  setText(sign.querySelector(".link-text")!, words);
  tell(state === "quiet" || state === "broken" ? state : "", words);
}

function accountMenu(app: App): HTMLElement {
  const account = app.account!;
  const choices = (["system", "light", "dark"] as Theme[]).map((kind) => {
    const input = h("input", { type: "radio", name: "theme", value: kind, on: { change: () => setTheme(kind) } });
    input.checked = theme() === kind;
    return h("label", {}, input, h("span", {}, text.account[kind as "system" | "light" | "dark"]));
  });
  const menu = h("div", { id: "account-menu", class: "menu", popover: "auto" },
    h("p", { class: "menu-name" }, account.name), h("p", { class: "menu-role" }, text.roles[account.role] ?? account.role),
    h("fieldset", { class: "choices" }, h("legend", {}, text.account.theme), h("div", {}, ...choices)),
    h("div", { class: "menu-actions" }, button(text.account.password, () => changePassword(app), { class: "wide" }),
    button(text.account.signOut, () => void app.signOut().catch((error) => toast(explain(error), "fault")), { class: "wide" }),
    button(text.account.signOutEverywhere, () => signOutEverywhere(app), { class: "wide" })));
  const opener = h("button", { type: "button", class: "button quiet", popovertarget: menu.id, "aria-label": text.account.menu(account.name) },
    icon("person"), h("span", { class: "account-name" }, account.name), icon("down"));
  return h("div", { class: "account" }, opener, menu);
}

function signOutEverywhere(app: App): void {
  document.getElementById("account-menu")?.hidePopover();
  confirm(text.account.everywhereTitle, text.account.everywhereHint, text.account.signOutEverywhere, () => app.signOut(true));
}

function changePassword(app: App): void {
  document.getElementById("account-menu")?.hidePopover();
  const current = h("input", { name: "password", type: "password", autocomplete: "current-password", maxlength: 128 });
  const fresh = h("input", { name: "new_password", type: "password", autocomplete: "new-password", maxlength: 128 });
  formDialog(text.account.password, [field(text.account.current, current), field(text.account.fresh, fresh, text.first.passwordHint)], text.save, async () => {
    await app.api.patch("/me", { password: current.value, new_password: fresh.value });
    toast(text.account.changed);
    await app.signOut(); // the server has done so
  });
}
