// Trainees, accounts, courses and sessions as they are changed and removed on the pages Setup and Courses.
// What the pages show is held against what the API says.
import assert from "node:assert/strict";
import { STATIONS } from "../testbed.mjs";
import { until } from "../programs.mjs";
import { PASSWORD, signIn } from "./sign_in.mjs";

const EXPIRED = [/status of 40[0134]/, /WebSocket connection/];

const row = (page, name) => page.getByRole("row", { name: new RegExp(name) });
const press = (where, name) => where.getByRole("button", { name, exact: true }).click();
const dialog = (page) => page.locator("dialog");

const get = (page, path) => page.evaluate(async (of) => {
  const response = await fetch(`/api/v1${of}`);
  return { status: response.status, ...(await response.json()) };
}, path);
const traineesOf = async (page) => (await get(page, "/trainees")).trainees.filter(({ erased }) => !erased);

const openDesk = async ({ browser, users }, hash, may = []) => browser.page(await browser.context(users.instructor), hash, may);

async function add(page, button, fields) {
  await page.getByRole("button", { name: button }).first().click();
  for (const [label, value] of Object.entries(fields)) await dialog(page).getByLabel(label, { exact: true }).fill(value);
  await press(dialog(page), button);
  await dialog(page).waitFor({ state: "detached" });
}

async function a_trainee_gets_a_full_name_later_is_renamed_and_is_deleted(world) {
  const page = await openDesk(world, "#/admin/trainees", EXPIRED);
  await add(page, "Add trainee", { Name: "ernst" });
  await press(row(page, "ernst"), "Change");
  await dialog(page).getByLabel("Full name").fill("Ernst Mach");
  await press(dialog(page), "Save");
  await row(page, "Ernst Mach").waitFor();
  await press(row(page, "ernst"), "Change");
  await dialog(page).getByLabel("Name", { exact: true }).fill("mach");
  await press(dialog(page), "Save");
  await row(page, "mach").waitFor();
  const mach = async () => (await traineesOf(page)).filter(({ name }) => ["ernst", "mach"].includes(name)).map(({ name, full_name }) => [name, full_name]);
  assert.deepEqual(await mach(), [["mach", "Ernst Mach"]]);
  await press(row(page, "mach"), "Change");
  await dialog(page).getByLabel("Full name").fill("");
  await dialog(page).getByLabel("Name", { exact: true }).fill("a/b c");
  await press(dialog(page), "Save");
  await dialog(page).locator(".fault", { hasText: /./ }).first().waitFor(); // what the server refuses is said at the field
  await dialog(page).getByLabel("Name", { exact: true }).fill("mach");
  await press(dialog(page), "Save");
  await until("the full name is gone", async () => (await mach())[0][1] === null);
  await press(row(page, "mach"), "Delete");
  await press(dialog(page), "Delete");
  await until("mach is deleted", async () => (await mach()).length === 0);
  await row(page, "mach").waitFor({ state: "detached" });
}

async function a_trainee_with_sessions_is_erased_and_a_session_deleted(world) {
  const { testbed } = world;
  const page = await openDesk(world, "#/admin/trainees", EXPIRED);
  const name = STATIONS["room-3"].trainee;
  const { id } = await testbed.record("room-3");
  await until("the record has the session", async () => (await get(page, `/sessions/${id}`)).session?.state === "closed");
  await page.reload();
  await press(row(page, name), "Erase");
  await press(dialog(page), "Erase");
  await dialog(page).getByText(`${name} is now`).waitFor();
  const link = dialog(page).getByRole("link", { name: id });
  await world.browser.check(page, "erased trainee");
  await world.browser.picture(page, "admin-trainees-erased");
  await link.click();
  const { session } = await get(page, `/sessions/${id}`);
  assert.notEqual(session.trainee, name);
  assert.ok(!(await traineesOf(page)).some((one) => one.name === name));
  await page.goto(`${world.browser.url}/#/sessions?case=arthrosis`);
  const of = page.getByRole("row").filter({ has: page.locator(`a[href$="${id}"]`) });
  await press(of, "Delete");
  await press(dialog(page), "Delete");
  await of.waitFor({ state: "detached" });
  assert.equal((await get(page, `/sessions/${id}`)).status, 404);
}

async function an_account_is_renamed_signed_out_and_deleted(world) {
  const { browser } = world;
  const page = await openDesk(world, "#/admin/accounts");
  await page.getByRole("button", { name: "Add account" }).first().click();
  await dialog(page).getByLabel("Name", { exact: true }).fill("tess");
  await dialog(page).getByLabel("Role").selectOption("technician");
  await dialog(page).getByLabel("Password", { exact: true }).fill(PASSWORD);
  await press(dialog(page), "Add account");
  await row(page, "tess").waitFor();
  await press(row(page, "tess"), "Change");
  await dialog(page).getByLabel("Name", { exact: true }).fill("teresa");
  await press(dialog(page), "Save");
  await row(page, "teresa").waitFor();
  const other = await browser.page(await browser.context(), "#/sign-in", EXPIRED);
  await signIn(other, "teresa", PASSWORD);
  await other.getByRole("heading", { name: "Class" }).waitFor();
  await press(row(page, "teresa"), "Sign out");
  await press(dialog(page), "Sign out");
  await other.getByRole("heading", { name: "Sign in" }).waitFor();
  await press(row(page, "teresa"), "Delete");
  await press(dialog(page), "Delete");
  await row(page, "teresa").waitFor({ state: "detached" });
}

async function sign_out_everywhere_ends_all_browsers_of_an_account(world) {
  const { browser } = world;
  const page = await openDesk(world, "#/admin/accounts");
  await page.getByRole("button", { name: "Add account" }).first().click();
  await dialog(page).getByLabel("Name", { exact: true }).fill("otto");
  await dialog(page).getByLabel("Role").selectOption("instructor");
  await dialog(page).getByLabel("Password", { exact: true }).fill(PASSWORD);
  await press(dialog(page), "Add account");
  await row(page, "otto").waitFor();
  const pages = [];
  for (let i = 0; i < 2; i++) {
    const one = await browser.page(await browser.context(), "#/sign-in", EXPIRED);
    await signIn(one, "otto", PASSWORD);
    await one.getByRole("heading", { name: "Class" }).waitFor();
    pages.push(one);
  }
  await pages[0].getByRole("button", { name: /otto/ }).click();
  await press(pages[0], "Sign out everywhere");
  await press(dialog(pages[0]), "Sign out everywhere");
  for (const one of pages) await one.getByRole("heading", { name: "Sign in" }).waitFor();
}

async function a_course_is_renamed_and_left_and_deleted(world) {
  const page = await openDesk(world, "#/admin/trainees", EXPIRED);
  await add(page, "Add trainee", { Name: "felix" });
  await page.goto(`${world.browser.url}/#/courses`);
  await add(page, "Add course", { Course: "spring" });
  await press(row(page, "spring"), "Rename");
  await dialog(page).getByLabel("Course").fill("summer");
  await press(dialog(page), "Save");
  await press(row(page, "summer"), "Trainees");
  await dialog(page).getByRole("combobox").selectOption("felix");
  await press(dialog(page), "Add to course");
  await press(dialog(page), "Remove felix from the course");
  await dialog(page).getByText("This course has no trainees").waitFor();
  await page.keyboard.press("Escape");
  await press(row(page, "summer"), "Delete");
  await press(dialog(page), "Delete");
  await row(page, "summer").waitFor({ state: "detached" });
  assert.deepEqual((await get(page, "/courses")).courses.filter(({ name }) => ["spring", "summer"].includes(name)), []);
}

async function the_audit_log_calls_a_session_by_a_few_digits_that_lead_to_it(world) {
  const { id } = await world.testbed.recorded();
  const page = await openDesk(world, "#/admin/audit");
  const link = page.locator(`a[href="#/session/${id}"]`).first();
  assert.equal(await link.innerText(), id.slice(0, 8));
  assert.doesNotMatch(await page.locator("main").innerText(), /[0-9a-f]{32}/);
}

export const tests = [
  the_audit_log_calls_a_session_by_a_few_digits_that_lead_to_it,
  a_trainee_gets_a_full_name_later_is_renamed_and_is_deleted, an_account_is_renamed_signed_out_and_deleted,
  sign_out_everywhere_ends_all_browsers_of_an_account, a_course_is_renamed_and_left_and_deleted,
  a_trainee_with_sessions_is_erased_and_a_session_deleted,
];
