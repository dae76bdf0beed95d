// The live connection against a socket, a clock and a screen that the test moves.
import assert from "node:assert/strict";
import { test } from "node:test";
import { create, fromBinary, toBinary, type MessageInitShape } from "@bufbuild/protobuf";
import { Command_Kind, LiveBatchSchema, PageSchema, Watch_What, type Page } from "wire";
import { Feed, NoAnswer, type Environment } from "../src/live";

type Items = NonNullable<MessageInitShape<typeof LiveBatchSchema>["items"]>;

class FakeSocket {
  binaryType = "";
  closed = false;
  onopen: () => void = () => {};
  onmessage: (event: { data: unknown }) => void = () => {};
  onclose: () => void = () => {};
  readonly remarkChanges: Page["message"][] = [];

  send(bytes: Uint8Array): void {
    this.remarkChanges.push(fromBinary(PageSchema, bytes).message);
  }
  close(): void {
    this.closed = true;
  }
  batch(items: Items): void {
    this.onmessage({ data: Uint8Array.from(toBinary(LiveBatchSchema, create(LiveBatchSchema, { items }))).buffer });
  }
  drawn(): number[] {
    return this.remarkChanges.flatMap((message) => (message.case === "drawn" ? [Number(message.value.batches)] : []));
  }
  watches(): string[] {
    return this.remarkChanges.flatMap((message) => (message.case === "watch" ? [message.value.station] : []));
  }
}

class FakeEnvironment implements Environment {
  at = 1000;
  may = true;
  readonly sockets: FakeSocket[] = [];
  private frames: (() => void)[] = [];
  private timers: { at: number; then: () => void }[] = [];

  open(): WebSocket {
    const socket = new FakeSocket();
    this.sockets.push(socket);
    return socket as unknown as WebSocket;
  }
  now(): number {
    return this.at;
  }
  afterDraw(then: () => void): void {
    this.frames.push(then);
  }
  later(ms: number, then: () => void): () => void {
    const timer = { at: this.at + ms, then };
    this.timers.push(timer);
    return () => (this.timers = this.timers.filter((one) => one !== timer));
  }
  mayRetry(): Promise<boolean> {
    return Promise.resolve(this.may);
  }
  random(): number {
    return 0.5;
  }
  draw(): void {
    for (const then of this.frames.splice(0)) then();
  }
  async pass(ms: number): Promise<void> {
    this.at += ms;
    const due = this.timers.filter((timer) => timer.at <= this.at);
    this.timers = this.timers.filter((timer) => timer.at > this.at);
    for (const timer of due) timer.then();
    await new Promise((resolve) => setImmediate(resolve));
  }
  get socket(): FakeSocket {
    return this.sockets.at(-1)!;
  }
}

function opened(): { environment: FakeEnvironment; feed: Feed } {
  const environment = new FakeEnvironment();
  const feed = new Feed(environment);
  feed.watch({ what: Watch_What.STATION, station: "bay-1" });
  environment.socket.onopen();
  return { environment, feed };
}

const place = (stationNumber: number, gone = false): Items[number] => ({ message: { case: "place", value: { stationNumber, gone, info: { station: `bay-${stationNumber}` } } } });
const reply = (text: string): Items[number] => ({ message: { case: "commandReply", value: { ok: true, text } } });
const start = { kind: Command_Kind.START, station: "bay-1" };

test("what is watched is said once the connection is open", () => {
  const { environment, feed } = opened();
  assert.deepEqual(environment.socket.watches(), ["bay-1"]);
  feed.watch({ what: Watch_What.STATION, station: "bay-2" });
  assert.deepEqual(environment.socket.watches(), ["bay-1", "bay-2"]);
  assert.equal(environment.sockets.length, 1);
});

test("batches are drawn only after the screen was, and the newest stands for all", () => {
  const { environment } = opened();
  environment.socket.batch([place(1)]);
  environment.socket.batch([place(2)]);
  assert.deepEqual(environment.socket.drawn(), []);
  environment.draw();
  assert.deepEqual(environment.socket.drawn(), [2]);
  environment.draw();
  assert.deepEqual(environment.socket.drawn(), [2]);
  environment.socket.batch([]);
  environment.draw();
  assert.deepEqual(environment.socket.drawn(), [2, 3]);
});

test("a batch that was not drawn before the connection broke does not count on the next one", async () => {
  const { environment } = opened();
  environment.socket.batch([place(1)]);
  environment.socket.onclose();
  await environment.pass(500);
  environment.socket.onopen();
  environment.draw();
  assert.deepEqual(environment.socket.drawn(), []);
  environment.socket.batch([place(1)]);
  environment.draw();
  assert.deepEqual(environment.socket.drawn(), [1]);
});

test("stations keep their newest place, and go when the server says so", () => {
  const { environment, feed } = opened();
  environment.socket.batch([place(1), place(2), { message: { case: "moment", value: { stationNumber: 2, step: 7n } } }]);
  assert.equal(feed.stations.get(2)?.moment?.step, 7n);
  environment.at += 4000;
  environment.socket.batch([place(1), place(2, true)]);
  assert.deepEqual([...feed.stations.keys()], [1]);
  environment.at += 3500;
  assert.equal(feed.quietMs(), 3500);
});

test("what is shown is old from when nothing comes until something does", async () => {
  const { environment, feed } = opened();
  environment.socket.batch([place(1)]);
  environment.at += 2999;
  assert.equal(feed.lostMs(), undefined);
  environment.at += 1;
  assert.equal(feed.lostMs(), 3000);
  environment.socket.batch([]);
  assert.equal(feed.lostMs(), undefined);
  environment.at += 100;
  environment.socket.onclose();
  assert.equal(feed.lostMs(), 100);
  await environment.pass(900);
  assert.equal(feed.link.state, "connecting");
  assert.equal(feed.lostMs(), 1000);
  environment.socket.onopen();
  assert.equal(feed.lostMs(), 1000); // it is still that of before
  environment.socket.batch([place(1)]);
  assert.equal(feed.lostMs(), undefined);
  feed.unwatch();
  assert.equal(feed.lostMs(), undefined);
});

test("a connection on which nothing comes is made anew, unless it waits for the page", async () => {
  const { environment } = opened();
  for (let i = 0; i < 4; i++) await environment.pass(5000); // 20 s, and the retry
  await environment.pass(1000);
  assert.equal(environment.sockets.length, 2);
  environment.socket.onopen();
  environment.socket.batch([place(1)]); // not drawn: a page that nobody sees
  for (let i = 0; i < 6; i++) await environment.pass(5000);
  assert.equal(environment.sockets.length, 2);
  environment.draw();
  for (let i = 0; i < 4; i++) await environment.pass(5000);
  assert.equal(environment.sockets.length, 3);
});

test("listeners get the messages of their kind in order, until they end", () => {
  const { environment, feed } = opened();
  const seen: number[] = [];
  const end = feed.on("place", (one) => seen.push(one.stationNumber));
  environment.socket.batch([place(3), reply("x"), place(1)]);
  end();
  environment.socket.batch([place(2)]);
  assert.deepEqual(seen, [3, 1]);
});

test("replies answer commands in order, a late one too", async () => {
  const { environment, feed } = opened();
  const first = feed.command(start);
  const second = feed.command({ ...start, kind: Command_Kind.STOP });
  const late = Promise.all([first, second].map((one) => assert.rejects(one, (error: NoAnswer) => error.sent)));
  for (let s = 0; s < 11; s++) {
    environment.socket.batch([]); // it is there
    environment.draw();
    await environment.pass(1000);
  }
  await late;
  const third = feed.command(start);
  environment.socket.batch([reply("first"), reply("second"), reply("third")]);
  assert.equal((await third).text, "third");
});

test("a command without a connection was not sent; one whose connection broke may have been", async () => {
  const { environment, feed } = opened();
  const sent = feed.command(start);
  environment.socket.onclose();
  await assert.rejects(sent, (error: NoAnswer) => error.sent);
  await assert.rejects(feed.command(start), (error: NoAnswer) => !error.sent);
});

test("a broken connection is tried again, later each time, and asks for the same", async () => {
  const { environment, feed } = opened();
  environment.socket.batch([place(1)]);
  const waits: number[] = [];
  for (let i = 0; i < 7; i++) {
    environment.socket.onclose();
    assert.equal(feed.link.state, "broken");
    const wait = feed.link.state === "broken" ? feed.link.retryAt - environment.at : 0;
    waits.push(wait);
    await environment.pass(wait - 1);
    assert.equal(feed.link.state, "broken");
    await environment.pass(1);
    assert.equal(feed.link.state, "connecting");
  }
  assert.deepEqual(waits, [500, 1000, 2000, 4000, 8000, 8000, 8000]);
  assert.equal(feed.stations.size, 1); // what was last known
  environment.socket.onopen();
  assert.deepEqual(environment.socket.watches(), ["bay-1"]);
  environment.socket.batch([]);
  environment.socket.onclose();
  assert.equal(feed.link.state === "broken" && feed.link.retryAt - environment.at, 500);
});

test("stations that a server does not know any more go after a reconnect", async () => {
  const { environment, feed } = opened();
  environment.socket.batch([place(1), place(2)]);
  environment.socket.onclose();
  await environment.pass(500);
  environment.socket.onopen();
  assert.equal(feed.stations.size, 2);
  environment.socket.batch([place(1)]);
  await environment.pass(3000);
  assert.deepEqual([...feed.stations.keys()], [1]);
});

test("who is signed out does not try again", async () => {
  const { environment, feed } = opened();
  environment.may = false;
  environment.socket.onclose();
  await environment.pass(500);
  assert.equal(feed.link.state, "idle");
  assert.equal(environment.sockets.length, 1);
});

test("what cannot be read closes the connection, and says nothing to anybody", () => {
  for (const data of ["text", Uint8Array.from([0x0a, 0xff]).buffer]) {
    const { environment, feed } = opened();
    const socket = environment.socket;
    feed.on("place", () => assert.fail());
    socket.onmessage({ data });
    assert.ok(socket.closed);
    assert.equal(feed.link.state, "broken");
  }
});

test("nothing is heard of a connection that was left", () => {
  const { environment, feed } = opened();
  const socket = environment.socket;
  feed.unwatch();
  feed.on("place", () => assert.fail());
  socket.batch([place(1)]);
  socket.onclose();
  assert.equal(feed.link.state, "idle");
  assert.equal(feed.quietMs(), 0);
});

test("a view that is opened after a pause does not count the pause as silence", async () => {
  const { environment, feed } = opened();
  environment.socket.batch([place(1)]);
  feed.unwatch();
  await environment.pass(600_000);
  feed.watch({ what: Watch_What.WALL });
  assert.deepEqual([feed.quietMs(), feed.lostMs()], [0, undefined]);
  environment.socket.onclose();
  assert.equal(feed.lostMs(), 0);
});
