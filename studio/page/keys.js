/**
 * Keys of the page: who does what, and what a list of them says.
 */

/**
 * `keys` are values of `KeyboardEvent.key`, with `Control+` or `Shift+` before; on a Mac the command key
 * passes for control.
 *
 * @typedef {object} Key
 * @property {string[]} keys
 * @property {string} says what it does, for the list
 * @property {(event: KeyboardEvent) => void | boolean} run false: it is somebody else's
 */

/** @param {EventTarget | null} element @returns {boolean} whether it takes typing itself */
function takesTyping(element) {
  if (!(element instanceof HTMLElement)) return false;
  if (element.isContentEditable || element.closest("dialog[open]")) return true;
  if (element instanceof HTMLInputElement) return !["checkbox", "radio", "button"].includes(element.type);
  return element instanceof HTMLTextAreaElement || element instanceof HTMLSelectElement;
}

/** @param {EventTarget | null} element @returns {boolean} whether Enter and blank press it */
function isPressed(element) {
  return element instanceof HTMLElement && element.matches("button, a[href], summary, input, [role=tab]");
}

export class Keys {
  /** @param {Document} [place] where keys are heard */
  constructor(place = document) {
    /** @type {Key[]} */
    this.list = [];
    place.addEventListener("keydown", (event) => this.#take(event));
  }

  /**
   * @param {string | string[]} keys
   * @param {string} says what it does, for the list
   * @param {(event: KeyboardEvent) => void | boolean} run false: it is somebody else's
   */
  add(keys, says, run) {
    this.list.push({ keys: [keys].flat(), says, run });
  }

  /** @param {KeyboardEvent} event */
  #take(event) {
    if (event.defaultPrevented || event.isComposing || event.altKey) return;
    const control = event.ctrlKey || event.metaKey;
    if (takesTyping(event.target)) return;
    if (!control && ["Enter", " "].includes(event.key) && isPressed(event.target)) return;
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    // Shift is part of a letter's or an arrow's name, but not of signs as + and ?.
    const shifted = event.shiftKey && (event.key.length > 1 || /[a-z]/.test(name));
    const pressed = `${control ? "Control+" : ""}${shifted ? "Shift+" : ""}${name}`;
    for (const { keys, run } of this.list) {
      if (keys.includes(pressed) && run(event) !== false) {
        event.preventDefault();
        return;
      }
    }
  }
}
