// The force of an instrument on the instructor's page.
import assert from "node:assert/strict";
import { STATIONS } from "../testbed.mjs";
import { until } from "../programs.mjs";

const open = async ({ testbed, browser, users }, name) => {
  await testbed.runStation(name);
  const page = await browser.page(await browser.context(users.instructor), `#/station/${name}`);
  await page.locator("canvas.scene-canvas").waitFor();
  return page;
};
const label = (page) => page.locator(".plot-label", { hasText: "Force" });
const reading = async (page, row) => Number(await page.locator(".plot-label", { hasText: row }).locator(".plot-reading").first().innerText());

async function the_plots_have_a_row_of_force_where_a_gauge_is(world) {
  const pressed = await open(world, "room-2");
  await label(pressed).waitFor();
  await until("the force of its gauge", async () => (await reading(pressed, "Force")) === STATIONS["room-2"].force);
  const without = await open(world, "room-3");
  await until("a moment", async () => (await reading(without, "Flexion")) >= 0);
  assert.equal(await label(without).isVisible(), false);
}

async function the_figures_have_the_force_by_what_is_touched(world) {
  const page = await open(world, "room-2");
  await page.getByRole("tab", { name: "Metrics" }).click();
  const row = page.locator("tr", { hasText: "Force in touch, peak" }).first();
  await until("the peak", async () => (await row.count()) && (await row.innerText()).includes(String(STATIONS["room-2"].force)));
}

export const tests = [the_plots_have_a_row_of_force_where_a_gauge_is, the_figures_have_the_force_by_what_is_touched];
