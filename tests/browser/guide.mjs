// The pictures of the instructor's guide (docs/TEACHING.md). They are kept in docs/pages, with the words that each page
// had. A page that has lost one of these words has made its picture out of date.
import assert from "node:assert/strict";
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { join, resolve } from "node:path";
import { PNG } from "pngjs";
import { settled } from "./browser.mjs";

const FOLDER = resolve(fileURLToPath(import.meta.url), "../../../docs/pages");
const WORDS = join(FOLDER, "words.json");
const VIEWS = ["course-plan", "train-today", "attention", "station", "debrief", "course-progress"];
const SIZE = { width: 1200, height: 750 };

// What headings, buttons and the like say; a word with a digit may be other the next time.
const wordsOf = (page) => page.evaluate(() => {
  const said = [...document.querySelectorAll("h1, h2, h3, th, nav a, button, [role=tab], label, legend, summary")]
    .filter((element) => element.checkVisibility())
    .flatMap((element) => element.innerText.split("\n"))
    .map((line) => line.trim()).filter((line) => line && !/\d/.test(line));
  return [...new Set(said)].sort();
});

const kept = () => (existsSync(WORDS) ? JSON.parse(readFileSync(WORDS, "utf8")) : {});

async function keep(page, name, words) {
  mkdirSync(FOLDER, { recursive: true });
  await page.screenshot({ path: join(FOLDER, `${name}.png`) });
  writeFileSync(WORDS, `${JSON.stringify({ ...kept(), [name]: words }, null, 1)}\n`);
}

function compare(name, words) {
  const lost = (kept()[name] ?? ["a picture"]).filter((word) => !words.includes(word));
  assert.deepEqual(lost, [], `docs/pages/${name}.png is out of date: draw it with tests/browser/run --quick --keep-pictures`);
  const { width, height } = PNG.sync.read(readFileSync(join(FOLDER, `${name}.png`)));
  assert.deepEqual({ width, height }, SIZE, `docs/pages/${name}.png`);
}

/** Holds a view against its picture in the guide, if it has one there, or draws that anew. */
export async function lookInGuide({ keepPictures }, page, name) {
  if (!VIEWS.includes(name)) return;
  await page.setViewportSize(SIZE);
  await page.emulateMedia({ colorScheme: "light" });
  await settled(page);
  const words = await wordsOf(page);
  if (keepPictures) await keep(page, name, words);
  else compare(name, words);
}
