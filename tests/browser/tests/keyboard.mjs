// Every view with the keyboard alone: Tab comes to all that can be used, and one sees where one is.
import assert from "node:assert/strict";
import { until } from "../programs.mjs";
import { viewsOf } from "./views.mjs";

const MOST = 150; // stops in a view

// What a person without a pointer must come to. Of what arrow keys walk over, one is enough.
function usable() {
  const all = [...document.querySelectorAll("a[href], button, input, select, textarea, summary, [tabindex='0']")];
  let count = 0;
  for (const element of all) {
    const hidden = element.matches(":disabled, [tabindex='-1'], input[type=radio]:not(:checked)") || !element.checkVisibility({ visibilityProperty: true })
      || element.closest("[popover]:not(:popover-open), [inert]");
    if (!hidden) element.dataset.stop = String(count++);
  }
  return count;
}

// Where the focus is: its number, its name, and whether one can see it.
function focused() {
  const element = document.activeElement;
  if (!element || element === document.body) return null;
  const style = getComputedStyle(element);
  const box = element.getBoundingClientRect();
  const around = element.closest("label, article") ?? element;
  const seen = [element, element.nextElementSibling, around].some((one) => one && ["", "::after"].some((part) => {
    const of = getComputedStyle(one, part);
    return (of.outlineStyle !== "none" && parseFloat(of.outlineWidth) > 0) || of.boxShadow !== "none";
  }));
  return {
    stop: element.dataset.stop, seen: seen && style.visibility === "visible",
    inside: box.bottom > 0 && box.right > 0 && box.top < innerHeight && box.left < innerWidth,
    name: element.getAttribute("aria-label") ?? element.textContent?.trim().slice(0, 40) ?? "", tag: element.tagName.toLowerCase(),
  };
}

async function walk(page, name) {
  const count = await page.evaluate(usable);
  const reached = new Set();
  for (let i = 0; i < MOST; i++) {
    await page.keyboard.press("Tab");
    const now = await page.evaluate(focused);
    if (!now) continue; // at the end, before the first again
    const where = `${name}: ${now.tag} "${now.name}"`;
    assert.ok(now.seen, `${where}: nobody sees that it has the focus`);
    assert.ok(now.inside, `${where}: it is not on the screen`);
    if (now.stop !== undefined && reached.has(now.stop) && reached.size >= count) break;
    if (now.stop !== undefined) reached.add(now.stop);
  }
  const missed = await page.evaluate((seen) => [...document.querySelectorAll("[data-stop]")].filter((one) => !seen.includes(one.dataset.stop))
    .map((one) => one.outerHTML.slice(0, 120)), [...reached]);
  assert.deepEqual(missed, [], `${name}: Tab does not come to these`);
}

async function tab_comes_to_all_that_can_be_used_in_every_view({ testbed, browser, users }) {
  const views = await viewsOf(testbed);
  await testbed.runStation("room-1");
  const context = await browser.context(users.instructor);
  for (const [name, hash, there] of views) {
    const page = await browser.page(context, hash);
    await page.locator(there).first().waitFor();
    await walk(page, name);
    await page.close();
  }
}

async function the_first_stop_skips_to_the_content_and_arrows_walk_over_the_wall({ testbed, browser, users }) {
  for (const name of testbed.equipped) await testbed.runStation(name);
  const page = await browser.page(await browser.context(users.instructor), "#/wall");
  await page.locator("article.card").filter({ hasText: "room-3" }).waitFor();
  const last = (await page.locator("article.card .name").allInnerTexts()).at(-1);
  assert.equal(await page.locator("a, button").first().getAttribute("class"), "skip");
  await page.locator("a.skip").press("Enter");
  assert.equal(await page.evaluate(() => document.activeElement.id), "content");
  await page.keyboard.press("Tab"); // the technical figures
  await page.keyboard.press("Tab");
  const at = () => page.evaluate(() => document.activeElement.textContent);
  assert.equal(await at(), "room-1");
  await page.keyboard.press("ArrowRight");
  assert.equal(await at(), "room-2");
  await page.keyboard.press("End");
  assert.equal(await at(), last);
  await page.keyboard.press("Home");
  await page.keyboard.press("Enter");
  await page.getByRole("heading", { name: "room-1" }).waitFor();
}

async function a_dialog_keeps_the_focus_and_gives_it_back({ testbed, browser, users }) {
  await testbed.runStation("room-1");
  const page = await browser.page(await browser.context(users.instructor), "#/station/room-1");
  const note = page.getByRole("button", { name: "Note …" });
  await until("there is a session to note something in", () => note.isEnabled());
  await note.focus();
  await page.keyboard.press("Enter");
  await page.locator("dialog textarea").waitFor();
  assert.equal(await page.evaluate(() => document.activeElement.tagName), "TEXTAREA");
  for (let i = 0; i < 12; i++) {
    await page.keyboard.press("Tab");
    assert.ok(await page.evaluate(() => document.activeElement === document.body || document.activeElement.closest("dialog") !== null), "the focus left the dialog");
  }
  await page.keyboard.press("Escape");
  assert.ok(await note.evaluate((button) => document.activeElement === button), "the focus is where it was");
}

async function a_drag_that_ends_outside_leaves_a_dialog_open_and_a_click_there_closes_it({ browser, users }) {
  const page = await browser.page(await browser.context(users.instructor), "#/admin/tokens");
  await page.getByRole("button", { name: "Add program key" }).first().click();
  const dialog = page.locator("dialog");
  await dialog.getByLabel("Name").fill("nightly export");
  const box = await dialog.boundingBox();
  const input = await dialog.getByLabel("Name").boundingBox();
  await page.mouse.move(input.x + input.width / 2, input.y + input.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x - 20, box.y + box.height / 2, { steps: 5 });
  await page.mouse.up();
  assert.equal(await dialog.count(), 1, "a selection of text closed it");
  await page.mouse.click(box.x + 4, box.y + box.height - 4);
  assert.equal(await dialog.count(), 1, "a click on its edge closed it");
  await page.mouse.move(box.x - 20, box.y);
  await page.mouse.down();
  await page.mouse.move(input.x + 5, input.y + 5, { steps: 5 });
  await page.mouse.up();
  assert.equal(await dialog.count(), 1, "a drag into it closed it");
  await page.mouse.click(box.x - 20, box.y + box.height / 2);
  await dialog.waitFor({ state: "detached" });
}

const focusIs = (locator) => until("it has the focus", () => locator.evaluate((element) => document.activeElement === element), 5);

async function a_list_that_is_made_anew_keeps_the_focus({ browser, users }) {
  const page = await browser.page(await browser.context(users.instructor), "#/admin/tokens");
  const add = page.getByRole("button", { name: "Add program key" });
  await add.press("Enter");
  await page.locator("dialog").getByLabel("Name").fill("nightly");
  await page.keyboard.press("Enter");
  await page.locator("dialog output").waitFor();
  assert.equal(await page.locator("dialog").count(), 1, "the form has closed before");
  await page.keyboard.press("Escape");
  await focusIs(add);
  await page.goto(`${browser.url}/#/admin/accounts`);
  const change = page.getByRole("row", { name: /grace/ }).getByRole("button", { name: "Change" });
  await change.press("Enter");
  const read = page.waitForResponse(/accounts/);
  await page.locator("dialog").getByRole("button", { name: "Save" }).press("Enter");
  await read;
  await page.locator(".listing:not(.busy)").waitFor();
  await focusIs(change);
}

async function events_that_come_leave_the_focus_where_it_is({ testbed, browser, users }) {
  await testbed.runStation("room-1");
  const page = await browser.page(await browser.context(users.instructor), "#/station/room-1");
  await page.getByRole("tab", { name: "Events" }).click();
  const touches = page.getByLabel("Show touches");
  await touches.press("Space");
  await focusIs(touches);
  await page.locator(".event").first().focus();
  const shown = () => page.locator(".event").count();
  const [{ time }, count] = [await page.evaluate(() => ({ ...document.activeElement.dataset })), await shown()];
  await until("more events", async () => (await shown()) > count);
  assert.equal(await page.evaluate(() => document.activeElement.dataset.time), time);
}

async function escape_leads_from_the_scope_to_the_station({ testbed, browser, users }) {
  await testbed.runStation("room-1");
  const page = await browser.page(await browser.context(users.trainee), "#/scope/room-1");
  await page.locator(".scope-round:not(.dark)").waitFor();
  await page.keyboard.press("s");
  await page.locator("dialog").waitFor();
  await page.keyboard.press("Escape");
  await page.locator("dialog").waitFor({ state: "detached" });
  assert.match(page.url(), /#\/scope\/room-1$/);
  await page.keyboard.press("Escape");
  await page.getByRole("heading", { name: "room-1" }).waitFor();
  assert.match(page.url(), /#\/station\/room-1$/);
}

async function a_server_that_falls_silent_is_told_of_once({ testbed, browser, users }) {
  await testbed.runStation("room-1");
  const page = await browser.page(await browser.context(users.instructor), "#/station/room-1");
  await page.locator(".state-badge", { hasText: "Running" }).waitFor();
  await page.evaluate(() => {
    window.told = [];
    const said = document.getElementById("announcements");
    new MutationObserver(() => window.told.push(said.textContent)).observe(said, { childList: true });
  });
  const { process: server } = testbed.server;
  server.kill("SIGSTOP");
  try {
    await page.locator(".link-sign", { hasText: /[5-9] s$/ }).waitFor();
    const [told, ...more] = await page.evaluate(() => window.told);
    assert.match(told, /^No data for \d s$/);
    assert.deepEqual(more, []);
    for (const ticking of [".link-sign", ".stale"])
      assert.equal(await page.locator(`${ticking}:is([role=status], [aria-live])`).count(), 0, `the seconds of ${ticking} are not read out`);
  } finally {
    server.kill("SIGCONT");
  }
  await page.locator(".link-sign", { hasText: "Live" }).waitFor();
}

export const tests = [
  tab_comes_to_all_that_can_be_used_in_every_view, the_first_stop_skips_to_the_content_and_arrows_walk_over_the_wall,
  a_dialog_keeps_the_focus_and_gives_it_back, a_drag_that_ends_outside_leaves_a_dialog_open_and_a_click_there_closes_it, a_list_that_is_made_anew_keeps_the_focus, events_that_come_leave_the_focus_where_it_is,
  escape_leads_from_the_scope_to_the_station, a_server_that_falls_silent_is_told_of_once,
];
