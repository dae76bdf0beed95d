// The server is killed and comes back: pages say so, and go on by themselves.
import assert from "node:assert/strict";
import { until } from "../programs.mjs";

const MAY = [/ERR_CONNECTION/, /WebSocket connection/, /Failed to load resource/];

const controlsOf = (page) => page.locator(".controls button");

async function brokenStation(page) {
  await page.getByText(/No connection to the server for \d+ s/).waitFor();
  assert.equal(await page.locator(".state-badge").innerText(), "No data");
  await page.locator(".controls-line", { hasText: "Commands are disabled: the server cannot be reached" }).waitFor();
  const enabled = await controlsOf(page).evaluateAll((all) => all.filter((one) => !one.disabled).map((one) => one.textContent));
  assert.deepEqual(enabled, [], "these can be pressed");
}

async function wholeStation(page) {
  await until("nothing is old", async () => !(await page.getByText(/No connection to the server|No data from the station/).isVisible()));
  await page.locator(".state-badge", { hasText: "Running" }).waitFor();
  await until("it can be controlled", () => page.getByRole("button", { name: "Pause" }).isEnabled());
  assert.doesNotMatch(await page.locator(".controls-line").innerText(), /Commands are disabled/);
}

async function pages_outlive_a_server_that_is_killed({ testbed, browser, users }) {
  await testbed.runStation("room-1");
  const context = await browser.context(users.instructor);
  const wall = await browser.page(context, "#/wall", MAY);
  const station = await browser.page(context, "#/station/room-1", MAY);
  const scope = await browser.page(context, "#/scope/room-1", MAY);
  const clock = async () => (await station.locator(".session-clock").innerText()).split(":").reduce((sum, part) => 60 * sum + Number(part), 0);
  await station.locator("canvas.scene-canvas").waitFor();
  await until("a session", async () => (await station.locator(".session-clock").innerText()) !== "");
  const [before, at] = [await testbed.station("room-1"), await clock()];
  await testbed.killServer();
  for (const page of [wall, station]) await page.locator(".link-sign", { hasText: /Connection lost \d+ s ago/ }).waitFor();
  await brokenStation(station);
  await scope.locator(".scope-sign.stale", { hasText: /No connection to the server for \d+ s/ }).waitFor();
  await wall.locator(".wall-summary", { hasText: /No connection to the server for \d+ s/ }).waitFor();
  await wall.locator(".alarm", { hasText: /No data for \d+ s. Everything shown is out of date/ }).waitFor();
  await wall.locator("article.card.old", { hasText: "room-1" }).getByText(/No data for \d+ s/).waitFor();
  await browser.picture(wall, "wall-broken");
  await browser.picture(station, "station-broken");
  await testbed.startServer();
  for (const page of [wall, station]) await page.locator(".link-sign", { hasText: "Live" }).waitFor({ timeout: 30_000 });
  await wall.locator('article.card[data-status="running"]').filter({ hasText: "room-1" }).waitFor({ timeout: 60_000 });
  assert.equal((await testbed.station("room-1")).id, before.id);
  await until("the session goes on", async () => (await clock()) > at);
  await wholeStation(station);
  await until("the scope is new", async () => (await scope.locator(".scope-sign.stale").innerText()) === "");
  await until("no card is old", async () => (await wall.locator("article.card.old").count()) === 0);
  await station.reload();
  await station.getByRole("heading", { name: "room-1" }).waitFor();
  await station.locator(".state-badge", { hasText: "Running" }).waitFor();
}

// It closes its sessions and says so: for a moment the page has none.
async function a_server_that_is_restarted_leaves_nothing_over_the_joint({ testbed, browser, users }) {
  await testbed.runStation("room-1");
  const page = await browser.page(await browser.context(users.instructor), "#/station/room-1", MAY);
  await page.locator("canvas.scene-canvas").waitFor();
  await testbed.endServer();
  await page.locator(".link-sign", { hasText: /Connection lost/ }).waitFor();
  await testbed.startServer();
  await page.locator(".link-sign", { hasText: "Live" }).waitFor({ timeout: 30_000 });
  await testbed.runStation("room-1");
  await wholeStation(page);
  await page.locator("canvas.scene-canvas").waitFor();
  await until("nothing is over the joint", async () => (await page.locator(".viewport-state").innerText()) === "");
}

// As where a cable is pulled: the connection stands, and nothing comes.
async function a_connection_that_says_nothing_is_called_old({ testbed, browser, users }) {
  await testbed.runStation("room-1");
  const page = await browser.page(await browser.context(users.instructor), "#/station/room-1", MAY);
  await page.locator(".state-badge", { hasText: "Running" }).waitFor();
  testbed.server.process.kill("SIGSTOP");
  try {
    await page.locator(".link-sign", { hasText: /No data for \d+ s/ }).waitFor();
    await brokenStation(page);
  } finally {
    testbed.server.process.kill("SIGCONT");
  }
  await page.locator(".link-sign", { hasText: "Live" }).waitFor();
  await wholeStation(page);
}

export const tests = [a_connection_that_says_nothing_is_called_old, a_server_that_is_restarted_leaves_nothing_over_the_joint, pages_outlive_a_server_that_is_killed];
