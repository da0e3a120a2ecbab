/** What the pointer and keys do on the scene: strike a body, turn the camera. */

/** @typedef {import("./stage.js").Stage} Stage */
/** @typedef {import("./content.js").Body} Body */

const TURN = Math.PI / 24;
const NEARER = 1.15;

/** @type {Record<string, Parameters<Stage["move"]>[0]>} */
const WAYS = {
  "Shift+ArrowLeft": { left: TURN },
  "Shift+ArrowRight": { left: -TURN },
  "Shift+ArrowUp": { up: TURN },
  "Shift+ArrowDown": { up: -TURN },
  "+": { nearer: NEARER },
  "=": { nearer: NEARER },
  "-": { nearer: 1 / NEARER },
};

/**
 * A press on a body strikes it; one beside it, with the right button or with two fingers turns.
 *
 * @param {Stage} stage
 * @param {import("../page/keys.js").Keys} keys
 * @param {(body: Body, vertex: number) => void} strike
 */
export function takeStrikes(stage, keys, strike) {
  const { canvas } = stage;
  // Before the camera's own listeners, which ask whether they may turn.
  canvas.addEventListener(
    "pointerdown",
    (event) => {
      const first = event.button === 0 && event.isPrimary;
      const hit = first ? stage.hit(event.clientX, event.clientY) : null;
      stage.letTurn(hit === null);
      if (hit) strike(hit.body, hit.vertex);
    },
    { capture: true },
  );
  let frame = 0;
  canvas.addEventListener("pointermove", ({ buttons, clientX, clientY }) => {
    if (buttons !== 0 || frame !== 0) return;
    frame = requestAnimationFrame(() => {
      frame = 0;
      canvas.dataset.under = stage.hit(clientX, clientY) ? "strike" : "nothing";
    });
  });
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const way = WAYS[`${event.shiftKey && event.key.length > 1 ? "Shift+" : ""}${event.key}`];
    if (way) stage.move(way);
    else if (event.key === "Enter" && !event.repeat) strikeMiddle();
    else return;
    event.preventDefault();
  });
  keys.add("0", "See the scene as at first", () => stage.reset());

  function strikeMiddle() {
    const { x, y } = stage.middle();
    const hit = stage.hit(x, y);
    if (hit) strike(hit.body, hit.vertex);
  }
}
