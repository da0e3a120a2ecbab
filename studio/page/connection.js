/**
 * The connection to the server: calls with replies, events, binary messages, uploads.
 *
 * It is opened anew, at growing intervals, whenever it breaks.
 */

/** @typedef {Float32Array | Float64Array | Uint32Array | Uint16Array} Numbers */
/** @typedef {Record<string, Numbers>} Arrays */
/** @typedef {"connecting" | "open" | "lost" | "refused"} Status `refused` by a server that was started anew */

const FIRST_WAIT_SECONDS = 0.5;
const LONGEST_WAIT_SECONDS = 8;
const NO_ANSWER =
  "The studio's server does not answer: see whether it still runs, and wait or start it again.";

/** @type {Record<string, (buffer: ArrayBuffer, from: number, length: number) => Numbers>} */
const VIEWS = {
  f4: (buffer, from, length) => new Float32Array(buffer, from, length),
  f8: (buffer, from, length) => new Float64Array(buffer, from, length),
  u4: (buffer, from, length) => new Uint32Array(buffer, from, length),
  u2: (buffer, from, length) => new Uint16Array(buffer, from, length),
};
/** @type {Record<string, number>} */
const BYTES = { f4: 4, f8: 8, u4: 4, u2: 2 };

/** @param {number} offset @returns {number} */
const padded = (offset) => Math.ceil(offset / 8) * 8;

/**
 * Header and arrays of a binary message; the arrays are views of it.
 *
 * @param {ArrayBuffer} buffer
 * @returns {{header: any, arrays: Arrays}}
 */
export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  /** @type {Arrays} */
  const arrays = {};
  let from = padded(4 + length);
  for (const { name, type, shape } of header.arrays) {
    const count = shape.reduce((/** @type {number} */ a, /** @type {number} */ b) => a * b, 1);
    arrays[name] = VIEWS[type](buffer, from, count);
    from = padded(from + count * BYTES[type]);
  }
  return { header, arrays };
}

/** Functions by the name of what they wait for. */
class Listeners {
  constructor() {
    /** @type {Map<string, Set<Function>>} */
    this.functions = new Map();
  }

  /** @param {string} name @param {Function} wanted @returns {() => void} what ends it */
  add(name, wanted) {
    const set = this.functions.get(name) ?? new Set();
    this.functions.set(name, set.add(wanted));
    return () => set.delete(wanted);
  }

  /** @param {string} name @param {...any} values */
  tell(name, ...values) {
    for (const wanted of this.functions.get(name) ?? []) {
      try {
        wanted(...values);
      } catch (error) {
        console.error(error); // one part's fault must not keep the others from hearing
      }
    }
  }
}

export class Connection {
  /** @param {string} [address] of the WebSocket; the page's own server where there is none */
  constructor(address) {
    this.address = address ?? `${location.protocol.replace("http", "ws")}//${location.host}/socket`;
    /** @type {Status} */
    this.status = "connecting";
    this.listeners = new Listeners();
    /** @type {Map<number, {resolve: (value: any) => void, reject: (error: Error) => void}>} */
    this.waiting = new Map();
    this.lastNumber = 0;
    this.wait = FIRST_WAIT_SECONDS;
    /** @type {WebSocket | null} */
    this.socket = null;
  }

  /** Connects, and goes on doing so. */
  open() {
    const socket = new WebSocket(this.address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.wait = FIRST_WAIT_SECONDS;
      this.#become("open");
    };
    socket.onmessage = (message) => this.#take(message.data);
    socket.onclose = () => {
      this.socket = null;
      this.#explain();
      for (const { reject } of this.waiting.values()) reject(new Error(NO_ANSWER));
      this.waiting.clear();
      setTimeout(() => this.open(), this.wait * 1000);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT_SECONDS);
    };
  }

  /**
   * Asks the server to do something.
   *
   * @param {string} name of the call
   * @param {Record<string, unknown>} [values] its arguments
   * @returns {Promise<any>} the reply; rejected with the server's sentence
   */
  call(name, values = {}) {
    const socket = this.socket;
    if (!socket || socket.readyState !== WebSocket.OPEN) return Promise.reject(new Error(NO_ANSWER));
    const id = ++this.lastNumber;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      socket.send(JSON.stringify({ ...values, id, do: name }));
    });
  }

  /**
   * Sends a file.
   *
   * @param {"mesh" | "clip"} kind
   * @param {string} name of the file
   * @param {Blob} blob
   * @returns {Promise<string>} its identifier; rejected with the server's sentence
   */
  async upload(kind, name, blob) {
    const response = await this.#fetch(`/${kind}?name=${encodeURIComponent(name)}`, {
      method: "POST",
      body: blob,
    });
    return (await response.json())[kind];
  }

  /**
   * Header and arrays of a binary answer, as that of `/surface/3`.
   *
   * @param {string} path
   * @returns {Promise<{header: any, arrays: Arrays}>}
   */
  async binary(path) {
    return unpack(await (await this.#fetch(path)).arrayBuffer());
  }

  /**
   * A JSON answer, as that of `/clip/c1/spectrum`.
   *
   * @param {string} path
   * @returns {Promise<any>}
   */
  async json(path) {
    return (await this.#fetch(path)).json();
  }

  /**
   * Wants to know of events, `state` and `progress` among them.
   *
   * @param {string} name
   * @param {(event: any) => void} wanted
   * @returns {() => void} what ends it
   */
  onEvent(name, wanted) {
    return this.listeners.add(`event ${name}`, wanted);
  }

  /**
   * Wants to know of binary messages.
   *
   * @param {string} name
   * @param {(header: any, arrays: Arrays) => void} wanted
   * @returns {() => void} what ends it
   */
  onBinary(name, wanted) {
    return this.listeners.add(`binary ${name}`, wanted);
  }

  /**
   * Wants to know of the connection: told at once, and at every change.
   *
   * @param {(status: Status) => void} wanted
   * @returns {() => void} what ends it
   */
  onStatus(wanted) {
    wanted(this.status);
    return this.listeners.add("status", wanted);
  }

  /** Tells why there is no connection; a WebSocket does not know. */
  async #explain() {
    const response = await fetch("/schema.json").catch(() => null);
    if (this.socket?.readyState !== WebSocket.OPEN) this.#become(response?.status === 403 ? "refused" : "lost");
  }

  /** @param {Status} status */
  #become(status) {
    if (status === this.status) return;
    this.status = status;
    this.listeners.tell("status", status);
  }

  /** @param {string | ArrayBuffer} data */
  #take(data) {
    if (typeof data !== "string") {
      const { header, arrays } = unpack(data);
      this.listeners.tell(`binary ${header.event}`, header, arrays);
      return;
    }
    const message = JSON.parse(data);
    if (message.event !== undefined) {
      this.listeners.tell(`event ${message.event}`, message);
      return;
    }
    const waiting = this.waiting.get(message.reply);
    this.waiting.delete(message.reply);
    if (message.error === undefined) waiting?.resolve(message);
    else waiting?.reject(new Error(message.error));
  }

  /** @param {string} path @param {RequestInit} [init] @returns {Promise<Response>} */
  async #fetch(path, init) {
    let response;
    try {
      response = await fetch(path, init);
    } catch {
      throw new Error(NO_ANSWER);
    }
    if (response.ok) return response;
    const told = await response.json().catch(() => ({}));
    throw new Error(told.error ?? `The server refused ${path.split("?")[0]} (${response.status}).`);
  }
}
