// Every view at two widths, light and dark: what axe-core says, and pictures for people to look at.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { SIZES, settled } from "../browser.mjs";
import { lookInGuide } from "../guide.mjs";
import { BIN } from "../programs.mjs";

const PARTS = { admin: ["stations", "trainees", "accounts", "tokens", "audit"], library: ["cases", "tasks"] };

/** Name, address, and what is there once it shows what it has, of every view. */
export const viewsOf = async (testbed) => [
  ["wall", "#/wall", "article.card"],
  ["station", "#/station/room-1", "canvas.scene-canvas"],
  ["station-without-session", "#/station/sim-29", ".station-waiting .state.empty"],
  ["scope", "#/scope/room-1?optic=30", ".scope-round:not(.dark) canvas.scope-canvas"],
  ["sessions", "#/sessions", "table"],
  ["debrief", `#/session/${(await testbed.recorded()).id}`, "canvas.scene-canvas"],
  ["courses", "#/courses", "table, .state.empty"],
  ...Object.entries(PARTS).flatMap(([of, parts]) => parts.map((part) => [`${of}-${part}`, `#/${of}/${part}`, "table, .state.empty"])),
  ["nowhere", "#/nowhere", ".state"],
];

const QUICK = [["wide", "light"], ["tablet", "dark"]];
const ALL = Object.keys(SIZES).flatMap((size) => ["light", "dark"].map((colorScheme) => [size, colorScheme]));

/** Pictures of a page as it is, what axe-core says, and how it stands in the guide. */
export async function look(world, page, name, looks = QUICK) {
  const { browser } = world;
  for (const [size, colorScheme] of looks) {
    await page.setViewportSize(SIZES[size]);
    await page.emulateMedia({ colorScheme });
    await settled(page);
    await browser.picture(page, `${name}-${size}-${colorScheme}`);
    await browser.check(page, `${name}, ${size}, ${colorScheme}`);
    const wider = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
    assert.ok(wider <= 0, `${name}, ${size}: ${wider} px wider than the screen`);
  }
  await lookInGuide(world, page, name);
}

async function every_view_is_kept_as_a_picture_and_has_no_fault_that_axe_finds(world) {
  const { testbed, browser, users } = world;
  const views = await viewsOf(testbed);
  await testbed.runStation("room-1");
  const faults = [];
  const looks = world.quick ? QUICK : ALL;
  const signIn = await browser.page(await browser.context(), "#/sign-in");
  await signIn.getByRole("heading", { name: "Sign in" }).waitFor();
  await look(world, signIn, "sign-in", looks);
  await signIn.close();
  const context = await browser.context(users.instructor); // one: what it has read once it need not read again
  for (const [name, hash, there] of views) {
    const page = await browser.page(context, hash);
    await page.locator(there).first().waitFor();
    if (name === "scope") for (let turn = 0; turn < 9; turn++) await page.keyboard.press(".");
    await look(world, page, name, looks).catch((error) => faults.push(error.message));
    await page.close();
  }
  assert.deepEqual(faults, []);
}

async function all_pages_together_are_small({ report }) {
  const sizes = JSON.parse(readFileSync(join(BIN, "../web/sizes.json"), "utf8"));
  report.mark("page_kb_gz", Object.values(sizes).reduce((sum, { gzip }) => sum + gzip, 0) / 1000, "kB", 320);
}

export const tests = [all_pages_together_are_small, every_view_is_kept_as_a_picture_and_has_no_fault_that_axe_finds];
