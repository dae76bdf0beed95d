// The browser, and what tests observe in it: errors on its consoles, messages on its sockets, pictures.
import { readFileSync, mkdirSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { chromium } from "playwright-core";
import { PNG } from "pngjs";
import { sleep, until } from "./programs.mjs";
import { kindsOfBatch, meshAck } from "./wire.mjs";

const require = createRequire(import.meta.url);
const AXE = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const PATIENCE_MS = 90_000; // ends what hangs: the processors draw the pictures, too
const USUAL = { width: 1200, height: 750 }; // a small picture is drawn sooner
export const SIZES = { wide: { width: 1440, height: 900 }, tablet: { width: 820, height: 1180 } };

/** Where Chromium is; "" where it is not. */
export const CHROMIUM = process.env.CHROMIUM ?? "/usr/bin/chromium";

export class Browser {
  #shared; // by all tests: {chromium, url, out, errors, violations, checked}
  #contexts = new Map(); // whose signing in lasts longer than the test: true
  #pages = new Map(); // page: what it said and heard

  faults = []; // on the pages of this test: errors on their consoles, violations of axe-core's rules

  constructor(shared) {
    this.#shared = shared;
  }

  static async open(url, out) {
    mkdirSync(out, { recursive: true });
    const process = await chromium.launch({
      executablePath: CHROMIUM,
      args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"],
    });
    return new Browser({ chromium: process, url, out, errors: [], violations: [], checked: 0 });
  }

  /** The same browser for one test: it sees and closes only the pages that it opens. */
  apart() {
    return new Browser(this.#shared);
  }

  get url() {
    return this.#shared.url;
  }

  /** On any console that no test has asked for. */
  get errors() {
    return this.#shared.errors;
  }

  /** Of axe-core's rules. */
  get violations() {
    return this.#shared.violations;
  }

  /** How often those were looked for. */
  get checked() {
    return this.#shared.checked;
  }

  async close() {
    await this.#shared.chromium.close();
  }

  /** A browser of its own, signed in as whoever made `state`. */
  async context(state, options = {}) {
    const context = await this.#shared.chromium.newContext({ ignoreHTTPSErrors: true, viewport: USUAL, storageState: state, reducedMotion: "reduce", ...options });
    context.setDefaultTimeout(PATIENCE_MS);
    this.#contexts.set(context, state !== undefined);
    return context;
  }

  /** Signs out whoever the test has signed in, and gives the names of the trainees among them. */
  async signOut() {
    const trainees = [];
    const headers = { Origin: this.url };
    for (const [context, lasts] of this.#contexts) {
      const answer = lasts ? undefined : await context.request.get(`${this.url}/api/v1/me`).catch(() => undefined);
      if (!answer?.ok()) continue;
      const { account } = await answer.json();
      if (account.trainee) trainees.push(account.trainee);
      await context.request.post(`${this.url}/api/v1/sign-out`, { headers }).catch(() => {});
    }
    return trainees;
  }

  /** What a test has left open. */
  async closeAll() {
    for (const context of this.#contexts.keys()) await context.close();
    this.#contexts.clear();
    this.#pages.clear();
  }

  /** Pictures of all pages, to find out why a test failed. */
  async keepAll() {
    let count = 0;
    for (const page of this.#pages.keys()) if (!page.isClosed()) await this.picture(page, `failed-${++count}`).catch(() => {});
  }

  /** `address`: whole, or of the server's pages. `may`: what the page may complain of; `script`: what runs in it before all else. */
  async page(context, address, may = [], script = undefined) {
    const page = await context.newPage();
    if (script) await page.addInitScript(script);
    const heard = { may, kinds: {}, messages: 0, bytes: 0, acks: {}, views: [] };
    this.#pages.set(page, heard);
    page.on("console", (message) => message.type() === "error" && this.#complained(heard, `${message.text()} (${message.location().url})`));
    page.on("pageerror", (error) => this.#complained(heard, error.stack ?? String(error)));
    page.on("websocket", (socket) => this.#listen(socket, heard));
    await page.goto(new URL(address, `${this.url}/`).href);
    return page;
  }

  heard(page) {
    return this.#pages.get(page);
  }

  #complained(heard, words) {
    if (!heard.may.some((pattern) => pattern.test(words))) this.#note(this.errors, words);
  }

  #note(kind, words) {
    kind.push(words);
    this.faults.push(words);
  }

  #listen(socket, heard) {
    const live = socket.url().endsWith("/live");
    socket.on("framereceived", ({ payload }) => {
      if (!Buffer.isBuffer(payload)) return;
      if (!live) {
        heard.views.push(payload);
        return;
      }
      heard.messages++;
      heard.bytes += payload.length;
      for (const kind of kindsOfBatch(payload)) heard.kinds[kind] = (heard.kinds[kind] ?? 0) + 1;
    });
    socket.on("framesent", ({ payload }) => {
      const ack = live && Buffer.isBuffer(payload) && meshAck(payload);
      if (ack) heard.acks[ack.group] = ack;
    });
  }

  /** Notes what axe-core has against the page as it is. */
  async check(page, name) {
    this.#shared.checked++;
    await page.evaluate(AXE);
    const { violations } = await page.evaluate(() => window.axe.run(document, { runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "best-practice"] }));
    for (const { id, help, nodes } of violations)
      this.#note(this.violations, `${name}: ${id}: ${help}: ${nodes.slice(0, 3).map((node) => `${node.target.join(" ")}${node.any[0] ? ` (${node.any[0].message})` : ""}`).join("; ")}`);
  }

  picturePath(name) {
    return join(this.#shared.out, `${name}.png`);
  }

  async picture(page, name) {
    await page.screenshot({ path: this.picturePath(name) });
  }
}

// Its fonts are there, it has another size or other colours, and two pictures were drawn since.
export async function settled(page) {
  await page.evaluate(async () => {
    await document.fonts.ready;
    for (let i = 0; i < 3; i++) await new Promise(requestAnimationFrame);
  });
}

/** A recorded session is replayed to its end. That takes as long as the machine lets the server; it may not stand still. */
export async function replayed(page) {
  const shown = () => page.locator(".transport-progress").first().evaluate((bar) => bar.value).catch(() => 0);
  for (let before = -1, now = await shown(); ; before = now, now = await shown()) {
    const patience = now > before ? PATIENCE_MS : 1;
    if (await page.getByText("Recording verified").waitFor({ timeout: patience }).then(() => true, () => false)) return;
    if (now <= before) throw new Error(`the replay stands still at ${now}`);
  }
}

/** An element's pixels: {width, height, data} with 4 bytes each. */
export async function pixels(locator) {
  return PNG.sync.read(await locator.screenshot());
}

export const ALIKE = 0.0005; // share of the pixels of a picture that stands

/** An element's pixels once it stands: it glides to another side, and gets finer when nothing moves. */
export async function still(locator) {
  let last = await pixels(locator);
  return until("the picture stands", async () => {
    await locator.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(resolve)))));
    await sleep(500);
    const now = await pixels(locator);
    const stands = difference(last, now) < ALIKE;
    last = now;
    return stands && now;
  });
}

/** The share of pixels that differ by more than a little. */
export function difference(one, other) {
  let count = 0;
  for (let i = 0; i < one.data.length; i += 4)
    if (Math.abs(one.data[i] - other.data[i]) + Math.abs(one.data[i + 1] - other.data[i + 1]) + Math.abs(one.data[i + 2] - other.data[i + 2]) > 24) count++;
  return count / (one.width * one.height);
}
