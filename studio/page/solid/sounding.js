/**
 * How it sounds: volume, a meter, how long strikes touch, noise of the clips along with strikes, why
 * nothing is heard.
 */

/** @typedef {import("../main.js").Parts} Parts */

const LEAST_DECIBELS = -48;
const FALL_DECIBELS = 1.5;

/**
 * @param {HTMLElement} element
 * @param {Pick<Parts, "bank" | "noise">} parts
 */
export function makeSounding(element, { bank, noise }) {
  element.className = "sounding";
  element.setAttribute("role", "group");
  element.setAttribute("aria-label", "Sound");
  element.innerHTML = `
    <label>Volume <input type="range" min="0" max="1" step="0.05" /></label>
    <div class="level" aria-hidden="true"><span></span></div>
    <details class="sounding-more">
      <summary>More</summary>
      <div>
        <label title="How long a strike touches the solid: the longer, the duller it sounds">Contact
          <input class="contact" type="range" min="0" max="5" step="0.25" /> <output></output></label>
        <label title="Strikes sound with what is noise in the clips, near their targets">
          <input type="checkbox" /> With the clips' noise</label>
        <p class="quiet sounding-late"></p>
      </div>
    </details>
    <p class="sounding-says" role="status"></p>`;
  const volume = /** @type {HTMLInputElement} */ (element.querySelector("input[type=range]"));
  const noisy = /** @type {HTMLInputElement} */ (element.querySelector("input[type=checkbox]"));
  const level = /** @type {HTMLElement} */ (element.querySelector(".level"));
  const says = /** @type {HTMLElement} */ (element.querySelector(".sounding-says"));
  const late = /** @type {HTMLElement} */ (element.querySelector(".sounding-late"));
  const more = /** @type {HTMLDetailsElement} */ (element.querySelector("details"));
  // It lies over the solid, so it closes as a menu does.
  document.addEventListener("pointerdown", ({ target }) => {
    if (target instanceof Node && !more.contains(target)) more.open = false;
  });
  more.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !more.open) return;
    event.preventDefault();
    more.open = false;
    more.querySelector("summary")?.focus();
  });
  volume.value = String(bank.volume);
  volume.oninput = () => (bank.volume = Number(volume.value));
  const contact = /** @type {HTMLInputElement} */ (element.querySelector(".contact"));
  const touching = /** @type {HTMLOutputElement} */ (element.querySelector("output"));
  const touch = () => {
    const milliseconds = Number(contact.value);
    bank.contactSeconds = milliseconds / 1000;
    touching.textContent = `${milliseconds} ms`;
    contact.setAttribute("aria-valuetext", touching.textContent);
  };
  contact.value = String(1000 * bank.contactSeconds);
  contact.oninput = touch;
  touch();
  noisy.checked = noise.on;
  noisy.onchange = () => (noise.on = noisy.checked);

  let shown = LEAST_DECIBELS;
  let running = false;
  const step = () => {
    const { peak, ringing, limited } = bank.level();
    const decibels = 20 * Math.log10(Math.max(peak, 1e-9));
    shown = Math.max(LEAST_DECIBELS, decibels, shown - FALL_DECIBELS);
    level.style.setProperty("--level", (Math.min(1, 1 - shown / LEAST_DECIBELS)).toFixed(3));
    level.dataset.limited = String(limited);
    running = ringing > 0 || shown > LEAST_DECIBELS;
    if (running) requestAnimationFrame(step);
  };
  bank.onStrike(() => {
    if (running) return;
    running = true;
    // The processor tells of a strike a few blocks later.
    setTimeout(() => requestAnimationFrame(step), 60);
  });

  const tell = () => {
    const { baseSeconds, outputSeconds } = bank.latency;
    const milliseconds = Math.round(1000 * (baseSeconds + outputSeconds));
    says.textContent = bank.failure ?? (bank.state === "suspended" ? "Sound begins with a click or a key." : "");
    late.textContent = milliseconds > 0 ? `Heard ${milliseconds} ms after a strike.` : "";
  };
  bank.onState(tell);
  tell();
}
