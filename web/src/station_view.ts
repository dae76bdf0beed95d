// The newest poses from the station on this PC (PROTOCOL.md, View): a WebSocket on the loopback.
import { fromBinary } from "@bufbuild/protobuf";
import { ViewSchema, type View } from "wire";

const SUBPROTOCOL = "arthron-view.1";
const RETRY_MS = 1500;
const FRESH_MS = 500;

export interface ViewAddress {
  port: number;
  token: string; // 64 hexadecimal digits
}

export const TOKEN = /^[0-9a-f]{64}$/i;

export const isPort = (port: number | undefined): port is number => Number.isInteger(port) && port! > 0 && port! < 65536;

export class StationView {
  newest: View | undefined;
  at = 0; // performance.now() of its arrival
  onView: () => void = () => {};
  private socket: WebSocket | undefined;
  private timer = 0;

  constructor(private readonly place: ViewAddress) {
    this.connect();
  }

  get fresh(): boolean {
    return this.newest !== undefined && performance.now() - this.at < FRESH_MS;
  }

  close(): void {
    clearTimeout(this.timer);
    const socket = this.socket;
    this.socket = undefined;
    socket?.close();
  }

  private connect(): void {
    const socket = new WebSocket(`ws://127.0.0.1:${this.place.port}/view?token=${this.place.token}`, SUBPROTOCOL);
    this.socket = socket;
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => this.take(data);
    socket.onclose = () => {
      if (socket !== this.socket) return;
      this.timer = window.setTimeout(() => this.connect(), RETRY_MS);
    };
  }

  // The last one counts: those that wait behind each other were skipped in the picture anyway.
  private take(data: unknown): void {
    if (!(data instanceof ArrayBuffer)) return;
    try {
      this.newest = fromBinary(ViewSchema, new Uint8Array(data));
    } catch {
      return; // not a station, or one of another age
    }
    this.at = performance.now();
    this.onView();
  }
}
