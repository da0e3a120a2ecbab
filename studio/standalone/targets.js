/** The targets, each with its clip and the design there, one after the other. */

/** @typedef {import("./main.js").Page} Page */

/**
 * @param {HTMLElement} element
 * @param {Page} page
 */
export function makeTargets(element, page) {
  const { design, player, selection } = page;
  const list = document.createElement("ul");
  list.className = "standalone-targets";
  /** @type {HTMLElement[]} */
  const names = [];
  for (const [number, { name, vertex }] of design.targets.entries()) {
    const strike = () => {
      page.strike(vertex, 1);
      return page.seconds;
    };
    /** @type {[string, () => Promise<import("../page/sound/player.js").Piece[]>][]} */
    const choices = [
      ["Clip", async () => [await page.clip(number)]],
      ["Design", async () => [strike]],
      ["One after the other", async () => [await page.clip(number), strike]],
    ];
    const item = document.createElement("li");
    const choose = document.createElement("button");
    choose.type = "button";
    choose.className = "name";
    choose.textContent = name;
    choose.onclick = () => selection.set({ target: name });
    names.push(choose);
    const group = document.createElement("div");
    group.setAttribute("role", "group");
    group.setAttribute("aria-label", `Listen at ${name}`);
    for (const [says, pieces] of choices) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = says;
      button.onclick = async () => {
        selection.set({ target: name });
        page.bank.silence();
        try {
          await player.playInTurn(await pieces());
        } catch (error) {
          page.tell(/** @type {Error} */ (error).message);
        }
      };
      group.append(button);
    }
    item.append(choose, group);
    list.append(item);
  }
  element.append(list);
  selection.onChange((now) => {
    for (const name of names) {
      name.setAttribute("aria-pressed", String(name.textContent === now.target));
    }
  });
}
