// A network that takes its time: what a station sends to it comes to the server later, and back. A process
// of its own, so that nothing else makes it later still: node relay.mjs '{"from", "to", "tcp", "udp", "delayMs"}'
import { createSocket } from "node:dgram";
import { connect, createServer } from "node:net";

// TCP and UDP from one address to another; each way takes `delayMs`.
class Relay {
  #sockets = new Set();
  #delayMs;

  static async open({ from, to, tcp, udp, delayMs }) {
    const relay = new Relay();
    relay.#delayMs = delayMs;
    await relay.#listenTcp(from, to, tcp);
    await relay.#listenUdp(from, to, udp);
    return relay;
  }

  // Timers of one length run in the order in which they were set, so bytes keep theirs.
  #later(what) {
    setTimeout(what, this.#delayMs);
  }

  #listenTcp(from, to, port) {
    const server = createServer({ allowHalfOpen: true }, (near) => {
      const far = connect({ host: to, port, allowHalfOpen: true });
      for (const [a, b] of [[near, far], [far, near]]) {
        this.#sockets.add(a);
        a.setNoDelay(true);
        a.on("data", (data) => this.#later(() => b.writable && b.write(data)));
        a.on("end", () => this.#later(() => b.end()));
        a.on("error", () => b.destroy());
        a.on("close", () => this.#sockets.delete(a));
      }
    });
    return new Promise((resolve, reject) => server.once("error", reject).listen(port, from, resolve));
  }

  #listenUdp(from, to, port) {
    const near = createSocket("udp4");
    const peers = new Map();
    const peer = (address, back) => {
      let far = peers.get(`${address}:${back}`);
      if (far) return far;
      far = createSocket("udp4");
      far.on("message", (data) => this.#later(() => this.#sockets.has(near) && near.send(data, back, address)));
      peers.set(`${address}:${back}`, far);
      this.#sockets.add(far);
      return far;
    };
    near.on("message", (data, { address, port: back }) => {
      const far = peer(address, back);
      this.#later(() => this.#sockets.has(far) && far.send(data, port, to));
    });
    this.#sockets.add(near);
    return new Promise((resolve, reject) => near.once("error", reject).bind(port, from, resolve));
  }
}

await Relay.open(JSON.parse(process.argv[2]));
console.log("open");
