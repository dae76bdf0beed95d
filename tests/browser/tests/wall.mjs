// The wall: a station comes, degrades, goes and comes back.
import assert from "node:assert/strict";
import { until } from "../programs.mjs";

const card = (page, station) => page.locator("article.card").filter({ has: page.locator(".name", { hasText: new RegExp(`^${station}$`) }) });
const standing = (page, station, kind, seconds) =>
  until(`${station} is ${kind}`, async () => (await card(page, station).getAttribute("data-status")) === kind, seconds);

/** Whether a card's border is that of a card without a warning, and whether it is one with the least. */
const borders = (of) => of.evaluate((element) => ["--line", "--look"].map((token) => {
  const swatch = element.appendChild(document.createElement("i"));
  swatch.style.color = `var(${token})`;
  const { color } = getComputedStyle(swatch);
  swatch.remove();
  const { borderTopColor, boxShadow } = getComputedStyle(element);
  return borderTopColor === color && boxShadow === "none";
}));

async function a_station_comes_degrades_goes_and_comes_back({ testbed, browser, users }) {
  const page = await browser.page(await browser.context(users.instructor), "#/wall");
  const absent = page.locator("details.absent");
  await absent.getByText(/^\d+ stations not connected$/).click(); // others come and go in other lanes
  await absent.getByRole("link", { name: "room-2", exact: true }).waitFor();
  await testbed.enrol("room-2"); // the tracker's time runs from the mock-up's start
  await testbed.startMockup("room-2", { faults: [["dropout", 8, 10]] }); // late and long enough for a busy machine
  const station = await testbed.startStation("room-2");
  await standing(page, "room-2", "running");
  await card(page, "room-2").getByText("bert").waitFor();
  await absent.getByRole("link", { name: "room-2", exact: true }).waitFor({ state: "detached" });
  await until("the scope's picture", () => card(page, "room-2").locator(".mini.in-scope").count());
  assert.equal(await card(page, "room-2").locator("dl").isVisible(), false);
  await until("its case is unchecked", async () => (await card(page, "room-2").getAttribute("data-urgency")) === "look");
  assert.deepEqual(await borders(card(page, "room-2")), [true, false], "that is for the technician, and no border says it");
  await page.getByLabel("Technical figures").check();
  const devices = card(page, "room-2").locator(".value").filter({ has: page.locator("dt", { hasText: /^Devices$/ }) }).locator(".figure");
  await until("the tracker is lost", async () => (await devices.innerText()) === "1/2");
  await page.locator(".attention-list").getByRole("link", { name: /room-2/ }).waitFor();
  assert.notEqual(await card(page, "room-2").getAttribute("data-urgency"), "quiet");
  await browser.picture(page, "wall-degraded");
  await until("the tracker is back", async () => (await devices.innerText()) === "2/2");
  await station.end("SIGKILL");
  await standing(page, "room-2", "gone");
  const before = await testbed.station("room-2");
  await testbed.startStation("room-2");
  await standing(page, "room-2", "running");
  assert.equal((await testbed.station("room-2")).id, before.id);
  await testbed.endStation("room-2");
}

async function the_name_of_an_absent_station_leads_to_it({ browser, users }) {
  const page = await browser.page(await browser.context(users.instructor), "#/wall");
  await page.locator("details.absent summary").click();
  await page.locator("details.absent").getByRole("link", { name: "sim-05" }).click();
  await page.getByRole("heading", { name: "sim-05" }).waitFor();
  assert.match(page.url(), /#\/station\/sim-05$/);
}

export const tests = [a_station_comes_degrades_goes_and_comes_back, the_name_of_an_absent_station_leads_to_it];
