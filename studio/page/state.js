/**
 * What the page knows: the last state of the server, and what the page alone chooses.
 */

/** @typedef {import("./types.js").State} State */
/** @typedef {import("./connection.js").Connection} Connection */
/** @typedef {{kind: import("./types.js").RowKind, number: number}} RowChoice */

/**
 * A value and who wants to know of its changes.
 *
 * @template T
 */
class Observed {
  /** @param {T} first */
  constructor(first) {
    this.current = first;
    /** @type {Set<(now: T, before: T) => void>} */
    this.functions = new Set();
  }

  /** @param {T} next */
  become(next) {
    const before = this.current;
    this.current = next;
    for (const wanted of this.functions) {
      try {
        wanted(next, before);
      } catch (error) {
        console.error(error); // one part's fault must not keep the others from hearing
      }
    }
  }
}

/**
 * The last state of the server, null until there is one.
 *
 * @extends {Observed<State | null>}
 */
export class ServerState extends Observed {
  /** @param {Connection} connection */
  constructor(connection) {
    super(null);
    connection.onEvent("state", (state) => this.become(state));
  }

  /**
   * Wants to know of states: told at once if there is one, and at every change.
   *
   * @param {(state: State, before: State | null) => void} wanted
   * @returns {() => void} what ends it
   */
  onChange(wanted) {
    /** @type {(now: State | null, before: State | null) => void} */
    const told = (now, before) => {
      if (now) wanted(now, before);
    };
    this.functions.add(told);
    if (this.current) wanted(this.current, null);
    return () => this.functions.delete(told);
  }
}

/**
 * What the page alone knows.
 *
 * `target` is the name of the selected target; `mode` the number of the mode under the pointer, from 0;
 * `vertex` was struck last; `strength` is that of a strike, 0 to 1; `tool` is what a click on the solid
 * does: strike it, place a target, paint the selected row, or place that on a point; `holding` says that a strike is the stronger the longer the pointer was down.
 *
 * @typedef {object} Choices
 * @property {string | null} target
 * @property {number | null} mode
 * @property {number | null} vertex
 * @property {number} strength
 * @property {"strike" | "place" | "paint" | "point"} tool
 * @property {boolean} holding
 * @property {RowChoice | null} row the region or support that is selected
 * @property {Record<string, unknown> | null} pending keys that a support gets with its point
 * @property {number} brush radius, in longest sides of the solid
 * @property {boolean} erasing whether the brush takes paint away
 * @property {"modulus" | "regions"} colouring what the solid's colours stand for
 */

/** @extends {Observed<Choices>} */
export class Selection extends Observed {
  constructor() {
    super({
      target: null,
      mode: null,
      vertex: null,
      strength: 1,
      tool: "strike",
      holding: false,
      row: null,
      pending: null,
      brush: 0.06,
      erasing: false,
      colouring: "modulus",
    });
  }

  /** @param {Partial<Choices>} changes */
  set(changes) {
    const next = { ...this.current, ...changes };
    const keys = /** @type {(keyof Choices)[]} */ (Object.keys(next));
    if (keys.some((key) => next[key] !== this.current[key])) this.become(next);
  }

  /**
   * Wants to know of choices: told at once, and at every change.
   *
   * @param {(now: Choices, before: Choices) => void} wanted
   * @returns {() => void} what ends it
   */
  onChange(wanted) {
    this.functions.add(wanted);
    wanted(this.current, this.current);
    return () => this.functions.delete(wanted);
  }

  /**
   * Keeps to rows that there are, and to tools that do something with the selected one.
   *
   * @param {ServerState} state
   */
  followRows(state) {
    state.onChange((now, before) => {
      const { row, tool, colouring } = this.current;
      const chosen = row === null ? undefined : now[row.kind][row.number];
      if (row !== null && !chosen) this.set({ row: null, pending: null });
      const painted = chosen !== undefined && chosen.dabs !== null;
      if ((tool === "paint" && !painted) || (tool === "point" && !chosen)) this.set({ tool: "strike" });
      const rows = now.regions.length + now.supports.length;
      const fewer = before === null || rows > before.regions.length + before.supports.length;
      if (rows > 0 && fewer) this.set({ colouring: "regions" });
      if (rows === 0 && colouring === "regions") this.set({ colouring: "modulus" });
    });
  }

  /**
   * Keeps to targets that there are: a new one is selected, and one that is gone gives way to the first one.
   *
   * @param {ServerState} state
   */
  follow(state) {
    state.onChange((now, before) => {
      const names = now.targets.map((target) => target.name);
      const chosen = this.current.target;
      const known = (before?.targets ?? []).map((target) => target.name);
      const fresh = names.filter((name) => !known.includes(name));
      if (before !== null && fresh.length === 1 && names.length === known.length + 1) {
        this.set({ target: fresh[0] });
        return;
      }
      if (chosen !== null && names.includes(chosen)) return;
      // A renamed target keeps its place in the list.
      const renamed = chosen === null ? undefined : names[known.indexOf(chosen)];
      if (renamed !== undefined && fresh.includes(renamed)) this.set({ target: renamed });
      else if (chosen !== null || before === null) this.set({ target: names[0] ?? null });
      else if (fresh.length > 0) this.set({ target: fresh[0] });
    });
  }
}
