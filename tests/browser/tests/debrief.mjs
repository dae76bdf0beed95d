// A recorded session, replayed.
import assert from "node:assert/strict";
import { until } from "../programs.mjs";

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

export const tests = [a_recorded_session_ends_with_the_volume_that_it_had];
