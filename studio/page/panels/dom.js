/** Elements made in one line, and lists that keep the elements they have. */

/** @typedef {Node | string | number | null | undefined | false} Child */

/**
 * Makes an element.
 *
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag its name
 * @param {Record<string, unknown>} [attributes] functions under `onNAME` become listeners, `true` an
 *   attribute without a value; what is `false`, `null` or `undefined` is left out
 * @param {...Child} children texts are taken as texts, never as markup
 * @returns {HTMLElementTagNameMap[K]}
 */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") {
      element.addEventListener(name.slice(2), /** @type {EventListener} */ (value));
    } else {
      setAttribute(element, name, value);
    }
  }
  add(element, children);
  return element;
}

/**
 * Appends children, leaving out what is not there.
 *
 * @param {Element} parent
 * @param {Child[]} children
 */
export function add(parent, children) {
  for (const child of children) {
    if (child === null || child === undefined || child === false) continue;
    parent.append(child instanceof Node ? child : String(child));
  }
}

/**
 * Sets an attribute, or removes it. Writes nothing where nothing changes, so that screen readers are
 * not made to read it again.
 *
 * @param {Element} element
 * @param {string} name
 * @param {unknown} value
 */
export function setAttribute(element, name, value) {
  if (value === false || value === null || value === undefined) {
    element.removeAttribute(name);
    return;
  }
  const text = value === true ? "" : String(value);
  if (element.getAttribute(name) !== text) element.setAttribute(name, text);
}

/**
 * Sets a text where it is another one.
 *
 * @param {Node} node
 * @param {string} text
 */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/**
 * Sets the value of an input that nobody is typing in.
 *
 * @param {HTMLInputElement | HTMLSelectElement} input
 * @param {string} value
 */
export function setValue(input, value) {
  if (document.activeElement !== input && input.value !== value) input.value = value;
}

/**
 * Makes the children of an element those of a list. Elements of items that stay are kept, and with them
 * the focus.
 *
 * @template T
 * @param {Element} parent
 * @param {readonly T[]} items
 * @param {(item: T, index: number) => string} key tells items apart
 * @param {(item: T) => HTMLElement} create
 * @param {(element: HTMLElement, item: T, index: number) => void} update
 */
export function keepList(parent, items, key, create, update) {
  /** @type {Map<string, HTMLElement>} */
  const there = new Map();
  for (const child of Array.from(parent.children)) {
    if (child instanceof HTMLElement) there.set(child.dataset.key ?? "", child);
  }
  /** @type {Element | null} */
  let last = null;
  items.forEach((item, index) => {
    const name = key(item, index);
    let element = there.get(name);
    if (element) {
      there.delete(name);
    } else {
      element = create(item);
      element.dataset.key = name;
    }
    const next = /** @type {Element | null} */ (last ? last.nextElementSibling : parent.firstElementChild);
    if (next !== element) parent.insertBefore(element, next);
    update(element, item, index);
    last = element;
  });
  for (const element of there.values()) element.remove();
}

let made = 0;

/**
 * An identifier that no other element has, for labels.
 *
 * @param {string} stem
 * @returns {string}
 */
export function identifier(stem) {
  made += 1;
  return `${stem}-${made}`;
}

/**
 * A button.
 *
 * @param {string} text
 * @param {() => void} press
 * @param {Record<string, unknown>} [attributes]
 * @returns {HTMLButtonElement}
 */
export function button(text, press, attributes = {}) {
  return make("button", { type: "button", onclick: press, ...attributes }, text);
}

/**
 * The first element that a selector finds.
 *
 * @template {Element} E
 * @param {ParentNode} parent
 * @param {string} selector
 * @param {new () => E} kind
 * @returns {E}
 */
export function find(parent, selector, kind) {
  const found = parent.querySelector(selector);
  if (!(found instanceof kind)) throw new Error(`there is no ${selector}`);
  return found;
}

/**
 * Title of a dialog and the button that closes it, which is first so that nothing is scrolled away.
 *
 * @param {string} id of the title
 * @param {string} text
 * @returns {HTMLElement}
 */
export function sheetHead(id, text) {
  return make(
    "form",
    { method: "dialog", class: "sheet-head" },
    make("h2", { id }, text),
    make("button", {}, "Close"),
  );
}
