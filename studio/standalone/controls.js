/** How hard, how loud, with what. */

/** @typedef {import("./main.js").Page} Page */

const HOW =
  "Press on the solid. It turns by dragging beside it, with the right button or with two fingers; " +
  "1 to 9 strike the last point again.";
const HOW_WITHOUT_GRAPHICS = "Strike where the targets are.";

/**
 * @param {HTMLElement} element
 * @param {{name: string, low: number, high: number, step: number, value: number}} range
 * @param {(value: number) => string} shown
 * @param {(value: number) => void} take
 */
export function addRange(element, range, shown, take) {
  const label = document.createElement("label");
  const input = document.createElement("input");
  const output = document.createElement("output");
  const name = document.createElement("span");
  name.textContent = range.name;
  input.type = "range";
  input.min = String(range.low);
  input.max = String(range.high);
  input.step = String(range.step);
  input.value = String(range.value);
  const change = () => {
    const value = Number(input.value);
    output.textContent = shown(value);
    input.setAttribute("aria-valuetext", shown(value));
    take(value);
  };
  input.oninput = change;
  label.append(name, input, output);
  element.append(label);
  change();
}

/**
 * @param {HTMLElement} element
 * @param {Page} page
 * @param {boolean} drawn Whether there is a solid to be seen.
 */
export function makeControls(element, { bank, selection }, drawn) {
  const how = document.getElementById("how");
  if (how) how.textContent = drawn ? HOW : HOW_WITHOUT_GRAPHICS;
  /** @param {number} value @returns {string} */
  const percent = (value) => `${Math.round(100 * value)} %`;
  addRange(element, { name: "Strength", low: 0.05, high: 1, step: 0.05, value: 1 }, percent, (value) =>
    selection.set({ strength: value }),
  );
  addRange(
    element,
    { name: "Contact", low: 0, high: 5, step: 0.25, value: 0 },
    (value) => (value === 0 ? "none: a click" : `${value} ms`),
    (value) => {
      bank.contactSeconds = value / 1000;
    },
  );
  addRange(element, { name: "Volume", low: 0, high: 1, step: 0.05, value: 1 }, percent, (value) => {
    bank.volume = value;
  });
  const hold = document.createElement("label");
  const box = document.createElement("input");
  box.type = "checkbox";
  box.onchange = () => selection.set({ holding: box.checked });
  const says = document.createElement("span");
  says.textContent = "The longer it is pressed, the harder";
  hold.className = "holding";
  hold.append(box, says);
  element.append(hold);
}
