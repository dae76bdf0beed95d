// The server is killed and comes back: pages say so, and go on by themselves.
import assert from "node:assert/strict";
import { until } from "../programs.mjs";

const MAY = [/ERR_CONNECTION/, /WebSocket connection/, /Failed to load resource/];

async function pages_outlive_a_server_that_is_killed({ house, browser, who }) {
  await house.runRoom("room-1");
  const context = await browser.context(who.instructor);
  const wall = await browser.page(context, "#/wall", MAY);
  const station = await browser.page(context, "#/station/room-1", MAY);
  const clock = async () => (await station.locator(".session-clock").innerText()).split(":").reduce((sum, part) => 60 * sum + Number(part), 0);
  await station.locator("canvas.scene-canvas").waitFor();
  await until("a session", async () => (await station.locator(".session-clock").innerText()) !== "");
  const [before, at] = [await house.station("room-1"), await clock()];
  await house.killServer();
  for (const page of [wall, station]) await page.locator(".link-sign", { hasText: /Connection lost \d+ s ago/ }).waitFor();
  await station.getByText(/Nothing from the station for \d+ s/).waitFor();
  await browser.picture(wall, "wall-broken");
  await browser.picture(station, "station-broken");
  await house.startServer();
  for (const page of [wall, station]) await page.locator(".link-sign", { hasText: "Live" }).waitFor({ timeout: 30_000 });
  await wall.locator('article.card[data-standing="running"]').filter({ hasText: "room-1" }).waitFor({ timeout: 60_000 });
  assert.equal((await house.station("room-1")).id, before.id);
  await until("the session goes on", async () => (await clock()) > at);
  await until("nothing is old", async () => !(await station.getByText(/Nothing from the station/).isVisible()));
  await station.reload();
  await station.getByRole("heading", { name: "room-1" }).waitFor();
  await station.locator(".state-badge", { hasText: "Running" }).waitFor();
}

export const tests = [pages_outlive_a_server_that_is_killed];
