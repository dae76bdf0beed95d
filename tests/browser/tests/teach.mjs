// Who trains at a station without an instructor, and who plans, follows and rates what they do.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { SIZES, still } from "../browser.mjs";
import { sleep, until } from "../programs.mjs";
import { pointing } from "../motion.mjs";
import { STATIONS } from "../testbed.mjs";
import { look } from "./views.mjs";

const STATION = "sim-21"; // its case is healthy
const TORN_STATION = "sim-22"; // tear-radial
const EXAM_STATION = "sim-24"; // on the same case
const RATED = { station: "room-2", trainee: "bert" };
const POINTING = "room-2"; // whose hands hold a probe
const [PX_PER_MM, STAY_S, GAP_PX] = [4, 3, 32]; // of web/src/teach/dwell.ts; longer than there, for a busy machine; from a key to the gap below
const ATTEMPT_MS = 2000;
const TASK = "steady-camera";
const FEEDBACK_S = 5;

const press = (where, name) => where.getByRole("button", { name, exact: true }).click();

/** What the instructor asks of the API, beside the pages. */
const asker = async ({ browser, users }) => {
  const page = await browser.page(await browser.context(users.instructor), "#/nowhere");
  return (method, path, body) => page.evaluate(async (of) => {
    const response = await fetch(`/api/v1${of.path}`, { method: of.method, ...(of.body && { headers: { "Content-Type": "application/json" }, body: JSON.stringify(of.body) }) });
    if (!response.ok) throw new Error(`${of.path}: ${await response.text()}`);
    return response.status === 204 ? undefined : response.json();
  }, { method, path, body });
};

/** A course with a plan of one task, and a trainee in it. */
async function makeCourse(ask, { testbed }) {
  const [course, trainee] = [testbed.newName("arthroscopy"), testbed.newName("eva")];
  await ask("POST", "/courses", { name: course });
  await ask("POST", "/trainees", { name: trainee });
  await ask("POST", `/courses/${course}/trainees`, { trainee });
  await ask("PUT", `/courses/${course}/curriculum`, { version: 0, state: "published", tasks: [{ task: TASK, week: 1, passes: 2 }, { task: "palpation", week: 2 }] });
  return { course, trainee };
}

/** The wall names who asks for help, with what the scope sees there; its limits can be set for a task. */
async function answerOnTheWall(world, trainee) {
  const { browser, users } = world;
  const page = await browser.page(await browser.context(users.instructor), "#/wall");
  const row = page.locator(".attention-group.asks li", { hasText: trainee });
  await row.getByRole("img", { name: `Scope picture of ${trainee}` }).waitFor();
  await until("the row's picture is drawn", () => row.locator("canvas").evaluate((canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return new Set(data).size > 8;
  }));
  await look(world, page, "attention");
  await press(page, "Limits");
  const dialog = page.getByRole("dialog");
  await dialog.getByLabel("No progress for (s)").fill("60");
  await look(world, page, "attention-limits");
  await press(dialog, "Save");
  await press(page, "Limits");
  assert.equal(await dialog.getByLabel("No progress for (s)").inputValue(), "60");
  await page.close();
}

/** Beside the feedback the hands of an expert go on, through their scope. */
async function expertPlays(page) {
  const expert = page.locator(".feedback .expert");
  await expert.getByText("An expert at this goal").waitFor();
  const at = async () => Number(await expert.locator("canvas").getAttribute("data-time"));
  const first = await until("the expert is drawn", at);
  await until("the expert goes on", async () => Math.abs((await at()) - first) > 0.3);
  assert.equal(await expert.locator(".scope-state").innerText(), "", "the scope is seen");
}

/** What comes next can be read away from a station, too. */
async function traineeReadsToday(world, code) {
  const page = await world.browser.page(await world.browser.context(), "#/sign-in?code", [/status of 401/, /WebSocket connection/]);
  await page.getByLabel("Sign-in code").fill(code);
  await press(page, "Sign in");
  await page.getByText("Next: Steady camera").waitFor();
  await page.locator(".goals li", { hasText: "held for 3 s" }).first().waitFor();
  await look(world, page, "today");
  await page.close();
}

async function a_trainee_runs_a_station_alone(world) {
  const { testbed, browser, report } = world;
  const ask = await asker(world);
  const { trainee } = await makeCourse(ask, world);
  const { code } = await ask("POST", `/trainees/${trainee}/code`, {});
  await traineeReadsToday(world, code);
  await testbed.withConnected(STATION, async () => {
    const page = await browser.page(await browser.context(), `#/train/${STATION}`, [/status of 401/, /WebSocket connection/]);
    await page.getByLabel("Your code").fill(code);
    await look(world, page, "train-who");
    await press(page, "Sign in");
    await page.getByRole("heading", { name: `Today, ${trainee}` }).waitFor();
    await page.getByText("Next: Steady camera").waitFor();
    await look(world, page, "train-today");
    await press(page, "Begin");
    await press(page, "Take this station");
    const start = page.getByRole("button", { name: /^Start/ });
    await start.waitFor();
    assert.equal((await testbed.station(STATION)).trainee, trainee);
    await look(world, page, "train-briefing");
    await start.click();
    await page.getByText("Step 1 of 3").waitFor();
    for (const hint of ["in the middle of the picture", "picture upright to 20°", "held for 3 s"]) await page.locator(".do-hint li", { hasText: hint }).waitFor();
    await look(world, page, "train-do");
    await press(page, "Help");
    await answerOnTheWall(world, trainee);
    await press(page, "End attempt");
    await press(page.locator("dialog"), "End attempt");
    const ended = performance.now();
    await page.locator("[data-verdict='not yet']").waitFor();
    report.strictMark("feedback_s", (performance.now() - ended) / 1000, "s", FEEDBACK_S);
    await expertPlays(page);
    await look(world, page, "train-feedback");
    await press(page, "Leave");
    await page.getByRole("heading", { name: "Who trains?" }).waitFor();
    const { state, trainee: next } = await testbed.station(STATION);
    assert.deepEqual([state, next], ["closed", trainee], "the session has ended");
    const { attempts } = await ask("GET", `/attempts?trainee=${trainee}`);
    assert.deepEqual(attempts.map(({ task, verdict, end }) => [task, verdict, end]), [[TASK, "not yet", "left"]]);
  });
}

/** The middles of keys as the cursor has to reach them, in order; one that comes twice is left between. */
function wayOver(keys, names) {
  const places = names.map((name) => keys[name]);
  return places.flatMap((place, i) => (i && places[i - 1] === place ? [[place[0], place[1] - GAP_PX], place] : [place]));
}

async function a_trainee_points_at_the_code_with_the_probe(world) {
  const { testbed, browser } = world;
  const ask = await asker(world);
  const { trainee } = await makeCourse(ask, world);
  const { code } = await ask("POST", `/trainees/${trainee}/code`, {});
  await testbed.runStation(POINTING);
  const { port, token } = testbed.viewOf(POINTING);
  const page = await browser.page(await browser.context(), `#/train/${POINTING}?port=${port}&token=${token}`, [/status of 401/, /WebSocket connection/, /ws:\/\/127.0.0.1/]);
  await page.getByText("stay on a key for a second").waitFor();
  assert.doesNotMatch(page.url(), /token/, "the token stays in the address");
  await look(world, page, "train-who-probe");
  await page.setViewportSize(SIZES.wide);
  const keys = await page.locator(".who-keys").evaluate((area) => Object.fromEntries([...area.querySelectorAll("button")]
    .map((key) => [key.innerText, [key.offsetLeft + key.offsetWidth / 2, area.clientHeight - key.offsetTop - key.offsetHeight / 2]])));
  pointing(testbed.path(`${STATIONS[POINTING].motion}.csv`), testbed.path("pointing.csv"), wayOver(keys, [...code, "Sign in"]), PX_PER_MM, STAY_S);
  await testbed.moveHands(POINTING, "pointing");
  try {
    await page.getByRole("heading", { name: `Today, ${trainee}` }).waitFor({ timeout: 120_000 });
  } finally {
    await testbed.moveHands(POINTING, STATIONS[POINTING].motion);
  }
  await press(page, "Leave");
}

async function a_briefing_shows_the_plan(world) {
  const { testbed, browser } = world;
  const ask = await asker(world);
  const { trainee } = await makeCourse(ask, world);
  const { code } = await ask("POST", `/trainees/${trainee}/code`, {});
  await testbed.withConnected(TORN_STATION, async () => {
    const page = await browser.page(await browser.context(), `#/train/${TORN_STATION}`, [/status of 401/, /WebSocket connection/]);
    await page.getByLabel("Your code").fill(code);
    await press(page, "Sign in");
    await page.getByText("Other tasks").click();
    await press(page, "Partial meniscectomy of a radial tear");
    await press(page, "Take this station");
    const plan = page.locator(".plan-picture canvas");
    await plan.waitFor();
    await still(plan);
    await look(world, page, "train-plan");
    await press(page, "Back");
    await press(page, "Leave");
    await page.getByRole("heading", { name: "Who trains?" }).waitFor();
  });
}

/** What the trainee of an exam sees: the clock, and no goal, no hint, no count of errors, no help. */
async function traineeGetsNoHint(world, code) {
  const { browser } = world;
  const page = await browser.page(await browser.context(), `#/train/${EXAM_STATION}`, [/status of 401/, /WebSocket connection/]);
  await page.getByLabel("Your code").fill(code);
  await press(page, "Sign in");
  const edge = page.locator(".do-edge");
  await edge.getByRole("timer").waitFor();
  await look(world, page, "train-exam");
  assert.match(await edge.innerText(), /^Steady camera\s+\d:\d\d\s+of 3:00\s+End attempt$/);
}

/** In an exam nobody helps, and who intervenes says why. */
async function an_exam_is_sealed(world) {
  const { testbed, browser, users } = world;
  const ask = await asker(world);
  const { course, trainee } = await makeCourse(ask, world);
  const { exam } = await ask("POST", "/exams", { course, trainee, title: "Sealed", tasks: [TASK], cases: ["healthy"] });
  await ask("POST", `/exams/${exam.id}/begin`, { who: true, station_check: true, case_hash: true, drift_mm: 0.4 });
  await testbed.withOwnStation(EXAM_STATION, trainee, async () => {
    const page = await browser.page(await browser.context(users.instructor), `#/exams/${exam.id}`);
    await press(page, "Start");
    await page.getByRole("dialog").getByLabel("Station").selectOption(EXAM_STATION);
    await press(page.getByRole("dialog"), "Start");
    await page.getByText("Attempt begun").waitFor();
    await traineeGetsNoHint(world, (await ask("POST", `/trainees/${trainee}/code`, {})).code);
    await page.goto(`${browser.url}/#/station/${EXAM_STATION}`);
    await page.locator(".badge", { hasText: "Exam" }).waitFor();
    for (const name of ["Undo cut", "Marker", "Note …"]) assert.equal(await page.getByRole("button", { name }).count(), 0, name);
    await assert.rejects(testbed.session("undo", EXAM_STATION), /an exam runs/);
    await assert.rejects(testbed.session("stop", EXAM_STATION), /an exam runs: give a reason/);
    await press(page, "Pause");
    const dialog = page.getByRole("dialog");
    await press(dialog, "Pause");
    await dialog.getByText("Give a reason.").waitFor();
    await look(world, page, "exam-intervene");
    await dialog.getByLabel("Reason").fill("The tracker fell off.");
    await press(dialog, "Pause");
    await until("the session is paused", async () => (await testbed.station(EXAM_STATION)).state === "paused");
    const { exam: after } = await ask("GET", `/exams/${exam.id}`);
    assert.deepEqual([after.flagged, after.interventions.map(({ reason }) => reason)], [true, ["The tracker fell off."]]);
  });
}

async function a_director_and_a_rater_open_their_pages(world) {
  const { testbed, browser, users } = world;
  const ask = await asker(world);
  const { course, trainee } = await makeCourse(ask, world);
  const { exam } = await ask("POST", "/exams", { course, trainee, title: "Camera", tasks: [TASK], cases: ["healthy"] });
  const page = await browser.page(await browser.context(users.instructor), "#/courses");
  const views = [
    ["courses", "#/courses", page.getByRole("link", { name: course })],
    ["course-plan", `#/courses/${course}/plan`, page.getByRole("region", { name: "Library" })],
    ["course-task", `#/courses/${course}/plan`, page.getByText("would pass")],
    ["course-progress", `#/courses/${course}`, page.getByRole("table")],
    ["research", "#/research", page.getByText("No attempts match")],
    ["exams", "#/exams", page.getByRole("link", { name: "Camera" }).first()],
    ["exam", `#/exams/${exam.id}`, page.getByRole("button", { name: "Begin sealed exam" })],
    ["rate", "#/rate", page.getByRole("heading", { name: "To rate" })],
  ];
  for (const [name, hash, there] of views) {
    await page.goto(`${browser.url}/${hash}`);
    if (name === "course-task") await page.getByRole("button", { name: /^Palpation/ }).click();
    if (name === "research") await page.getByLabel("Course").selectOption(course);
    await there.first().waitFor();
    if (name === "course-task") await page.getByText("What each goal asks").click();
    await look(world, page, name);
  }
}

/** An attempt that ended after some steps of its session, which has a scope: {session, number}. */
async function attempted(ask, { testbed }) {
  await testbed.runStation(RATED.station);
  await testbed.session("begin", RATED.station, TASK);
  await sleep(ATTEMPT_MS);
  await testbed.session("leave", RATED.station);
  const { id } = await testbed.station(RATED.station);
  await testbed.session("stop", RATED.station);
  return until("the attempt is kept", async () => (await ask("GET", `/attempts?trainee=${RATED.trainee}`)).attempts.find(({ session }) => session === id));
}

async function a_rater_fills_the_form_beside_the_replay_through_the_scope(world) {
  const { browser, users } = world;
  const ask = await asker(world);
  const { session, number } = await attempted(ask, world);
  const page = await browser.page(await browser.context(users.instructor), `#/rate/${session}/${number}`);
  const at = async () => Number(await page.locator(".scope-replay canvas").getAttribute("data-time"));
  await page.locator(".rate-transport input:enabled").waitFor(); // the record is there
  const first = await at();
  await press(page, "Play");
  await until("the replay goes on", async () => (await at()) > first + 0.5);
  assert.equal(await page.locator(".scope-replay .scope-state").innerText(), "", "the scope is seen");
  const save = page.getByRole("button", { name: "Save rating" });
  const domains = await page.locator(".asset fieldset").all();
  for (const domain of domains) {
    assert.equal(await save.isEnabled(), false, "all domains are needed");
    await domain.getByRole("radio").nth(2).check();
  }
  await page.getByText(`Sum ${3 * domains.length} of 38`).waitFor();
  await page.getByLabel("Remark").fill("Steady.");
  await look(world, page, "rate-form");
  await save.click();
  await page.getByText("You: 24 of 38").waitFor();
  const { ratings } = await ask("GET", `/attempts/${session}/${number}/ratings`);
  assert.deepEqual(ratings.map(({ own, sum, autonomy, remark, competent }) => [own, sum, autonomy, remark, competent]), [[true, 24, 3, "Steady.", true]]);
}

/** The names in a zip's directory. */
const entriesOf = (zip) => [...zip.toString("latin1").matchAll(/PK\x01\x02/g)].map(({ index }) => zip.toString("utf8", index + 46, index + 46 + zip.readUInt16LE(index + 28)));

async function a_researcher_asks_for_a_course_and_takes_all_of_it_along(world) {
  const { browser, testbed, users } = world;
  const ask = await asker(world);
  await attempted(ask, world);
  const course = testbed.newName("course");
  await ask("POST", "/courses", { name: course });
  await ask("POST", `/courses/${course}/trainees`, { trainee: RATED.trainee });
  const page = await browser.page(await browser.context(users.instructor), "#/courses");
  await page.getByRole("link", { name: "Research" }).click();
  await page.getByRole("combobox", { name: "Course" }).selectOption(course);
  await page.getByLabel("Task").selectOption(TASK);
  const { attempts } = await ask("GET", `/attempts?course=${course}&task=${TASK}`);
  await until("its attempts are listed", async () => (await page.locator("tbody tr").count()) === attempts.length);
  await look(world, page, "research-found");
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("link", { name: "Download archive" }).click()]);
  const names = entriesOf(readFileSync(await download.path()));
  for (const name of ["attempts.csv", "codebook.csv"]) assert.ok(names.includes(name), `${name} is not in ${names}`);
  await page.getByLabel("Task").selectOption("palpation");
  await page.getByText("No attempts match").waitFor();
}

export const tests = [
  a_trainee_runs_a_station_alone, a_trainee_points_at_the_code_with_the_probe, a_briefing_shows_the_plan, an_exam_is_sealed,
  a_rater_fills_the_form_beside_the_replay_through_the_scope, a_director_and_a_rater_open_their_pages,
  a_researcher_asks_for_a_course_and_takes_all_of_it_along,
];
