/** What a press on the solid does, how strong a strike is, what colours stand for, and the camera's buttons. */

/** @typedef {import("../main.js").Parts} Parts */
/** @typedef {import("./view.js").View} View */

/**
 * @param {HTMLElement} element
 * @param {Pick<Parts, "selection" | "keys" | "state">} parts
 * @param {View} view
 */
export function makeToolbar(element, { selection, keys, state }, view) {
  element.className = "stage-toolbar";
  element.setAttribute("role", "toolbar");
  element.setAttribute("aria-label", "Strike, place, look");
  element.innerHTML = `
    <div class="tools" role="group" aria-label="A press on the solid">
      <button type="button" data-tool="strike" title="Strike (S)">Strike</button>
      <button type="button" data-tool="place" title="Place targets (T)">Place target</button>
      <button type="button" data-tool="paint" title="Paint the selected region or support (P)">Paint</button>
    </div>
    <div class="tools" role="group" aria-label="Colours" data-colours>
      <button type="button" data-colouring="regions">Regions</button>
      <button type="button" data-colouring="modulus">Modulus</button>
    </div>
    <div class="strengths">
      <label class="strength">Strength
        <input type="range" min="0.05" max="1" step="0.05" />
        <output></output>
      </label>
      <label class="holding"><input type="checkbox" /> by holding</label>
    </div>
    <button type="button" class="fit" title="See all of it (0)">Fit</button>`;
  const tools = [.../** @type {NodeListOf<HTMLButtonElement>} */ (element.querySelectorAll("[data-tool]"))];
  const paint = /** @type {HTMLButtonElement} */ (element.querySelector("[data-tool=paint]"));
  const colours = /** @type {HTMLElement} */ (element.querySelector("[data-colours]"));
  const colourings = [.../** @type {NodeListOf<HTMLButtonElement>} */ (element.querySelectorAll("[data-colouring]"))];
  const slider = /** @type {HTMLInputElement} */ (element.querySelector("input[type=range]"));
  const holding = /** @type {HTMLInputElement} */ (element.querySelector("input[type=checkbox]"));
  const strengths = /** @type {HTMLElement} */ (element.querySelector(".strengths"));
  const told = /** @type {HTMLOutputElement} */ (element.querySelector("output"));
  const fit = /** @type {HTMLButtonElement} */ (element.querySelector(".fit"));

  for (const tool of tools) {
    tool.onclick = () => selection.set({ tool: /** @type {"strike" | "place" | "paint"} */ (tool.dataset.tool) });
  }
  for (const button of colourings) {
    button.onclick = () => selection.set({ colouring: button.dataset.colouring === "regions" ? "regions" : "modulus" });
  }
  slider.oninput = () => selection.set({ strength: Number(slider.value) });
  holding.onchange = () => selection.set({ holding: holding.checked });
  fit.onclick = () => view.fit();
  keys.add("s", "A press on the solid strikes it", () => selection.set({ tool: "strike" }));
  keys.add("t", "A press on the solid places a target", () => selection.set({ tool: "place" }));
  keys.add("p", "A press on the solid paints the selected region or support", () => {
    if (!isPaintable()) return false;
    selection.set({ tool: "paint", colouring: "regions" });
  });
  keys.add("0", "See all of the solid", () => view.fit());

  /** @returns {boolean} whether a row is selected that is placed by paint */
  function isPaintable() {
    const { row } = selection.current;
    return row !== null && (state.current?.[row.kind][row.number]?.dabs ?? null) !== null;
  }

  function showRows() {
    const { regions = [], supports = [] } = state.current ?? {};
    colours.hidden = regions.length + supports.length === 0;
    paint.hidden = !isPaintable();
    for (const button of colourings) {
      button.setAttribute("aria-pressed", String(button.dataset.colouring === selection.current.colouring));
    }
  }

  state.onChange(showRows);
  selection.onChange((now) => {
    showRows();
    for (const tool of tools) {
      tool.setAttribute("aria-pressed", String(tool.dataset.tool === now.tool));
    }
    strengths.hidden = now.tool !== "strike";
    slider.value = String(now.strength);
    slider.disabled = now.holding;
    told.textContent = now.holding ? "" : `${Math.round(100 * now.strength)} %`;
    holding.checked = now.holding;
  });
}
