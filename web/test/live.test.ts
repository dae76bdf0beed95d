// The live connection against a socket, a clock and a screen that the test moves.
import assert from "node:assert/strict";
import { test } from "node:test";
import { create, fromBinary, toBinary, type MessageInitShape } from "@bufbuild/protobuf";
import { Command_Kind, LiveBatchSchema, PageSchema, Watch_What, type Page } from "wire";
import { Feed, NoAnswer, type World } from "../src/live";

type Items = NonNullable<MessageInitShape<typeof LiveBatchSchema>["items"]>;

class FakeSocket {
  binaryType = "";
  closed = false;
  onopen: () => void = () => {};
  onmessage: (event: { data: unknown }) => void = () => {};
  onclose: () => void = () => {};
  readonly said: Page["message"][] = [];

  send(bytes: Uint8Array): void {
    this.said.push(fromBinary(PageSchema, bytes).message);
  }
  close(): void {
    this.closed = true;
  }
  batch(items: Items): void {
    this.onmessage({ data: Uint8Array.from(toBinary(LiveBatchSchema, create(LiveBatchSchema, { items }))).buffer });
  }
  drawn(): number[] {
    return this.said.flatMap((message) => (message.case === "drawn" ? [Number(message.value.batches)] : []));
  }
  watches(): string[] {
    return this.said.flatMap((message) => (message.case === "watch" ? [message.value.station] : []));
  }
}

class FakeWorld implements World {
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

function opened(): { world: FakeWorld; feed: Feed } {
  const world = new FakeWorld();
  const feed = new Feed(world);
  feed.watch({ what: Watch_What.STATION, station: "bay-1" });
  world.socket.onopen();
  return { world, feed };
}

const place = (seat: number, gone = false): Items[number] => ({ message: { case: "place", value: { seat, gone, info: { station: `bay-${seat}` } } } });
const reply = (text: string): Items[number] => ({ message: { case: "commandReply", value: { ok: true, text } } });
const start = { kind: Command_Kind.START, station: "bay-1" };

test("what is watched is said once the connection is open", () => {
  const { world, feed } = opened();
  assert.deepEqual(world.socket.watches(), ["bay-1"]);
  feed.watch({ what: Watch_What.STATION, station: "bay-2" });
  assert.deepEqual(world.socket.watches(), ["bay-1", "bay-2"]);
  assert.equal(world.sockets.length, 1);
});

test("batches are drawn only after the screen was, and the newest stands for all", () => {
  const { world } = opened();
  world.socket.batch([place(1)]);
  world.socket.batch([place(2)]);
  assert.deepEqual(world.socket.drawn(), []);
  world.draw();
  assert.deepEqual(world.socket.drawn(), [2]);
  world.draw();
  assert.deepEqual(world.socket.drawn(), [2]);
  world.socket.batch([]);
  world.draw();
  assert.deepEqual(world.socket.drawn(), [2, 3]);
});

test("a batch that was not drawn before the connection broke does not count on the next one", async () => {
  const { world } = opened();
  world.socket.batch([place(1)]);
  world.socket.onclose();
  await world.pass(500);
  world.socket.onopen();
  world.draw();
  assert.deepEqual(world.socket.drawn(), []);
  world.socket.batch([place(1)]);
  world.draw();
  assert.deepEqual(world.socket.drawn(), [1]);
});

test("seats keep their newest place, and go when the server says so", () => {
  const { world, feed } = opened();
  world.socket.batch([place(1), place(2), { message: { case: "moment", value: { seat: 2, step: 7n } } }]);
  assert.equal(feed.seats.get(2)?.moment?.step, 7n);
  world.at += 4000;
  world.socket.batch([place(1), place(2, true)]);
  assert.deepEqual([...feed.seats.keys()], [1]);
  world.at += 3500;
  assert.equal(feed.quietMs(), 3500);
});

test("what is shown is old from when nothing comes until something does", async () => {
  const { world, feed } = opened();
  world.socket.batch([place(1)]);
  world.at += 2999;
  assert.equal(feed.lostMs(), undefined);
  world.at += 1;
  assert.equal(feed.lostMs(), 3000);
  world.socket.batch([]);
  assert.equal(feed.lostMs(), undefined);
  world.at += 100;
  world.socket.onclose();
  assert.equal(feed.lostMs(), 100);
  await world.pass(900);
  assert.equal(feed.link.state, "connecting");
  assert.equal(feed.lostMs(), 1000);
  world.socket.onopen();
  assert.equal(feed.lostMs(), 1000); // it is still that of before
  world.socket.batch([place(1)]);
  assert.equal(feed.lostMs(), undefined);
  feed.unwatch();
  assert.equal(feed.lostMs(), undefined);
});

test("a connection on which nothing comes is made anew, unless it waits for the page", async () => {
  const { world } = opened();
  for (let i = 0; i < 4; i++) await world.pass(5000); // 20 s, and the retry
  await world.pass(1000);
  assert.equal(world.sockets.length, 2);
  world.socket.onopen();
  world.socket.batch([place(1)]); // not drawn: a page that nobody sees
  for (let i = 0; i < 6; i++) await world.pass(5000);
  assert.equal(world.sockets.length, 2);
  world.draw();
  for (let i = 0; i < 4; i++) await world.pass(5000);
  assert.equal(world.sockets.length, 3);
});

test("listeners get the messages of their kind in order, until they end", () => {
  const { world, feed } = opened();
  const seen: number[] = [];
  const end = feed.on("place", (one) => seen.push(one.seat));
  world.socket.batch([place(3), reply("x"), place(1)]);
  end();
  world.socket.batch([place(2)]);
  assert.deepEqual(seen, [3, 1]);
});

test("replies answer commands in order, a late one too", async () => {
  const { world, feed } = opened();
  const first = feed.command(start);
  const second = feed.command({ ...start, kind: Command_Kind.STOP });
  const late = Promise.all([first, second].map((one) => assert.rejects(one, (error: NoAnswer) => error.sent)));
  for (let s = 0; s < 11; s++) {
    world.socket.batch([]); // it is there
    world.draw();
    await world.pass(1000);
  }
  await late;
  const third = feed.command(start);
  world.socket.batch([reply("first"), reply("second"), reply("third")]);
  assert.equal((await third).text, "third");
});

test("a command without a connection was not sent; one whose connection broke may have been", async () => {
  const { world, feed } = opened();
  const sent = feed.command(start);
  world.socket.onclose();
  await assert.rejects(sent, (error: NoAnswer) => error.sent);
  await assert.rejects(feed.command(start), (error: NoAnswer) => !error.sent);
});

test("a broken connection is tried again, later each time, and asks for the same", async () => {
  const { world, feed } = opened();
  world.socket.batch([place(1)]);
  const waits: number[] = [];
  for (let i = 0; i < 7; i++) {
    world.socket.onclose();
    assert.equal(feed.link.state, "broken");
    const wait = feed.link.state === "broken" ? feed.link.retryAt - world.at : 0;
    waits.push(wait);
    await world.pass(wait - 1);
    assert.equal(feed.link.state, "broken");
    await world.pass(1);
    assert.equal(feed.link.state, "connecting");
  }
  assert.deepEqual(waits, [500, 1000, 2000, 4000, 8000, 8000, 8000]);
  assert.equal(feed.seats.size, 1); // what was last known
  world.socket.onopen();
  assert.deepEqual(world.socket.watches(), ["bay-1"]);
  world.socket.batch([]);
  world.socket.onclose();
  assert.equal(feed.link.state === "broken" && feed.link.retryAt - world.at, 500);
});

test("seats that a server does not know any more go after a reconnect", async () => {
  const { world, feed } = opened();
  world.socket.batch([place(1), place(2)]);
  world.socket.onclose();
  await world.pass(500);
  world.socket.onopen();
  assert.equal(feed.seats.size, 2);
  world.socket.batch([place(1)]);
  await world.pass(3000);
  assert.deepEqual([...feed.seats.keys()], [1]);
});

test("who is signed out does not try again", async () => {
  const { world, feed } = opened();
  world.may = false;
  world.socket.onclose();
  await world.pass(500);
  assert.equal(feed.link.state, "idle");
  assert.equal(world.sockets.length, 1);
});

test("what cannot be read closes the connection, and says nothing to anybody", () => {
  for (const data of ["text", Uint8Array.from([0x0a, 0xff]).buffer]) {
    const { world, feed } = opened();
    const socket = world.socket;
    feed.on("place", () => assert.fail());
    socket.onmessage({ data });
    assert.ok(socket.closed);
    assert.equal(feed.link.state, "broken");
  }
});

test("nothing is heard of a connection that was left", () => {
  const { world, feed } = opened();
  const socket = world.socket;
  feed.unwatch();
  feed.on("place", () => assert.fail());
  socket.batch([place(1)]);
  socket.onclose();
  assert.equal(feed.link.state, "idle");
  assert.equal(feed.quietMs(), 0);
});

test("a view that is opened after a pause does not count the pause as silence", async () => {
  const { world, feed } = opened();
  world.socket.batch([place(1)]);
  feed.unwatch();
  await world.pass(600_000);
  feed.watch({ what: Watch_What.WALL });
  assert.deepEqual([feed.quietMs(), feed.lostMs()], [0, undefined]);
  world.socket.onclose();
  assert.equal(feed.lostMs(), 0);
});
