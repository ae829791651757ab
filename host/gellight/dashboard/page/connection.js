// The WebSocket to the server: credits out, frames and status in, and a new attempt whenever it is lost.

const FIRST_RETRY_MS = 300;
const LAST_RETRY_MS = 3000;
const FRAMES_AHEAD = 2; // one being drawn, one on its way

export class Connection {
  #socket = null;
  #retryMs = FIRST_RETRY_MS;
  #retryTimer = null;
  #listeners;

  /** `listeners`: frame(ArrayBuffer), status(object), open(), lost(). */
  constructor(listeners) {
    this.#listeners = listeners;
    this.#open();
  }

  #open() {
    this.#retryTimer = null;
    const address = new URL("ws", location.href.split("#")[0]);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    address.search = "";
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.#retryMs = FIRST_RETRY_MS;
      this.#socket = socket;
      this.#listeners.open();
      this.grant(FRAMES_AHEAD);
    };
    socket.onmessage = ({ data }) => {
      if (data instanceof ArrayBuffer) this.#listeners.frame(data);
      else this.#listeners.status(JSON.parse(data));
    };
    socket.onclose = () => this.#retry();
  }

  #retry() {
    this.#socket = null;
    this.#listeners.lost();
    this.#retryTimer = setTimeout(() => this.#open(), this.#retryMs);
    this.#retryMs = Math.min(this.#retryMs * 1.6, LAST_RETRY_MS);
  }

  /** Try to connect now, not later. */
  retryNow() {
    if (this.#retryTimer === null) return;
    clearTimeout(this.#retryTimer);
    this.#open();
  }

  /** Tell the server that `count` more frames can be drawn. */
  grant(count) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify({ count }));
  }
}
