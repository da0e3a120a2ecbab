/** What a press on the solid does, how strong a strike is, and the camera's buttons. */

/** @typedef {import("../main.js").Parts} Parts */
/** @typedef {import("./view.js").View} View */

/**
 * @param {HTMLElement} element
 * @param {Pick<Parts, "selection" | "keys">} parts
 * @param {View} view
 */
export function makeToolbar(element, { selection, keys }, view) {
  element.className = "stage-toolbar";
  element.setAttribute("role", "toolbar");
  element.setAttribute("aria-label", "Strike, place, look");
  element.innerHTML = `
    <div class="tools" role="group" aria-label="A press on the solid">
      <button type="button" data-tool="strike" title="Strike (S)">Strike</button>
      <button type="button" data-tool="place" title="Place targets (T)">Place target</button>
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
  const slider = /** @type {HTMLInputElement} */ (element.querySelector("input[type=range]"));
  const holding = /** @type {HTMLInputElement} */ (element.querySelector("input[type=checkbox]"));
  const told = /** @type {HTMLOutputElement} */ (element.querySelector("output"));
  const fit = /** @type {HTMLButtonElement} */ (element.querySelector(".fit"));

  for (const tool of tools) {
    tool.onclick = () => selection.set({ tool: tool.dataset.tool === "place" ? "place" : "strike" });
  }
  slider.oninput = () => selection.set({ strength: Number(slider.value) });
  holding.onchange = () => selection.set({ holding: holding.checked });
  fit.onclick = () => view.fit();
  keys.add("s", "A press on the solid strikes it", () => selection.set({ tool: "strike" }));
  keys.add("t", "A press on the solid places a target", () => selection.set({ tool: "place" }));
  keys.add("0", "See all of the solid", () => view.fit());

  selection.onChange((now) => {
    for (const tool of tools) {
      tool.setAttribute("aria-pressed", String(tool.dataset.tool === now.tool));
    }
    slider.value = String(now.strength);
    slider.disabled = now.holding;
    told.textContent = now.holding ? "" : `${Math.round(100 * now.strength)} %`;
    holding.checked = now.holding;
  });
}
