// The real programs: called to their end, or running with their output in files.
import { execFile, spawn } from "node:child_process";
import { openSync, readFileSync, closeSync } from "node:fs";
import { createServer } from "node:net";
import { join, resolve } from "node:path";
import { setTimeout as sleep } from "node:timers/promises";
import { promisify } from "node:util";

const PATIENCE_S = 40;
const CLOCK_TICKS_S = 100; // of /proc/PID/stat

export const BIN = process.env.ARTHRON_BIN;
const run = promisify(execFile);

export { sleep };

export async function call(name, ...args) {
  const { stdout } = await run(join(BIN, name), args, { maxBuffer: 1 << 28, timeout: 120_000 });
  return stdout;
}

export async function callJson(name, ...args) {
  return JSON.parse(await call(name, ...args, "--json"));
}

/** What `condition` gives as soon as that is something. It is asked more and more seldom: a program that asks the server
 * takes 40 ms of a processor to start. */
export async function until(what, condition, seconds = PATIENCE_S) {
  const begun = performance.now();
  for (;;) {
    const value = await condition();
    if (value) return value;
    const waited = performance.now() - begun;
    if (waited > seconds * 1000) throw new Error(`waited ${seconds} s in vain: ${what}`);
    await sleep(Math.min(250, Math.max(50, waited / 5)));
  }
}

export function freePort(address = "127.0.0.1") {
  return new Promise((resolve, reject) => {
    const server = createServer().once("error", reject).listen(0, address, () => {
      const { port } = server.address();
      server.close(() => resolve(port));
    });
  });
}

export class Program {
  constructor(folder, label, name, args) {
    this.outPath = join(folder, `${label}.out`);
    this.logPath = join(folder, `${label}.log`);
    const [out, log] = [openSync(this.outPath, "w"), openSync(this.logPath, "w")];
    this.process = spawn(resolve(BIN, name), args, { stdio: ["ignore", out, log] });
    this.ended = new Promise((resolve) => this.process.once("exit", (code) => resolve(code)));
    closeSync(out);
    closeSync(log);
  }

  get out() {
    return readFileSync(this.outPath, "utf8");
  }

  get log() {
    return readFileSync(this.logPath, "utf8");
  }

  /** What `pattern` finds in the log, once it does. */
  async said(pattern) {
    return until(`${this.logPath}: ${pattern}`, () => {
      const found = pattern.exec(this.log);
      if (!found && this.process.exitCode !== null) throw new Error(`ended with ${this.process.exitCode}:\n${this.log}`);
      return found;
    });
  }

  /** Seconds of processor that it has used so far. */
  get cpuS() {
    const [user, system] = readFileSync(`/proc/${this.process.pid}/stat`, "utf8").split(") ").pop().split(" ").slice(11, 13);
    return (Number(user) + Number(system)) / CLOCK_TICKS_S;
  }

  async end(signal = "SIGTERM") {
    if (this.process.exitCode === null && this.process.signalCode === null) this.process.kill(signal);
    const late = setTimeout(() => this.process.kill("SIGKILL"), 10_000);
    await this.ended;
    clearTimeout(late);
  }
}
