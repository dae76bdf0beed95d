// The WebSocket /live: what the server says, batch by batch, and what the page says to it.
// Messages: shared/wire/arthron.proto, section "live"; when: shared/wire/PROTOCOL.md.
import { create, fromBinary, toBinary, type MessageInitShape } from "@bufbuild/protobuf";
import {
  LiveBatchSchema, PageSchema, WatchSchema, Watch_What,
  type CommandReply, type CommandSchema, type Live, type Moment, type Page, type Place, type Watch,
} from "wire";

export const SUBPROTOCOL = "arthron-live.1";
export const QUIET_MS = 3000; // from here on what is shown is called old

const RETRY_LEAST_MS = 500;
const RETRY_MOST_MS = 8000;
const REPLY_MS = 10_000;
const DEAD_MS = 10_000; // after so long without data the connection is replaced

export type Kind = NonNullable<Live["message"]["case"]>;
export type ValueOf<K extends Kind> = Extract<Live["message"], { case: K }>["value"];
export type WatchInit = MessageInitShape<typeof WatchSchema>;
export type CommandInit = MessageInitShape<typeof CommandSchema>;

/** Connection to the server; times as of Environment.now. */
export type Link =
  | { state: "idle" } // nothing is watched
  | { state: "connecting" }
  | { state: "open" }
  | { state: "broken"; since: number; retryAt: number };

/** What is known of a station, or of the recorded session, that Place.stationNumber and Moment.stationNumber name. */
export interface StationState {
  readonly number: number;
  place?: Place;
  placeAt: number; // Environment.now of its arrival
  moment?: Moment;
  momentAt: number;
}

/** All that is of the browser, so that tests can stand in for it. */
export interface Environment {
  open(): WebSocket;
  now(): number; // ms, monotonic
  afterDraw(then: () => void): void; // once, when the next frame is on the screen
  later(ms: number, then: () => void): () => void; // returns what takes it back
  mayRetry(): Promise<boolean>; // false: signed out, give up
  random(): number;
}

interface PendingCommand {
  resolve(reply: CommandReply): void;
  reject(error: Error): void;
  cancel(): void;
}

/** A command without an answer: it was not sent (`sent` false), or its outcome is unknown. */
export class NoAnswer extends Error {
  constructor(readonly sent: boolean) {
    super(sent ? "no answer" : "not connected");
  }
}

class Listeners {
  private readonly listeners = new Map<string, Set<(value: never) => void>>();

  /** Called for each message of that kind, in the order in which they came. Returns what ends it. */
  on<K extends Kind>(kind: K, listener: (value: ValueOf<K>) => void): () => void {
    return this.listen(kind, listener);
  }

  protected listen<V>(kind: string, listener: (value: V) => void): () => void {
    const all = this.listeners.get(kind) ?? new Set();
    this.listeners.set(kind, all);
    all.add(listener as (value: never) => void);
    return () => all.delete(listener as (value: never) => void);
  }

  protected tell(kind: string, value: unknown): void {
    for (const listener of this.listeners.get(kind) ?? []) listener(value as never);
  }
}

/** A batch that came in another way: it says its items once, to whoever listens then. */
export class Batch extends Listeners {
  private constructor(private readonly items: readonly Live[]) {
    super();
  }

  /** Undefined: the bytes are no encoded LiveBatch. */
  static of(bytes: Uint8Array): Batch | undefined {
    try {
      return new Batch(fromBinary(LiveBatchSchema, bytes).items);
    } catch {
      return undefined;
    }
  }

  play(): void {
    for (const { message } of this.items) if (message.case !== undefined) this.tell(message.case, message.value);
  }

  onLink(): () => void {
    return () => {};
  }

  watch(): void {}

  unwatch(): void {}

  send(): boolean {
    return false;
  }
}

export class Feed extends Listeners {
  /** By number; kept while the connection is broken, so that a view can show what was last known. */
  readonly stations = new Map<number, StationState>();
  link: Link = { state: "idle" };
  batches = 0; // on this connection
  lastBatchAt = 0;

  private socket: WebSocket | undefined;
  private watched: Watch | undefined;
  private asked: PendingCommand[] = [];
  private failures = 0;
  private lostAt: number | undefined; // since when nothing comes; until something does
  private drawPending = false;
  private cancelRetry: (() => void) | undefined;

  constructor(private readonly environment: Environment) {
    super();
  }

  /** Called after each change of `link`. */
  onLink(listener: (link: Link) => void): () => void {
    return this.listen("link", listener);
  }

  /** Takes the place of what was watched before, and is asked for again after a reconnect. */
  watch(what: WatchInit): void {
    this.watched = create(WatchSchema, what);
    this.stations.clear();
    if (this.link.state === "open") this.sendWatch();
    else if (this.link.state === "idle") this.connect();
  }

  /** Closes the connection: nothing is watched any more. */
  unwatch(): void {
    this.watched = undefined;
    this.cancelRetry?.();
    this.cancelRetry = undefined;
    this.lostAt = undefined;
    this.lastBatchAt = 0;
    this.stations.clear();
    this.drop();
    this.setLink({ state: "idle" });
  }

  /** False where it could not be sent. */
  send(message: Page["message"]): boolean {
    if (this.link.state !== "open" || !this.socket || this.socket.readyState > this.socket.OPEN) return false; // it may be closing
    this.socket.send(toBinary(PageSchema, create(PageSchema, { message })));
    return true;
  }

  /** The server's answer; rejects with NoAnswer if none comes. */
  command(command: CommandInit): Promise<CommandReply> {
    const page = create(PageSchema, { message: { case: "command", value: command } });
    return new Promise((resolve, reject) => {
      if (!this.send(page.message)) {
        reject(new NoAnswer(false));
        return;
      }
      // One that comes too late is still the answer to this one: it keeps its place.
      const cancel = this.environment.later(REPLY_MS, () => reject(new NoAnswer(true)));
      this.asked.push({ resolve, reject, cancel });
    });
  }

  /** How long the server has sent nothing, in ms; 0 if nothing is watched. */
  quietMs(): number {
    if (this.link.state === "idle") return 0;
    return this.lastBatchAt ? this.environment.now() - this.lastBatchAt : 0;
  }

  /** For how long all that is shown has been old, in ms; undefined: it is not. */
  lostMs(): number | undefined {
    if (this.link.state === "idle") return undefined;
    if (this.lostAt !== undefined) return this.environment.now() - this.lostAt;
    const quiet = this.quietMs();
    return quiet >= QUIET_MS ? quiet : undefined;
  }

  now(): number {
    return this.environment.now();
  }

  private setLink(link: Link): void {
    this.link = link;
    this.tell("link", link);
  }

  private connect(): void {
    this.setLink({ state: "connecting" });
    const socket = this.environment.open();
    this.socket = socket;
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.batches = 0;
      this.lastBatchAt = this.environment.now();
      this.setLink({ state: "open" });
      this.sendWatch();
      this.forgetGone(socket, this.environment.now());
      this.watchSilence(socket);
    };
    socket.onmessage = (event: MessageEvent) => this.take(socket, event.data);
    socket.onclose = () => this.broke(socket);
  }

  // After a reconnect the server sends every station at once. A station that it does not send is gone.
  private forgetGone(socket: WebSocket, since: number): void {
    this.environment.later(QUIET_MS, () => {
      if (socket !== this.socket || !this.batches) return;
      for (const one of this.stations.values()) if (Math.max(one.placeAt, one.momentAt) < since) this.stations.delete(one.number);
    });
  }

  // The server sends at least a Beat each second, except to a page that does not draw.
  private watchSilence(socket: WebSocket): void {
    this.environment.later(DEAD_MS / 2, () => {
      if (socket !== this.socket) return;
      if (this.drawPending || this.quietMs() < DEAD_MS) {
        this.watchSilence(socket);
        return;
      }
      socket.close();
      this.broke(socket);
    });
  }

  private sendWatch(): void {
    if (this.watched) this.send({ case: "watch", value: this.watched });
  }

  private take(socket: WebSocket, data: unknown): void {
    if (socket !== this.socket) return;
    let items: Live[];
    try {
      if (!(data instanceof ArrayBuffer)) throw new Error("not binary");
      items = fromBinary(LiveBatchSchema, new Uint8Array(data)).items;
    } catch {
      socket.close(); // unreadable: start again
      this.broke(socket);
      return;
    }
    this.failures = 0;
    this.lostAt = undefined;
    this.batches++;
    this.lastBatchAt = this.environment.now();
    for (const item of items) this.takeItem(item);
    this.sayDrawn(socket);
  }

  private takeItem({ message }: Live): void {
    if (message.case === undefined) return; // of a newer server
    if (message.case === "place") this.keepPlace(message.value);
    if (message.case === "moment") this.keepMoment(message.value);
    if (message.case === "commandReply") this.answer(message.value);
    this.tell(message.case, message.value);
  }

  private station(number: number): StationState {
    let found = this.stations.get(number);
    if (!found) this.stations.set(number, (found = { number, placeAt: 0, momentAt: 0 }));
    return found;
  }

  private keepPlace(place: Place): void {
    if (place.gone) {
      this.stations.delete(place.stationNumber);
      return;
    }
    const station = this.station(place.stationNumber);
    station.place = place;
    station.placeAt = this.environment.now();
  }

  private keepMoment(moment: Moment): void {
    const station = this.station(moment.stationNumber);
    station.moment = moment;
    station.momentAt = this.environment.now();
  }

  private answer(reply: CommandReply): void {
    const first = this.asked.shift();
    first?.cancel();
    first?.resolve(reply);
  }

  // The newest batch at the time of drawing: a page that is slow says so less often.
  private sayDrawn(socket: WebSocket): void {
    if (this.drawPending) return;
    this.drawPending = true;
    this.environment.afterDraw(() => {
      this.drawPending = false;
      if (socket === this.socket) this.send({ case: "drawn", value: { $typeName: "arthron.Drawn", batches: BigInt(this.batches) } });
      else if (this.socket && this.batches) this.sayDrawn(this.socket);
    });
  }

  private drop(): void {
    const socket = this.socket;
    this.socket = undefined;
    if (socket?.readyState === 0) socket.onopen = () => socket.close(); // sooner, it would be reported as failed
    else socket?.close();
    for (const asked of this.asked) {
      asked.cancel();
      asked.reject(new NoAnswer(true));
    }
    this.asked = [];
  }

  private broke(socket: WebSocket): void {
    if (socket !== this.socket) return;
    this.drop();
    const wait = Math.min(RETRY_MOST_MS, RETRY_LEAST_MS * 2 ** this.failures) * (0.75 + 0.5 * this.environment.random());
    this.failures++;
    this.lostAt ??= this.lastBatchAt || this.environment.now();
    this.setLink({ state: "broken", since: this.lostAt, retryAt: this.environment.now() + wait });
    this.cancelRetry = this.environment.later(wait, () => void this.retry());
  }

  private async retry(): Promise<void> {
    this.cancelRetry = undefined;
    const may = await this.environment.mayRetry().catch(() => true);
    if (this.link.state !== "broken" || this.cancelRetry) return;
    if (may) this.connect();
    else this.unwatch();
  }
}

/** The environment as it is. */
export function browserEnvironment(mayRetry: () => Promise<boolean>): Environment {
  return {
    open: () => new WebSocket(new URL("/live", location.href.replace(/^http/, "ws")), SUBPROTOCOL),
    now: () => performance.now(),
    afterDraw: (then) => void requestAnimationFrame(() => setTimeout(then)),
    later: (ms, then) => {
      const timer = setTimeout(then, ms);
      return () => clearTimeout(timer);
    },
    mayRetry,
    random: Math.random,
  };
}

export { Watch_What };
