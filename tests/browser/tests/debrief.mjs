// A recorded session, replayed.
import assert from "node:assert/strict";
import { truncateSync } from "node:fs";
import { basename } from "node:path";
import { ALIKE, difference, replayed, still } from "../browser.mjs";
import { call, sleep, until } from "../programs.mjs";

async function a_recorded_session_ends_with_the_volume_that_it_had({ testbed, browser, users }) {
  const { id, resection: live } = await testbed.recorded();
  const page = await browser.page(await browser.context(users.instructor), `#/session/${id}`);
  const left = page.locator(".resection-group").first().locator(".figure").filter({ hasText: "Volume left" }).locator("dd").first();
  await replayed(page); // and verified with the page's own mesh
  const volume = async () => Number((await left.innerText()).replace(/[^0-9.]/g, ""));
  const isEnd = async () => Math.abs((await volume()) - live.volume_mm3) <= 0.5;
  await until("it opens on the outcome", isEnd, 5);
  await page.locator("main").press("Home");
  await until("another volume", async () => !(await isEnd()));
  const begin = await volume();
  await page.locator("main").press("End");
  await until("the volume of the end", isEnd);
  assert.ok(begin > live.volume_mm3 + 1, `${begin} mm³ at the beginning, ${live.volume_mm3} at the end`);
  assert.ok(browser.heard(page).kinds.moment > 50);
}

// Beside another session: what is found in the page, and what was asked for.
async function beside({ browser, users }, query, id) {
  const context = await browser.context(users.instructor);
  const asked = [];
  context.on("request", (request) => asked.push(new URL(request.url()).pathname));
  const page = await browser.page(context, `#/session/${id}?${query}`);
  await replayed(page);
  await until("the other's replay has come", async () => (await page.locator(".compare-name").isVisible()) && (await page.locator(".compare-share").innerText()) === "");
  return { page, asked };
}

const picture = (page, viewport) => still(page.locator(`${viewport} canvas.scene-canvas`));

const key = async (page, name) => {
  await page.locator("main").press(name);
  await sleep(200);
};

/** Pixels of the colour that another's hands have, and where the middle of them is. */
function ghost({ width, data }) {
  const sum = { count: 0, x: 0, y: 0 };
  for (let i = 0; i < data.length; i += 4) {
    const [r, g, b] = data.subarray(i, i + 3);
    if (r - g < 70 || b - g < 40 || b > r) continue;
    sum.count++;
    sum.x += (i / 4) % width;
    sum.y += Math.floor(i / 4 / width);
  }
  return { count: sum.count, x: sum.x / sum.count, y: sum.y / sum.count };
}

/** The page has the figures of the other's punch, as the server has them. */
async function sameFigures(page, id) {
  await page.getByRole("tab", { name: "Metrics" }).click();
  const { results } = await page.evaluate(async (session) => (await fetch(`/api/v1/sessions/${session}`)).json(), id);
  const group = page.locator(".strip-group").filter({ has: page.getByRole("heading", { name: "Punch", exact: true }) });
  for (const [metric, name] of [["path_hand", "Path, hand"], ["path_seen", "Path, shown"]]) {
    const { value } = results.find((one) => one.metric === metric && one.subject === "punch");
    const strip = group.locator(".strip").filter({ has: page.locator("dt", { hasText: new RegExp(`^${name}$`) }) });
    const shown = Number((await strip.locator(".strip-other").innerText()).replace(/[^0-9.]/g, ""));
    assert.ok(value > 0 && Math.abs(shown - value) <= 0.5, `${name}: ${shown} on the page, ${value} on the server`);
  }
}

async function another_session_is_seen_beside_and_goes_with_the_cursor(world) {
  const { testbed } = world;
  const { id } = await testbed.recorded();
  const other = await testbed.record("room-1", () => until("a cut", async () => (await testbed.resection("room-1")).cuts >= 1));
  const { page } = await beside(world, `with=${other.id}`, id);
  assert.match(await page.locator(".compare-name a").getAttribute("href"), new RegExp(`${other.id}$`));
  assert.equal(await page.locator(".compare-line").innerText(), "");
  assert.ok(await page.locator(".transport.with-other").isVisible());
  await key(page, "End");
  const end = await picture(page, ".viewport.other");
  const away = async () => difference(end, await picture(page, ".viewport.other"));
  let moved = 0;
  await key(page, "Home"); // hands that bite in turns may be there as they are at the end
  await until("the other's picture is another before the end", async () => (moved = await away()) > 4 * ALIKE || void (await key(page, "ArrowRight")));
  await key(page, "End");
  await until("it is the same at the end again", async () => (await away()) < moved / 4);
  await sameFigures(page, other.id);
  await page.getByRole("button", { name: "End comparison" }).click();
  await page.locator(".viewport.other").waitFor({ state: "detached" });
  assert.equal(await page.locator(".strip-other, .transport.with-other").count(), 0);
  assert.match(page.url(), new RegExp(`#/session/${id}$`));
}

async function the_hands_of_a_session_on_another_case_are_carried_over(world) {
  const { testbed } = world;
  const { id } = await testbed.recorded();
  const other = await testbed.record("room-3");
  const { page, asked } = await beside(world, `with=${other.id}&as=ghost`, id);
  await page.locator(".compare-line", { hasText: "The hands of arthrosis, replayed on tear-radial" }).waitFor();
  await key(page, "Home");
  const ghosts = [];
  for (let i = 0; i < 5; i++) {
    await key(page, "ArrowRight");
    ghosts.push(ghost(await picture(page, ".viewport")));
  }
  const seen = ghosts.filter(({ count }) => count > 100);
  assert.ok(seen.length >= 3, `the other's hands are in ${seen.length} of 5 pictures`);
  const farthest = Math.max(...seen.map(({ x, y }) => Math.hypot(x - seen[0].x, y - seen[0].y)));
  assert.ok(farthest > 2, "they do not go with the cursor");
  await page.getByText("Side by side").click();
  assert.equal(ghost(await picture(page, ".viewport:not(.other)")).count, 0, "no ghost is left");
  await picture(page, ".viewport.other");
  const cases = new Set(asked.flatMap((path) => /^\/api\/v1\/cases\/([^/]+)/.exec(path)?.[1] ?? []));
  assert.deepEqual([...cases], ["tear-radial"], "both are shown on this session's case");
}

async function a_record_that_cannot_be_read_says_what_is_wrong({ testbed, browser, users }) {
  await testbed.runStation("room-1");
  const { id, trace } = await testbed.station("room-1");
  await testbed.session("stop", "room-1");
  await until("it is on the disk", () => call("arthron-trace", "info", trace).then(() => true, () => false));
  truncateSync(trace, 3);
  const page = await browser.page(await browser.context(users.instructor), `#/session/${id}`);
  await page.getByText("This session cannot be replayed").waitFor();
  await page.locator(".state").getByText(basename(trace)).waitFor();
  await page.getByRole("button", { name: "Try again" }).waitFor();
  await sleep(4000); // a page that is told nothing calls what it shows old
  assert.equal(await page.locator(".link-sign").getAttribute("data-state"), "idle");
  assert.equal(browser.heard(page).kinds.moment, undefined);
}

// What others came to is told to a trainee only where there are many of them.
async function a_trainees_report_tells_nothing_of_the_few_others({ testbed, browser, users }) {
  const { id } = await testbed.recorded();
  const open = async (state) => browser.page(await browser.context(state), "#/nowhere");
  const report = (page) => page.evaluate(async (session) => (await fetch(`/api/v1/sessions/${session}/report?course=autumn`)).text(), id);
  const [trainee, instructor] = [await open(users.trainee), await open(users.instructor)];
  await instructor.evaluate(async () => {
    const send = (path, body) => fetch(`/api/v1${path}`, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });
    await send("/courses", { name: "autumn" });
    await send("/courses/autumn/trainees", { trainee: "anna" });
  });
  const [own, admin] = [await report(trainee), await report(instructor)];
  assert.ok(/Of fewer than \d+ trainees, nothing/.test(own), "the trainee is told what is kept back");
  assert.ok(/Of fewer than \d+ sessions, the figures themselves/.test(admin), "and the instructor what is not");
  const figures = (words) => words.split("<h2>Figures</h2>")[1].split("</table>")[0];
  const silent = (words) => figures(words).match(/<td class="n">(?:few|0)<\/td><td colspan="2">-<\/td>/g)?.length ?? 0;
  const rows = (words) => figures(words).match(/<tr><td title="[a-z_]+">[^<]+<\/td><td class="n">/g).length;
  assert.ok(rows(own) > 10);
  assert.equal(silent(own), rows(own), "a row tells of others");
  assert.ok(silent(admin) < rows(admin) / 2, "the instructor is told");
}

/** An attempt of room-1 in which an error was made: {session, number, occurrences}. */
async function hasty({ testbed }, ask) {
  const id = await testbed.runAnew("room-1"); // all of it is replayed
  await sleep(5000); // of a session before the attempt
  await testbed.session("begin", "room-1", "hasty");
  await sleep(3000); // for its hands to come to the knee
  await testbed.session("leave", "room-1");
  const steps = await testbed.steps("room-1");
  await testbed.session("stop", "room-1");
  const { number } = await until("the attempt is kept", async () => (await ask("/attempts?limit=50")).attempts.find(({ session }) => session === id));
  return { session: id, steps, ...(await ask(`/attempts/${id}/${number}`)) };
}

async function overlap(page, ...selectors) {
  const [a, b] = await Promise.all(selectors.map((selector) => page.locator(selector).first().boundingBox()));
  return a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
}

async function an_error_of_an_attempt_leads_to_what_led_to_it(world) {
  const { browser, users } = world;
  const context = await browser.context(users.instructor);
  const desk = await browser.page(context, "#/nowhere");
  const { session, steps, attempt, occurrences } = await hasty(world, (path) => desk.evaluate(async (of) => (await fetch(`/api/v1${of}`)).json(), path));
  assert.ok(occurrences.length > 0, "the hands are not hasty");
  const page = await browser.page(context, `#/session/${session}?attempt=${attempt.number}`);
  await replayed(page);
  const outcome = page.locator(".outcome");
  await outcome.getByText("Not yet").waitFor();
  const clock = async () => /^(\d+):(\d+\.\d) \//.exec(await page.locator(".transport-clock").innerText());
  const seconds = async () => Number((await clock())[1]) * 60 + Number((await clock())[2]);
  const last = occurrences.at(-1);
  const happened = Number(steps.find((row) => Number(row.step) === last.step).t_seconds);
  await outcome.getByRole("button", { name: /^Go to Haste/ }).last().click();
  await page.locator(".debrief-scope .scope-round:not(.dark) canvas").waitFor();
  await until("it is some seconds before the error", async () => Math.abs((await seconds()) - Math.max(0, happened - 4)) < 0.15);
  await browser.picture(page, "debrief-error");
  for (const other of [".viewport", ".plots-panel", ".panels"]) assert.ok(!(await overlap(page, ".debrief-scope", other)), `the scope covers ${other}`);
  assert.ok(!(await overlap(page, ".tools-left .tool-row", ".tools-right")), "the tools of the picture cover each other");
  await browser.check(page, "debrief, error");
  await outcome.getByRole("button", { name: "Outcome" }).click();
  await until("it is the attempt's end", async () => (await seconds()) > happened);
}

export const tests = [
  an_error_of_an_attempt_leads_to_what_led_to_it,
  a_recorded_session_ends_with_the_volume_that_it_had, another_session_is_seen_beside_and_goes_with_the_cursor,
  the_hands_of_a_session_on_another_case_are_carried_over, a_trainees_report_tells_nothing_of_the_few_others,
  a_record_that_cannot_be_read_says_what_is_wrong,
];
