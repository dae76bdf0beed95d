// Signing in with a password, a trainee's code or at a provider, and the first account of a new server.
import { useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import type { Account } from "../api";
import type { App, View } from "../app";
import { Field, Form, Icon, Loading, Tabs, view } from "../kit";
import { text } from "../text";

const PASSWORD_LEAST = 10;
const CODE_LENGTH = 8;
const PANEL = "sign-in-form";
const TABS = (["password", "code"] as const).map((kind) => [kind, text.signIn[kind]] as const);

interface Answer {
  account: Account;
}

/** #/sign-in */
export const signIn: View = view(({ route, app }) => {
  const kind = useSignal<"password" | "code">(route.query.has("code") ? "code" : "password");
  useEffect(() => app.title(text.signIn.title), []);
  return (
    <Card title={text.signIn.title}>
      <SignOnFault query={route.query} />
      <SignOn app={app} />
      <Tabs label={text.signIn.title} tabs={TABS} chosen={kind.value} panel={PANEL} onChoose={(chosen) => (kind.value = chosen)} />
      <First key={kind.value}><div id={PANEL} role="tabpanel">{kind.value === "password" ? <PasswordForm app={app} /> : <CodeForm app={app} />}</div></First>
    </Card>
  );
});

/** #/signed-on: the server has set the cookie; whose it is, it tells. */
export const signedOn: View = view(({ app }) => {
  useEffect(() => {
    app.title(text.signIn.title);
    app.api.get<Answer>("/me").then(({ account }) => app.signedIn(account), () => location.replace("#/sign-in?sign-on=failed"));
  }, []);
  return <Loading />;
});

/** #/first/SECRET */
export const first: View = view(({ route, app }) => {
  useEffect(() => app.title(text.first.title), []);
  return (
    <Card title={text.first.title}>
      <p class="lead">{text.first.hint}</p>
      <First>
        <Form label={text.first.submit} class="wide"
          check={({ name, password, again }) => ({
            name: name!.trim() ? "" : text.first.needName,
            password: password!.length < PASSWORD_LEAST ? text.first.short : "",
            again: again === password ? "" : text.first.different,
          })}
          send={async ({ name, password }) => app.signedIn((await app.api.post<Answer>("/first", { secret: route.args[0] ?? "", name: name!.trim(), password })).account)}>
          <Field label={text.first.name} hint={text.first.nameHint}><input name="name" autocomplete="username" maxLength={63} spellcheck={false} /></Field>
          <Field label={text.first.password} hint={text.first.passwordHint}><input name="password" type="password" autocomplete="new-password" maxLength={128} /></Field>
          <Field label={text.first.again}><input name="again" type="password" autocomplete="new-password" maxLength={128} /></Field>
        </Form>
      </First>
    </Card>
  );
});

/** #/demo/NAME/PASSWORD, which ./demo prints. No server but that of the demo is reached without TLS. */
export const demo: View = view(({ route, app }) => {
  useEffect(() => {
    app.title(text.signIn.title);
    const entry = location.protocol === "http:"
      ? app.api.post<Answer>("/sign-in", { name: route.args[0] ?? "", password: route.args[1] ?? "" })
      : Promise.reject(new Error("over TLS"));
    entry.then(({ account }) => app.signedIn(account), () => location.replace("#/sign-in"));
  }, []);
  return <Loading />;
});

// A browser goes to the provider and comes back: no request of the page can do that.
function SignOn({ app }: { app: App }) {
  const name = useSignal("");
  useEffect(() => {
    app.api.get<{ name: string | null }>("/sign-on").then((answer) => (name.value = answer.name ?? ""), () => {});
  }, []);
  return name.value ? <a class="button wide" href="/api/v1/sign-on/start">{name.value}</a> : null;
}

// Why a sign-on failed: the server puts a word into the address.
function SignOnFault({ query }: { query: URLSearchParams }) {
  const why = query.get("sign-on");
  const faults = text.signIn.signOn;
  return why ? <p role="alert" class="fault">{Object.hasOwn(faults, why) ? faults[why] : faults.failed}</p> : null;
}

function PasswordForm({ app }: { app: App }) {
  return (
    <Form label={text.signIn.submit} class="wide"
      check={({ name, password }) => ({ name: name!.trim() ? "" : text.signIn.needName, password: password ? "" : text.signIn.needPassword })}
      send={async ({ name, password }) => app.signedIn((await app.api.post<Answer>("/sign-in", { name: name!.trim(), password })).account)}>
      <Field label={text.signIn.name}><input name="name" autocomplete="username" maxLength={63} spellcheck={false} autocapitalize="none" /></Field>
      <Field label={text.signIn.secret}><input name="password" type="password" autocomplete="current-password" maxLength={128} /></Field>
    </Form>
  );
}

const plain = (code: string): string => code.replace(/[\s-]/g, "").toUpperCase();

function CodeForm({ app }: { app: App }) {
  return (
    <Form label={text.signIn.submit} class="wide"
      check={({ code }) => ({ code: plain(code!).length === CODE_LENGTH ? "" : text.signIn.needCode })}
      send={async ({ code }) => app.signedIn((await app.api.post<Answer>("/sign-in", { code: plain(code!) })).account)}>
      <Field label={text.signIn.codeLabel} hint={text.signIn.codeHint}>
        <input name="code" class="code" autocomplete="one-time-code" maxLength={CODE_LENGTH + 1} spellcheck={false} autocapitalize="characters" />
      </Field>
    </Form>
  );
}

// The first input inside has the focus.
function First({ children }: { children: ComponentChildren }) {
  const element = useRef<HTMLDivElement>(null);
  useEffect(() => element.current!.querySelector("input")?.focus(), []);
  return <div ref={element}>{children}</div>;
}

function Card({ title, children }: { title: string; children: ComponentChildren }) {
  return (
    <div class="sign-in-page"><div class="sign-in-card">
      <div class="brand large"><span class="mark" aria-hidden="true"><Icon name="mark" /></span><span>{text.product}</span></div>
      <h1>{title}</h1>
      {children}
    </div></div>
  );
}
