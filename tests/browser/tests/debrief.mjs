// A recorded session, replayed.
import assert from "node:assert/strict";
import { truncateSync } from "node:fs";
import { basename } from "node:path";
import { call, sleep, until } from "../programs.mjs";

async function a_recorded_session_ends_with_the_volume_that_it_had({ house, browser, who }) {
  const { id, resection: live } = await house.recorded();
  const page = await browser.page(await browser.context(who.instructor), `#/session/${id}`);
  const left = page.locator(".resection-group").first().locator(".figure").filter({ hasText: "Volume left" }).locator("dd").first();
  await page.getByText("All is here, end volume as recorded").waitFor(); // of the page's own mesh
  const begin = Number((await left.innerText()).replace(/[^0-9.]/g, ""));
  await page.locator("main").press("End");
  await until("the volume of the end", async () => Math.abs(Number((await left.innerText()).replace(/[^0-9.]/g, "")) - live.volume_mm3) <= 0.5);
  assert.ok(begin > live.volume_mm3 + 1, `${begin} mm³ at the beginning, ${live.volume_mm3} at the end`);
  assert.ok(browser.heard(page).kinds.moment > 50);
}

async function a_record_that_cannot_be_read_says_what_is_wrong({ house, browser, who }) {
  await house.runRoom("room-1");
  const { id, trace } = await house.station("room-1");
  await house.session("stop", "room-1");
  await until("it is on the disk", () => call("arthron-trace", "info", trace).then(() => true, () => false));
  truncateSync(trace, 3);
  const page = await browser.page(await browser.context(who.instructor), `#/session/${id}`);
  await page.getByText("It cannot be replayed now").waitFor();
  await page.locator(".state").getByText(basename(trace)).waitFor();
  await page.getByRole("button", { name: "Try again" }).waitFor();
  await sleep(4000); // a page that is told nothing calls what it shows old
  assert.equal(await page.locator(".link-sign").getAttribute("data-state"), "idle");
  assert.equal(browser.heard(page).kinds.moment, undefined);
}

// What others came to is told to a trainee only where there are many of them.
async function a_trainees_report_tells_nothing_of_the_few_others({ house, browser, who }) {
  const { id } = await house.recorded();
  const open = async (state) => browser.page(await browser.context(state), "#/nowhere");
  const report = (page) => page.evaluate(async (session) => (await fetch(`/api/v1/sessions/${session}/report?course=autumn`)).text(), id);
  const [trainee, instructor] = [await open(who.trainee), await open(who.instructor)];
  await instructor.evaluate(async () => {
    const send = (path, body) => fetch(`/api/v1${path}`, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });
    await send("/courses", { name: "autumn" });
    await send("/courses/autumn/trainees", { trainee: "anna" });
  });
  const [own, desk] = [await report(trainee), await report(instructor)];
  assert.ok(/Of fewer than \d+ trainees, nothing/.test(own), "the trainee is told what is kept back");
  assert.ok(/Of fewer than \d+ sessions, the figures themselves/.test(desk), "and the instructor what is not");
  const figures = (words) => words.split("<h2>Figures</h2>")[1].split("</table>")[0];
  const silent = (words) => figures(words).match(/<td class="n">(?:few|0)<\/td><td colspan="2">-<\/td>/g)?.length ?? 0;
  const rows = (words) => figures(words).match(/<tr><td>[a-z_]+<\/td><td class="n">/g).length;
  assert.ok(rows(own) > 10);
  assert.equal(silent(own), rows(own), "a row tells of others");
  assert.ok(silent(desk) < rows(desk) / 2, "the instructor is told");
}

export const tests = [a_recorded_session_ends_with_the_volume_that_it_had, a_trainees_report_tells_nothing_of_the_few_others, a_record_that_cannot_be_read_says_what_is_wrong];
