// A recorded session, replayed.
import assert from "node:assert/strict";
import { until } from "../programs.mjs";

async function a_recorded_session_ends_with_the_volume_that_it_had({ house, browser, who }) {
  await house.runRoom("room-1");
  await until("cuts", async () => (await house.resection("room-1")).cuts >= 3);
  await house.session("pause", "room-1");
  const live = await house.resection("room-1");
  const { id } = await house.station("room-1");
  await house.session("stop", "room-1");
  const page = await browser.page(await browser.context(who.instructor), `#/session/${id}`);
  const left = page.locator(".resection-group").first().locator(".figure").filter({ hasText: "Volume left" }).locator("dd").first();
  await until("the end of the replay", async () => browser.heard(page).kinds.metrics > 0);
  await until("the mesh of the end", async () => browser.heard(page).acks.meniscus_medial?.hash === live.mesh_hash);
  await until("the volume of the end", async () => Math.abs(Number((await left.innerText()).replace(/[^0-9.]/g, "")) - live.volume_mm3) <= 0.5);
  assert.ok(browser.heard(page).kinds.moment > 50);
}

export const tests = [a_recorded_session_ends_with_the_volume_that_it_had];
