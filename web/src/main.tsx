// Entry point: who is signed in, which view is shown, and the frame around it.
import { render, type ComponentChildren } from "preact";
import { useEffect } from "preact/hooks";
import { Api, ApiError, type Account, type Role } from "./api";
import type { App, View } from "./app";
import { measureScreen } from "./graphics";
import { Broken, Empty, Loading, Toasts, view } from "./kit";
import { browserEnvironment, Feed } from "./live";
import { parseRoute, type Route } from "./router";
import { bare, frame } from "./shell";
import { setTechnician } from "./technical";
import { text } from "./text";

interface Page {
  load(): Promise<View>;
  roles?: Role[]; // who may see it; absent: everybody, signed in or not
  bare?: boolean; // without the frame
  open?: boolean; // whoever signs in or out stays there
}

const STAFF: Role[] = ["instructor", "technician"];
const ALL: Role[] = ["instructor", "technician", "trainee"];

// Each view is loaded when it is first shown.
const PAGES: Record<string, Page> = {
  "sign-in": { load: async () => (await import("./views/signin")).signIn, bare: true },
  first: { load: async () => (await import("./views/signin")).first, bare: true },
  "signed-on": { load: async () => (await import("./views/signin")).signedOn, bare: true },
  demo: { load: async () => (await import("./views/signin")).demo, bare: true },
  wall: { load: async () => (await import("./views/wall")).wall, roles: STAFF },
  sessions: { load: async () => (await import("./views/sessions")).sessions, roles: ["instructor", "trainee"] },
  session: { load: async () => (await import("./views/debrief")).debrief, roles: ["instructor", "trainee"] },
  admin: { load: async () => (await import("./views/admin")).admin, roles: STAFF },
  library: { load: async () => (await import("./views/admin")).library, roles: STAFF },
  today: { load: async () => (await import("./views/today")).today, roles: ["trainee"] },
  station: { load: async () => (await import("./views/station")).station, roles: ALL },
  scope: { load: async () => (await import("./views/scope")).scope, roles: ALL, bare: true },
  course: { load: async () => (await import("./views/my_course")).myCourse, roles: ["trainee"] },
  courses: { load: async () => (await import("./views/courses")).courses, roles: ["instructor"] },
  exams: { load: async () => (await import("./views/exams")).exams, roles: ["instructor"] },
  rate: { load: async () => (await import("./views/rate")).rate, roles: ["instructor"] },
  research: { load: async () => (await import("./views/research")).research, roles: ["instructor"] },
  train: { load: async () => (await import("./views/train")).train, bare: true, open: true },
};

// Where parts of the pages were before, and where they are.
const MOVED: Record<string, string> = { "admin/cases": "#/library/cases", "admin/courses": "#/courses" };

const SIGNED_IN = "signed-in";

function home(account: Account): string {
  const to = kept.wanted || (account.role === "trainee" ? "#/today" : "#/wall");
  kept.wanted = "";
  return to;
}

const api = new Api();
const feed = new Feed(browserEnvironment(stillSignedIn));
const kept = sessionStorage; // wanted: where to go after signing in, also at a provider's page
let leave: () => void = () => {};
let turn = 0; // of what is shown: a view that loads slower than a person clicks is not shown

const app: App = {
  api,
  feed,
  account: undefined,
  signedIn(account) {
    localStorage.setItem(SIGNED_IN, "1");
    app.account = account;
    setTechnician(account.role === "technician");
    const wanted = home(account);
    const to = PAGES[parseRoute(location.hash).name]?.open ? location.hash : wanted;
    if (location.hash === to) void show();
    else location.hash = to;
  },
  async signOut(everywhere = false) {
    await api.post(everywhere ? "/me/sign-out" : "/sign-out").catch((error: unknown) => {
      if (!(error instanceof ApiError && error.status === 401)) throw error;
    });
    signedOut("");
  },
  title(title) {
    document.title = `${title} · ${text.product}`;
    document.getElementById("announcements")!.textContent = title;
  },
};

// null: nobody. Without an earlier sign-in from this browser the server is not asked.
async function whoAmI(): Promise<Account | null> {
  if (!localStorage.getItem(SIGNED_IN)) return null;
  try {
    return (await api.get<{ account: Account }>("/me")).account;
  } catch (error) {
    if (error instanceof ApiError && error.status === 401) return null;
    throw error;
  }
}

// In another tab somebody may have signed out, and somebody else in.
async function stillSignedIn(): Promise<boolean> {
  const account = await whoAmI();
  if (!account) expired();
  else if (account.name !== app.account?.name) location.reload();
  return account !== null;
}

// Several requests may fail at once: only the first remembers where the user was.
function expired(): void {
  if (app.account) signedOut(location.hash);
}

function signedOut(then: string): void {
  localStorage.removeItem(SIGNED_IN);
  app.account = undefined;
  kept.wanted = PAGES[parseRoute(then).name]?.open ? "" : then;
  feed.unwatch();
  const { name } = parseRoute(location.hash);
  if (name === "sign-in" || PAGES[name]?.open) void show();
  else location.hash = "#/sign-in";
}

// What stands in the way of a route: another place to go to, or nothing.
function detour(route: Route, page: Page | undefined): string | undefined {
  if (!app.account) {
    if (page && !page.roles) return undefined;
    kept.wanted = route.name ? location.hash : "";
    return "#/sign-in";
  }
  const moved = MOVED[[route.name, ...route.args].join("/")];
  if (moved) return moved;
  return route.name === "" || (page && !page.roles && !page.open) ? home(app.account) : undefined;
}

async function show(): Promise<void> {
  const mine = ++turn;
  const route = parseRoute(location.hash);
  const page = PAGES[route.name];
  const to = detour(route, page);
  if (to !== undefined) {
    location.replace(to);
    return;
  }
  leave();
  leave = () => {};
  for (const dialog of document.querySelectorAll("dialog")) dialog.close();
  const root = document.createElement("div");
  root.className = `view ${route.name}`;
  render(<Loading />, root);
  if (page?.bare) bare(root);
  else frame(root, route, app);
  leave = () => render(null, root);
  const shown = await chosen(page);
  if (mine !== turn) return;
  render(null, root);
  leave = shown(root, route, app);
  // A reader goes on at the new view; on a page that was just opened the first stop is the skip link.
  if (mine > 1 && document.activeElement === document.body) document.getElementById("content")?.focus();
}

async function chosen(page: Page | undefined): Promise<View> {
  if (!page) return told(text.notFound.title, <Empty {...text.notFound} />);
  if (page.roles && !page.roles.includes(app.account!.role)) return told(text.notAllowed.title, <Empty {...text.notAllowed} />);
  try {
    return await page.load();
  } catch {
    return told(text.viewBroken.title, <Broken {...text.viewBroken} again={() => location.reload()} />);
  }
}

const told = (title: string, state: ComponentChildren): View => view(({ app: { title: name } }) => {
  useEffect(() => name(title), []);
  return <><h1 class="unseen">{title}</h1>{state}</>;
});

async function begin(): Promise<void> {
  measureScreen();
  const [page, toasts, announcements] = ["app", "toasts", "announcements"].map((id) => Object.assign(document.createElement("div"), { id }));
  toasts!.role = "status";
  announcements!.className = "unseen";
  announcements!.ariaLive = "polite";
  render(<Loading />, page!);
  render(<Toasts />, toasts!);
  document.body.append(page!, toasts!, announcements!);
  try {
    app.account = (await whoAmI()) ?? undefined;
    setTechnician(app.account?.role === "technician");
  } catch {
    render(<Broken title={text.errors.unreachable} hint="" again={() => location.reload()} />, page!);
    return;
  }
  api.onSignedOut = expired;
  window.addEventListener("hashchange", () => void show());
  await show();
}

void begin();
