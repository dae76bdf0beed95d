// Who comes in: the first instructor, a wrong password, a trainee with a code.
import assert from "node:assert/strict";
import { Demo } from "../demo.mjs";

export const PASSWORD = "correct horse battery";
const REFUSED = [/status of 40[13]/, /429/];

export async function signIn(page, name, password) {
  await page.getByLabel("Name").fill(name);
  await page.getByLabel("Password", { exact: true }).fill(password);
  await page.getByRole("button", { name: "Sign in" }).click();
}

async function the_first_instructor_makes_an_account_through_the_link({ testbed, browser, users }) {
  const context = await browser.context();
  const page = await browser.page(context, await testbed.firstLink());
  await page.getByLabel("Name").fill("grace");
  await page.getByLabel("Password", { exact: true }).fill("short");
  await page.getByLabel("Repeat password").fill("other");
  await page.getByRole("button", { name: "Create account" }).click();
  await page.getByText("The two passwords differ.").waitFor();
  await browser.check(page, "first");
  await browser.picture(page, "first");
  for (const label of ["Password", "Repeat password"]) await page.getByLabel(label, { exact: true }).fill(PASSWORD);
  await page.getByRole("button", { name: "Create account" }).click();
  await page.getByRole("heading", { name: "Class" }).waitFor();
  users.instructor = await context.storageState();
  const again = await browser.page(await browser.context(), await testbed.firstLink(), REFUSED);
  await again.getByLabel("Name").fill("mallory");
  for (const label of ["Password", "Repeat password"]) await again.getByLabel(label, { exact: true }).fill(PASSWORD);
  await again.getByRole("button", { name: "Create account" }).click();
  await again.getByRole("alert").filter({ hasText: /./ }).waitFor();
  assert.match(again.url(), /first/);
}

async function a_wrong_password_is_refused_and_the_right_one_leads_where_one_wanted_to({ browser }) {
  const page = await browser.page(await browser.context(), "#/admin/audit", REFUSED);
  await page.getByRole("heading", { name: "Sign in" }).waitFor();
  await signIn(page, "grace", "wrong horse battery");
  await page.getByText("Name and password do not match.").waitFor();
  await signIn(page, "grace", PASSWORD);
  await page.getByRole("cell", { name: "grace" }).first().waitFor();
  assert.match(page.url(), /#\/admin\/audit$/);
}

async function a_trainee_comes_in_by_a_code_and_sees_only_what_is_their_own({ browser, users }) {
  const admin = await browser.page(await browser.context(users.instructor), "#/admin/trainees");
  await admin.getByRole("button", { name: "Add trainee" }).first().click();
  await admin.locator("dialog").getByLabel("Name", { exact: true }).fill("anna");
  await admin.locator("dialog").getByRole("button", { name: "Add trainee" }).click();
  await admin.getByRole("row", { name: /anna/ }).getByRole("button", { name: /code/i }).click();
  const code = await admin.locator("dialog .code, dialog code, dialog output").first().innerText();
  assert.match(code.replace(/[\s-]/g, ""), /^[A-Z0-9]{8}$/);
  const context = await browser.context();
  const page = await browser.page(context, "#/sign-in", REFUSED);
  await page.getByRole("tab", { name: "With a code" }).click();
  await page.getByLabel("Sign-in code").fill(code.toLowerCase());
  await page.getByRole("button", { name: "Sign in" }).click();
  await page.getByRole("link", { name: "My sessions" }).waitFor();
  users.trainee = await context.storageState();
  for (const hash of ["#/admin/accounts", "#/wall"]) {
    await page.goto(`${browser.url}/${hash}`);
    await page.locator(".state-title", { hasText: "No access to this page" }).waitFor();
  }
  const statuses = await page.evaluate(() => Promise.all(["accounts", "trainees", "audit", "stations", "me"].map(async (path) => (await fetch(`/api/v1/${path}`)).status)));
  assert.deepEqual(statuses, [403, 403, 403, 403, 200]);
}

const LEADS_TO = {
  instructor: { Class: "Class", Sessions: "Sessions", Courses: "Courses", Library: "Cases", Setup: "Stations" },
  trainee: { Today: "Today", "My course": "My course", "My sessions": "My sessions" },
};

async function the_navigation_has_the_names_of_what_it_leads_to({ browser, users }) {
  for (const [role, leadsTo] of Object.entries(LEADS_TO)) {
    const page = await browser.page(await browser.context(users[role]), "#/");
    const links = page.getByRole("navigation", { name: "Main" }).getByRole("link");
    await links.first().waitFor();
    assert.deepEqual(await links.allInnerTexts(), Object.keys(leadsTo), role);
    for (const [name, heading] of Object.entries(leadsTo)) {
      await links.getByText(name, { exact: true }).click();
      await page.getByRole("heading", { name: heading, level: 1 }).waitFor();
      assert.equal(await page.locator("nav.main [aria-current=page]").innerText(), name);
    }
    await page.close();
  }
}

async function links_of_before_still_lead_to_the_right_view({ browser, users }) {
  const page = await browser.page(await browser.context(users.instructor), "#/");
  const before = { "admin/cases": ["Cases", "Library"], "admin/courses": ["Courses", "Courses"], "admin/stations": ["Stations", "Setup"], wall: ["Class", "Class"], exams: ["Exams", "Courses"] };
  for (const [hash, [heading, entry]] of Object.entries(before)) {
    await page.goto(`${browser.url}/#/${hash}`);
    await page.getByRole("heading", { name: heading, level: 1 }).waitFor();
    assert.equal(await page.locator("nav.main [aria-current=page]").innerText(), entry, hash);
  }
}

/** Also where somebody was signed in before. */
async function a_sign_on_at_the_provider_leads_where_one_wanted_to({ browser }) {
  const page = await browser.page(await browser.context(), "#/admin/audit", REFUSED, () => localStorage.setItem("signed-in", "1"));
  await page.getByRole("link", { name: "Sign in with the hospital" }).click();
  await page.getByRole("cell", { name: "Signed in at the provider" }).first().waitFor();
  assert.match(page.url(), /#\/admin\/audit$/);
  await page.getByRole("button", { name: /grace/ }).waitFor();
}

async function signed_out_in_one_tab_is_signed_out_in_all({ browser }) {
  const context = await browser.context();
  const page = await browser.page(context, "#/wall", REFUSED);
  await signIn(page, "grace", PASSWORD);
  await page.getByRole("heading", { name: "Class" }).waitFor();
  const other = await browser.page(context, "#/wall", [...REFUSED, /WebSocket connection/]);
  await other.getByRole("heading", { name: "Class" }).waitFor();
  await page.getByRole("button", { name: /grace/ }).click();
  await page.getByRole("button", { name: "Sign out", exact: true }).click();
  await other.getByRole("heading", { name: "Sign in" }).waitFor();
}

/** The link signs in without a warning of the browser. */
async function the_link_of_the_demo_opens_its_console({ testbed, browser }) {
  const demo = new Demo(testbed.source, testbed.path("cases"));
  try {
    const page = await browser.page(await browser.context(undefined, { ignoreHTTPSErrors: false }), await demo.link());
    await page.getByRole("heading", { name: "Class" }).waitFor();
    await page.getByRole("button", { name: /demo/ }).waitFor();
    await page.locator("article.card", { hasText: "demo" }).first().waitFor();
    assert.doesNotMatch(page.url(), /#\/demo\//, "the password stays in the address");
    await page.close();
  } finally {
    await demo.end();
  }
}

for (const test of [the_first_instructor_makes_an_account_through_the_link, a_trainee_comes_in_by_a_code_and_sees_only_what_is_their_own]) test.always = true;

export const tests = [
  the_first_instructor_makes_an_account_through_the_link, a_wrong_password_is_refused_and_the_right_one_leads_where_one_wanted_to,
  a_trainee_comes_in_by_a_code_and_sees_only_what_is_their_own, a_sign_on_at_the_provider_leads_where_one_wanted_to, signed_out_in_one_tab_is_signed_out_in_all,
  the_navigation_has_the_names_of_what_it_leads_to, links_of_before_still_lead_to_the_right_view,
  the_link_of_the_demo_opens_its_console,
];
