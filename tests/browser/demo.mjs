// ./demo in a copy of the source, with the programs and cases that are there: it installs, builds and makes nothing.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { chmodSync, cpSync, existsSync, mkdirSync, mkdtempSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { BIN, until } from "./programs.mjs";

const NEEDED = ["demo", "docker/packages/fresh-build-folder", "station/mockup", "cases"];

// Each file is newer than what it is made of: programs, recipes, cases.
function copyTree(tree, source, cases) {
  for (const name of NEEDED) cpSync(join(source, name), join(tree, name), { recursive: true });
  for (const name of readdirSync(join(tree, "cases")))
    if (existsSync(join(tree, "cases", name, "recipe.ini")) && !existsSync(join(cases, name))) rmSync(join(tree, "cases", name), { recursive: true });
  for (const bin of ["build/release/bin", "run/bin"])
    for (const name of readdirSync(BIN)) if (name.startsWith("arthron-")) cpSync(join(BIN, name), join(tree, bin, name));
  cpSync(cases, join(tree, "run/cases"), { recursive: true });
}

export class Demo {
  #said = "";

  constructor(source, cases) {
    this.folder = mkdtempSync(join(tmpdir(), "arthron-demo-"));
    chmodSync(this.folder, 0o755); // its programs run as nobody
    const tree = join(this.folder, "arthron");
    copyTree(tree, source, cases);
    mkdirSync(join(this.folder, "bin"));
    for (const stub of [join(this.folder, "bin/cmake"), join(tree, "docker/packages/install")]) writeFileSync(stub, "#!/bin/sh\n", { mode: 0o755 });
    this.process = spawn("./demo", { cwd: tree, env: { ...process.env, PATH: `${this.folder}/bin:${process.env.PATH}` }, stdio: ["ignore", "ignore", "pipe"] });
    this.process.stderr.setEncoding("utf8").on("data", (text) => (this.#said += text));
  }

  /** The address that it prints. */
  async link() {
    const [, link] = await until("the demo's link", () => {
      if (this.process.exitCode !== null) throw new Error(`the demo ended:\n${this.#said}`);
      return /the console: (\S+)/.exec(this.#said);
    }, 120);
    return link;
  }

  /** It ends in order, and names what it recorded. */
  async end() {
    this.process.kill("SIGTERM");
    await until("the demo's end", () => this.process.exitCode !== null);
    assert.match(this.#said, /recorded, and under Sessions/);
    rmSync(this.folder, { recursive: true, force: true });
  }
}
