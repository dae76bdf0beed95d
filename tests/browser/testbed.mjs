// A server with its records and pages, stations and mock-ups, on free ports, in a folder of its own.
import { appendFileSync, cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { call, callJson, freePort, Program, sleep, until } from "./programs.mjs";
import { BITES, motion, palpation, rest, scopeAt, stand, stroke, write } from "./motion.mjs";

export const STATION_COUNT = 32;
export const SIMULATED_HZ = 25; // frames of a simulated station
const CASES = ["tear-radial", "arthrosis", "healthy"];
const CLIENT = { id: "arthron of st. mary's", secret: "p@ss:word/+%" }; // of tests/system/provider.py
const FAR = "127.0.0.2"; // where a station calls the server through the relay
const ROUND_TRIP_MS = 50; // through it
const LEAST_S = 4; // of a session that is recorded

/** A task that the hands of room-1 fail by an error. */
const HASTY = `[task]
title = Hasty hands
briefing = Take your time.
[pass]
time_s = 60
source = a test
[goal notch]
see = notch
hold_s = 60
[error haste]
tool = punch
near_mm = 30
speed_mm_s = 5
for_s = 0.05
`;

/** What the config says of each station; the others are simulated. */
export const STATIONS = {
  "room-1": { case: "tear-radial", trainee: "anna", motion: "bites" },
  "room-2": { case: "arthrosis", trainee: "bert", motion: "stand", optic: { tiltDeg: 70, fieldDeg: 80 }, force: 2.5 }, // N, of the probe
  "room-3": { case: "arthrosis", trainee: "carla", motion: "stroke", far: true },
};

const opticOf = ({ optic }) => (optic ? `optic_deg = ${optic.tiltDeg}\noptic_view_deg = ${optic.fieldDeg}\n` : "");

export class Testbed {
  programs = new Set();
  equipped = Object.keys(STATIONS);
  simulated = Array.from({ length: STATION_COUNT - this.equipped.length }, (_, i) => `sim-${String(i + 1).padStart(2, "0")}`);
  views = {}; // port of the view of each equipped station
  mockups = {};
  stations = {};
  #named = 0; // by newName

  static async open(source) {
    const testbed = new Testbed();
    testbed.source = source;
    testbed.folder = mkdtempSync(join(tmpdir(), "arthron-browser-"));
    await Promise.all([testbed.#makeCases(), testbed.#makeKeys()]);
    await testbed.#makeMotions();
    testbed.#startProvider();
    await testbed.startServer();
    testbed.enrolled = testbed.enrolAll();
    testbed.enrolled.catch(() => {}); // who waits for it gets the error
    return testbed;
  }

  async close() {
    for (const program of this.programs) await program.end("SIGTERM");
    rmSync(this.folder, { recursive: true, force: true });
  }

  path(...parts) {
    return join(this.folder, ...parts);
  }

  /** A name that no test had before, nor an attempt at this one. */
  newName(stem) {
    return `${stem}-${++this.#named}`;
  }

  get url() {
    return `https://127.0.0.1:${this.webPort}`;
  }

  // ---- what is there before -----------------------------------------------------------------------

  async #makeCases() {
    cpSync(join(this.source, "cases/tasks"), this.path("cases/tasks"), { recursive: true });
    writeFileSync(this.path("cases/tasks/hasty.ini"), HASTY);
    await Promise.all(CASES.map((name) => call("arthron-case", "generate", join(this.source, "cases", name), "--out", this.path("cases", name))));
  }

  async #makeKeys() {
    await call("arthron-server", "keys", "init", this.path("keys"), "localhost", "127.0.0.1", FAR);
    [this.port, this.udpPort, this.webPort, this.providerPort] = await Promise.all([freePort(), freePort(FAR), freePort(), freePort()]);
  }

  async #makeMotions() {
    const info = await callJson("arthron-case", "info", this.path("cases/arthrosis"));
    const portal = info.portals.find(({ name }) => name === "anterolateral").position;
    const scope = scopeAt([4, 12, -15], portal);
    const palpated = await motion(this.folder, "palpation", palpation(this.source, 25), this.path("cases/arthrosis"));
    write(this.path("stroke.csv"), stroke(palpated), scopeAt([0, 25, -10], portal), 200); // near the femur
    write(this.path("stand.csv"), stand(palpated), scope, 200, STATIONS["room-2"].force);
    const bites = await motion(this.folder, "resection", BITES, this.path("cases/tear-radial"));
    write(this.path("bites.csv"), bites, scope, 100);
    write(this.path("rest.csv"), rest(bites), scope, 100);
  }

  // ---- the server ---------------------------------------------------------------------------------

  #serverConfig() {
    const cases = CASES.map((name) => `[case ${name}]\ndir = cases/${name}\n`);
    const equipped = Object.entries(STATIONS).map(([name, station]) => `[station ${name}]\ncase = ${station.case}\ntrainee = ${station.trainee}\n${opticOf(station)}`);
    const simulated = this.simulated.map((name, i) => `[station ${name}]\ncase = ${CASES[i % CASES.length]}\n`);
    writeFileSync(this.path("server.ini"), `[server]
address = 127.0.0.1
port = ${this.port}
udp_port = ${this.udpPort}
workers = 1
keys = keys
traces = traces
socket = s
records = records.db
[web]
port = ${this.webPort}
[sign_on]
issuer = https://127.0.0.1:${this.providerPort}/realms/ward
client_id = ${CLIENT.id}
client_secret = client-secret
name = Sign in with the hospital
claim = preferred_username
authority = keys/authority.pem
${cases.join("")}${equipped.join("")}${simulated.join("")}`);
  }

  // Whoever comes to it is grace (tests/system/provider.py). It has the server's certificate.
  #startProvider() {
    writeFileSync(this.path("client-secret"), `${CLIENT.secret}\n`);
    this.#start("provider", "/usr/bin/python3", "-B", join(this.source, "tests/system/provider.py"), this.path("keys"), String(this.providerPort));
  }

  async startServer() {
    this.#serverConfig();
    mkdirSync(this.path("traces"), { recursive: true });
    this.server = this.#start("server", "arthron-server", "run", "--config", this.path("server.ini"));
    await this.server.said(/ready/);
  }

  async killServer() {
    await this.server.end("SIGKILL");
  }

  async endServer() {
    await this.server.end("SIGTERM");
  }

  /** The address at which the first instructor makes an account. */
  async firstLink() {
    const [, secret] = await this.server.said(/#\/first\/(\S+)/);
    return `#/first/${secret}`;
  }

  #start(label, name, ...args) {
    const program = new Program(this.folder, label, name, args);
    this.programs.add(program);
    void program.ended.then(() => this.programs.delete(program));
    return program;
  }

  // ---- questions to the server, not by way of the pages ----------------------------------------------

  session(...words) {
    return callJson("arthron-server", "session", "--socket", this.path("s"), ...words);
  }

  async station(name) {
    return (await this.session("list")).sessions.find(({ station }) => station === name);
  }

  async resection(name, group = "meniscus_medial") {
    return (await this.session("show", name)).resections.find((of) => of.group === group);
  }

  /** The steps that the trace has of a station's session, as rows by the names of the columns. */
  async steps(name) {
    const { trace } = await this.station(name);
    const text = await call("arthron-trace", "export", trace, "--csv", "-").catch(({ stdout }) => stdout); // it is open
    const [header, ...rows] = text.trimEnd().split("\n");
    const names = header.split(",");
    return rows.map((row) => Object.fromEntries(row.split(",").map((value, i) => [names[i], value])));
  }

  // ---- stations -----------------------------------------------------------------------------------

  async enrol(name) {
    if (existsSync(this.path(`keys-${name}`, "station.pem"))) return;
    await until(`${name} is enrolled`, async () => {
      const code = (await call("arthron-server", "keys", "enrol", this.path("keys"), name)).trim();
      return call("arthron-station", "enrol", `127.0.0.1:${this.port}`, code, "--name", name, "--keys", this.path(`keys-${name}`)).then(() => true, () => sleep(500));
    }, 60);
  }

  async enrolAll() {
    for (const name of this.simulated) await this.enrol(name);
  }

  /** `faults`: [what, at_s, for_s] of the tracker, in s after the mock-up's start. `motion`: another than the station's. */
  async startMockup(name, { faults = [], motion = STATIONS[name].motion } = {}) {
    const before = this.mockups[name];
    const args = ["--motion", this.path(`${motion}.csv`), "--modbus-tcp", `127.0.0.1:${before?.modbus ?? 0}`, "--tracker", `127.0.0.1:${before?.tracker ?? 0}`];
    if (faults.length) {
      const text = faults.map(([what, at, length], i) => `[fault ${i}]\nwho = tracker\nwhat = ${what}\nat_s = ${at}\nfor_s = ${length}\n`);
      writeFileSync(this.path(`${name}-faults.ini`), text.join(""));
      args.push("--faults", this.path(`${name}-faults.ini`));
    }
    const program = this.#start(`mockup-${name}`, "arthron-mockup", ...args);
    await until("the mock-up's ports", () => program.out.split("\n").length > 2);
    const ports = Object.fromEntries(program.out.trimEnd().split("\n").map((line) => line.split(" ")));
    this.mockups[name] = { program, modbus: ports["modbus-tcp"].split(":")[1], tracker: ports.tracker.split(":")[1] };
    return program;
  }

  /** The mock-up's hands go on with another motion, on the same ports. */
  async moveHands(name, motion) {
    await this.mockups[name].program.end();
    await this.startMockup(name, { motion });
  }

  async #stationConfig(name) {
    const { modbus, tracker } = this.mockups[name];
    this.views[name] ??= await freePort();
    return `[station]
name = ${name}
server = ${STATIONS[name].far ? FAR : "127.0.0.1"}:${this.port}
keys = keys-${name}
[view]
port = ${this.views[name]}
origins = ${this.url}
[device encoders]
driver = modbus
address = 127.0.0.1:${modbus}
rate_hz = 200
sequence = 0
flexion = 1 0.01 0
varus = 2 0.01 0
internal = 3 0.01 0
shift = 4 0.01 0
drawer = 5 0.01 0
distraction = 6 0.01 0
punch.opening = 7 0.0001 0
${STATIONS[name].force ? "probe.force = 38 0.01" : ""}
[device tracker]
driver = tracker
address = 127.0.0.1:${tracker}
tool.probe = probe
tool.punch = punch
tool.scope = scope
`;
  }

  /** Its mock-up too, where none runs. The station that runs already, where one does. */
  async startStation(name) {
    if (this.stations[name]) return this.stations[name];
    if (!this.mockups[name]) await this.startMockup(name);
    await this.enrol(name);
    if (STATIONS[name].far && !this.relay) await this.#startRelay();
    writeFileSync(this.path(`${name}.ini`), await this.#stationConfig(name));
    const station = this.#startProgramOf(name);
    await station.said(/\/view\?token=/);
    return station;
  }

  #startProgramOf(name) {
    const station = this.#start(name, "arthron-station", "run", "--config", this.path(`${name}.ini`));
    this.stations[name] = station;
    void station.ended.then(() => delete this.stations[name]);
    return station;
  }

  /** The station, with its session running. */
  async runStation(name) {
    await this.startStation(name);
    await this.#runs(name);
  }

  async #runs(name) {
    await until(`a session of ${name}`, async () => (await this.station(name)).connected);
    await this.session("start", name).catch(() => {}); // it runs already
    await until(`${name} runs`, async () => (await this.station(name)).state === "running");
  }

  /** A simulated station that no other test uses, connected; `work` with it, and then its end. */
  async withConnected(name, work) {
    await this.enrolled;
    this.startSimulated(name, 1);
    try {
      await until(`${name} is there`, async () => (await this.station(name)).connected);
      await work();
    } finally {
      await this.stations[name]?.end();
    }
  }

  /** A simulated station that no other test uses, with a session of `trainee` running; `work` with it, and then its end. */
  async withOwnStation(name, trainee, work) {
    await this.withConnected(name, async () => {
      await this.session("assign", name, trainee);
      await this.session("stop", name, "--reason", "Another test begins.").catch(() => {}); // one that began before
      await this.#runs(name);
      try {
        await work();
      } finally {
        await this.session("stop", name, "--reason", "A test is over.").catch(() => {}); // it ended
      }
    });
  }

  /** A session of a station that begins now: its id. The one before may have lasted through many tests. */
  async runAnew(name) {
    await this.startStation(name);
    await until(`a session of ${name}`, async () => (await this.station(name)).connected);
    await this.session("stop", name).catch(() => {}); // it is closed
    const { id: before } = await this.station(name);
    await this.session("start", name);
    const { id } = await until(`${name} runs anew`, async () => {
      const now = await this.station(name);
      return now.id !== before && now.state === "running" && now;
    });
    return id;
  }

  /** A session of a station from its beginning until `enough` is done, and some seconds at least: {id, resection}. */
  async record(name, enough = () => {}) {
    const id = await this.runAnew(name);
    await sleep(LEAST_S * 1000);
    await enough();
    await this.session("pause", name);
    await this.session("stop", name); // what is on its way lands before
    return { id, resection: await this.resection(name) };
  }

  /** A session of room-1 in which some tissue was cut and that has ended. */
  async recorded() {
    this.past ??= this.record("room-1", () => until("cuts", async () => (await this.resection("room-1")).cuts >= 3));
    return this.past.catch((error) => {
      delete this.past;
      throw error;
    });
  }

  async endStation(name) {
    await this.stations[name]?.end();
    await this.mockups[name].program.end();
    delete this.mockups[name];
  }

  /** Stations that a trainee took are free again, and those of the config are whose they were. */
  async giveBack(trainee) {
    for (const { station, state, trainee: who, next_trainee: next } of (await this.session("list")).sessions) {
      const own = STATIONS[station]?.trainee ?? "";
      if (trainee === own) continue;
      if (who === trainee && state !== "closed") await this.session("stop", station, "--reason", "A test failed.");
      if (who === trainee || next === trainee) await this.session("assign", station, own);
    }
  }

  /** What a scope on the station's PC is told in its address. */
  viewOf(name) {
    return { port: this.views[name], token: readFileSync(this.path(`keys-${name}`, "view.token"), "utf8").trim() };
  }

  async #startRelay() {
    const way = { from: FAR, to: "127.0.0.1", tcp: this.port, udp: this.udpPort, delayMs: ROUND_TRIP_MS / 2 };
    this.relay = this.#start("relay", process.execPath, new URL("relay.mjs", import.meta.url).pathname, JSON.stringify(way));
    await until("the relay is open", () => this.relay.out);
  }

  /** A station without hardware. */
  startSimulated(name, seed) {
    writeFileSync(this.path(`${name}.ini`), `[station]
name = ${name}
server = 127.0.0.1:${this.port}
keys = keys-${name}
rate_hz = ${SIMULATED_HZ}
[device all]
driver = simulated
seed = ${seed}
rate_hz = ${SIMULATED_HZ}
`);
    this.#startProgramOf(name);
  }

  /** All 32 stations, with their sessions running. */
  async runAll() {
    await this.enrolled;
    for (const name of this.equipped) await this.runStation(name);
    this.simulated.forEach((name, i) => this.stations[name] || this.startSimulated(name, i + 1));
    await until("all stations run", async () => (await this.session("list")).sessions.every(({ connected, state }) => connected && state === "running"), 60);
  }

  /** The logs of all programs, to find out why a test failed. */
  keepLogs(path) {
    writeFileSync(path, "");
    for (const name of ["server", ...this.equipped]) {
      const log = this.path(`${name}.log`);
      if (existsSync(log)) appendFileSync(path, `==== ${name}\n${readFileSync(log, "utf8")}`);
    }
  }
}
