// A session as the instructor sees and controls it. What the page shows is held against what the server says
// by another way, its local socket.
import assert from "node:assert/strict";
import { ALIKE, difference, still } from "../browser.mjs";
import { call, sleep, until } from "../programs.mjs";

const open = async ({ testbed, browser, users }, name) => {
  await testbed.runStation(name);
  const page = await browser.page(await browser.context(users.instructor), `#/station/${name}`);
  await page.locator("canvas.scene-canvas").waitFor();
  return page;
};
const figure = async (page, label) => {
  const row = page.locator(".resection-group").first().locator(".figure").filter({ hasText: label }).locator("dd").first();
  return Number((await row.innerText()).replace(/[^0-9.]/g, ""));
};
const plotted = async (page, row) => Number((await page.locator(".plot-label", { hasText: row }).locator(".plot-reading").first().innerText()).replace(",", ""));
const press = (page, name) => page.getByRole("button", { name, exact: true }).click();
const pressMore = async (page, name) => {
  await page.locator("summary", { hasText: "More" }).click();
  await press(page, name);
};
const said = (page, words) => page.locator(".controls-line", { hasText: words }).waitFor();

/** The page has the mesh that the server has, to the bit. */
async function sameMesh({ testbed, browser }, page, name) {
  await until("the page has the server's mesh", async () => {
    const there = await testbed.resection(name);
    const here = browser.heard(page).acks.meniscus_medial;
    return here?.number === there.mesh_number && here.hash === there.mesh_hash;
  });
}

const scene = (page) => still(page.locator("canvas.scene-canvas"));

// From above and near, without what lies over them.
async function showMenisci(page) {
  await page.locator("summary", { hasText: "Show" }).click();
  for (const name of ["Femur", "Patella", "Measured instruments", "Tip trails"]) await page.getByLabel(name, { exact: true }).uncheck();
  await page.keyboard.press("Escape");
  await page.getByRole("button", { name: "Superior" }).click();
  await scene(page);
  for (let i = 0; i < 6; i++) await page.locator("canvas.scene-canvas").press("+");
}

// Stroke by stroke, until the server has none.
const undoAll = (testbed) => until("nothing is left to be undone", () => testbed.session("undo", "room-1").then(() => false, () => true));

async function a_cut_changes_mesh_and_figures_and_is_set_back(world) {
  const { testbed } = world;
  const page = await open(world, "room-1");
  await until("cuts", async () => (await testbed.resection("room-1")).cuts >= 6);
  const labels = async () => (await page.locator(".plot-label:visible").allInnerTexts()).map((words) => words.split("\n")[0].trim());
  const usual = await labels();
  assert.ok(usual.length >= 4 && !usual.some((words) => /scale|offset/i.test(words)), `an instructor sees ${usual}`);
  await page.getByLabel("Motion scale and offset").check();
  await until("who asks sees them", async () => (await labels()).length === usual.length + 2);
  await page.getByLabel("Motion scale and offset").uncheck();
  await press(page, "Pause");
  await said(page, "Pause: done");
  assert.equal((await testbed.station("room-1")).state, "paused");
  await testbed.session("undo", "room-1"); // a cut that was on its way has landed before
  await sameMesh(world, page, "room-1");
  const cut = await testbed.resection("room-1");
  await until("the volume that is left", async () => Math.abs((await figure(page, "Volume left")) - cut.volume_mm3) <= 0.5);
  await until("the plot has what was removed", async () => Math.abs((await plotted(page, "Removed")) - cut.removed_mm3 - cut.pieces_mm3) <= 0.6);
  await press(page, "Undo cut");
  await said(page, "Undo cut: done");
  await sameMesh(world, page, "room-1");
  const back = await testbed.resection("room-1");
  assert.ok(back.cuts < cut.cuts, `${back.cuts} cuts are left of ${cut.cuts}`);
  await until("the volume of before", async () => Math.abs((await figure(page, "Volume left")) - back.volume_mm3) <= 0.5);
  await undoAll(testbed);
  await sameMesh(world, page, "room-1");
  const whole = (await testbed.resection("room-1")).volume_mm3;
  assert.ok(whole > cut.volume_mm3 + 1, `${whole} whole, ${cut.volume_mm3} cut`);
  await until("the whole again", async () => Math.abs((await figure(page, "Volume left")) - whole) <= 0.5);
  await until("the plot has that nothing is removed", async () => (await plotted(page, "Removed")) === 0);
  await press(page, "Resume");
  await said(page, "done");
}

// Pixels of the palette's blue and orange: tissue and bone are paler. What else is blue stays.
function strong({ data }) {
  let count = 0;
  for (let at = 0; at < data.length; at += 4) {
    const [r, b] = [data[at], data[at + 2]];
    if (Math.max(r, b) > 60 && Math.min(r, b) < 0.9 * Math.max(r, b)) count++;
  }
  return count;
}

// How much of the picture tells that touch and sight differ. Leaves the tissue's own colours.
async function mismatchSeen({ browser }, page, name) {
  const colours = page.getByLabel("Colours", { exact: true });
  await colours.selectOption("Touch and sight");
  const legend = page.locator(".legend", { hasText: "touched where nothing is seen" });
  await legend.waitFor();
  await browser.picture(page, name);
  await browser.check(page, name);
  await legend.evaluate((element) => (element.style.visibility = "hidden")); // it lies over the picture
  const seen = strong(await scene(page));
  await legend.evaluate((element) => (element.style.visibility = ""));
  await colours.selectOption("Tissue");
  return seen;
}

// The hands rest in all three pictures, so that nothing but the tissue can differ.
async function a_cut_is_seen_in_the_picture_until_it_is_undone(world) {
  const { testbed } = world;
  const page = await open(world, "room-1");
  try {
    await testbed.moveHands("room-1", "rest");
    await testbed.session("stop", "room-1");
    await testbed.session("start", "room-1");
    await page.locator(".state-badge", { hasText: "Running" }).waitFor();
    await showMenisci(page);
    const whole = await scene(page);
    await testbed.moveHands("room-1", "bites");
    await until("cuts", async () => (await testbed.resection("room-1")).cuts >= 6);
    await testbed.session("pause", "room-1");
    await testbed.moveHands("room-1", "rest");
    await sameMesh(world, page, "room-1");
    const cut = difference(whole, await scene(page));
    const mismatch = await mismatchSeen(world, page, "station-touch-and-sight");
    await undoAll(testbed);
    await sameMesh(world, page, "room-1");
    const undone = difference(whole, await scene(page));
    const agreed = await mismatchSeen(world, page, "station-touch-and-sight-agree");
    assert.ok(cut > 2 * ALIKE, `${cut} of the picture is another after the cuts`);
    assert.ok(undone < ALIKE, `${undone} of it is another after their undo`);
    assert.ok(mismatch > agreed + 40, `${mismatch} pixels are blue or orange, and ${agreed} after the undo`);
  } finally {
    await testbed.moveHands("room-1", "bites");
    await testbed.session("start", "room-1");
  }
}

async function a_refusal_is_shown_in_the_servers_words(world) {
  const page = await open(world, "room-1");
  await press(page, "Pause");
  await said(page, "Pause: done");
  await undoAll(world.testbed);
  await press(page, "Undo cut");
  await said(page, /Undo cut: .*no cut/);
  await press(page, "Resume");
  await said(page, "done");
}

async function a_note_and_a_marker_reach_the_scope_and_the_trace(world) {
  const { testbed, browser, users } = world;
  const page = await open(world, "room-1");
  const trainee = await browser.page(await browser.context(users.trainee), "#/scope/room-1");
  await press(page, "Note …");
  await page.getByLabel("Text").fill("Lift the hand");
  await press(page, "Send");
  await trainee.getByText("Lift the hand").waitFor();
  await page.getByRole("tab", { name: "Remarks" }).click();
  await page.locator(".remarks-list").getByText("Lift the hand").waitFor();
  await press(page, "Marker");
  await until("the tip is marked", async () => {
    await page.locator("body").press("t");
    return page.locator(".controls-line", { hasText: "Marker: done" }).isVisible();
  });
  await trainee.getByText("Touch the marked point").waitFor();
  await press(page, "Remove marker");
  await said(page, "Remove marker: done");
  await until("the marker is gone", async () => !(await trainee.getByText("Touch the marked point").isVisible()));
  const { trace } = await testbed.station("room-1");
  const remarks = await until("it is on the disk", async () => {
    const { remarks: all } = JSON.parse(await call("arthron-trace", "info", trace, "--json").catch((error) => error.stdout));
    return all?.length === 2 && all;
  });
  assert.equal(remarks[0].text, "Lift the hand");
  assert.equal(remarks[0].author, "grace");
  const noted = await page.evaluate(async () => (await (await fetch("/api/v1/audit?limit=50")).json()).audit);
  assert.ok(noted.some((row) => row.actor === "grace" && /note/.test(row.action)), "it is not in the audit log");
}

async function a_session_is_started_stopped_and_given_another_case(world) {
  const { testbed } = world;
  const page = await open(world, "room-1");
  await press(page, "Pause");
  await said(page, "Pause: done");
  const first = await testbed.station("room-1");
  await pressMore(page, "Case …");
  await page.getByLabel("Case", { exact: true }).selectOption("healthy");
  await page.getByRole("slider", { name: "Patient shape" }).fill("40");
  await press(page, "Start session");
  await page.getByText("healthy · Patient shape: 40 %").waitFor();
  const second = await testbed.station("room-1");
  assert.equal(second.case, "healthy");
  assert.notEqual(second.id, first.id);
  await press(page, "Stop");
  await page.locator("dialog").getByRole("button", { name: "Stop" }).click();
  await page.locator(".state-badge", { hasText: "Closed" }).waitFor();
  assert.equal((await testbed.station("room-1")).state, "closed");
  assert.match(await page.getByRole("link", { name: "Open debrief" }).getAttribute("href"), new RegExp(`#/session/${second.id}$`));
  assert.deepEqual(await page.locator(".controls > .controls-group").getByRole("button").allInnerTexts(), ["Start"], "nothing else can be done");
  await press(page, "Start");
  await page.locator(".state-badge", { hasText: "Running" }).waitFor();
  assert.notEqual((await testbed.station("room-1")).id, second.id);
  await pressMore(page, "Case …");
  await page.getByLabel("Case", { exact: true }).selectOption("tear-radial");
  await page.getByRole("slider", { name: "Patient shape" }).fill("100");
  await press(page, "Start session");
  await page.getByText("tear-radial · Patient shape: full").waitFor();
  const actions = await page.evaluate(async () => (await (await fetch("/api/v1/audit?limit=50")).json()).audit);
  for (const action of [/stop/, /case/, /pause/])
    assert.ok(actions.some((row) => row.actor === "grace" && action.test(row.action)), `${action} is not in the audit log: ${actions.map((row) => row.action)}`);
}

async function a_reset_makes_the_tissue_whole(world) {
  const { testbed } = world;
  const page = await open(world, "room-1");
  await until("a cut", async () => (await testbed.resection("room-1")).cuts > 0);
  const mockup = testbed.mockups["room-1"].program.process;
  mockup.kill("SIGSTOP"); // a session that was reset runs, and would be cut again
  try {
    const cut = await until("the last cut has landed", async () => {
      const before = await testbed.resection("room-1");
      await sleep(1000);
      return (await testbed.resection("room-1")).cuts === before.cuts && before;
    });
    await pressMore(page, "Reset");
    await page.locator("dialog").getByRole("button", { name: "Cancel" }).click();
    assert.equal((await testbed.resection("room-1")).cuts, cut.cuts, "Cancel cancels");
    await pressMore(page, "Reset");
    await page.locator("dialog").getByRole("button", { name: "Reset" }).click();
    await said(page, "Reset: done");
    await until("nothing is cut", async () => (await testbed.resection("room-1")).removed_mm3 === 0);
    await sameMesh(world, page, "room-1");
    const now = await testbed.resection("room-1");
    assert.ok(now.volume_mm3 > cut.volume_mm3, `${now.volume_mm3} now, ${cut.volume_mm3} before`);
    await until("the page says so", async () => Math.abs((await figure(page, "Volume left")) - now.volume_mm3) <= 0.5);
  } finally {
    mockup.kill("SIGCONT");
  }
}

/** A trainee of the config who signs in by a code that the instructor makes. */
async function traineeOf({ browser, users }, name) {
  const admin = await browser.page(await browser.context(users.instructor), "#/nowhere");
  const code = await admin.evaluate(async (trainee) => {
    const post = async (path, body) => (await fetch(`/api/v1${path}`, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) })).json();
    await post("/trainees", { name: trainee });
    return (await post(`/trainees/${trainee}/code`, {})).code;
  }, name);
  const context = await browser.context();
  const page = await browser.page(context, "#/sign-in", [/status of 40/]);
  await page.getByRole("tab", { name: "With a code" }).click();
  await page.getByLabel("Sign-in code").fill(code);
  await page.getByRole("button", { name: "Sign in" }).click();
  await page.getByRole("heading", { name: "Today" }).waitFor();
  return page;
}

const OWN = "sim-20"; // its case is arthrosis

async function assign(page, trainee) {
  await pressMore(page, "Trainee …");
  await page.getByLabel("Trainee", { exact: true }).selectOption(trainee);
  await press(page, "Assign");
  await said(page, "Trainee: done");
}

async function a_trainee_is_told_that_a_session_is_anothers({ testbed, browser }, dora) {
  await dora.goto(`${browser.url}/#/station/room-99`);
  await dora.getByText("You have no session here").waitFor();
  await dora.goto(`${browser.url}/#/station/${OWN}`);
  await dora.getByText("You have no session here").waitFor();
  const since = performance.now();
  await browser.check(dora, "another's station");
  await browser.picture(dora, "station-of-another");
  assert.equal(await dora.getByRole("link", { name: "Class" }).count(), 0);
  assert.doesNotMatch(await dora.locator("body").innerText(), /anna|arthrosis|Waiting for/);
  const { kinds } = browser.heard(dora);
  assert.deepEqual([kinds.session, kinds.moment, kinds.resection, kinds.place], [undefined, undefined, undefined, undefined]);
  await sleep(4000 - (performance.now() - since));
  assert.equal(await dora.locator(".link-sign").innerText(), "Live"); // nothing comes, and nothing is wrong
  await dora.goto(`${browser.url}/#/scope/${OWN}`);
  await dora.getByText("You have no session here").waitFor();
  await dora.goto(`${browser.url}/#/station/${OWN}`);
}

async function a_trainee_sees_a_session_once_it_is_theirs(world, dora, name) {
  const { testbed, browser, users } = world;
  const admin = await browser.page(await browser.context(users.instructor), `#/station/${OWN}`);
  await admin.locator("canvas.scene-canvas").waitFor();
  await assign(admin, name);
  await press(admin, "Stop");
  await admin.locator("dialog").getByRole("button", { name: "Stop" }).click();
  await admin.locator(".state-badge", { hasText: "Closed" }).waitFor();
  await press(admin, "Start");
  await dora.locator(".state-badge", { hasText: "Running" }).waitFor();
  await admin.getByText(`${name} · arthrosis`).waitFor();
  const { id } = await testbed.station(OWN);
  const hers = () => admin.evaluate(async (trainee) => (await (await fetch(`/api/v1/sessions?trainee=${trainee}`)).json()).sessions, name);
  const ids = await until("the records have it", async () => {
    const rows = await hers();
    return rows.length > 0 && rows.map((row) => row.id);
  });
  assert.deepEqual(ids, [id]);
  await assign(admin, "anna");
}

async function a_trainee_is_told_that_a_session_is_anothers_and_sees_it_once_it_is_not(world) {
  const { testbed } = world;
  const name = testbed.newName("dora");
  const dora = await traineeOf(world, name);
  await testbed.withOwnStation(OWN, "anna", async () => {
    await a_trainee_is_told_that_a_session_is_anothers(world, dora);
    await a_trainee_sees_a_session_once_it_is_theirs(world, dora, name);
    await testbed.session("stop", OWN);
    await testbed.session("start", OWN);
    await dora.getByText("You have no session here").waitFor();
  });
}

export const tests = [
  a_cut_changes_mesh_and_figures_and_is_set_back, a_cut_is_seen_in_the_picture_until_it_is_undone,
  a_refusal_is_shown_in_the_servers_words, a_note_and_a_marker_reach_the_scope_and_the_trace,
  a_session_is_started_stopped_and_given_another_case, a_reset_makes_the_tissue_whole,
  a_trainee_is_told_that_a_session_is_anothers_and_sees_it_once_it_is_not,
];
