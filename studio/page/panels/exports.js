/** What a design can be taken along as. */

import { attempt } from "./chosen.js";
import { button, make } from "./dom.js";

/** @type {[string, string, string][]} kind, name, what it is for */
const KINDS = [
  ["html", "Page", "one file that anybody can open and strike, without a network"],
  ["h5", "Design (HDF5)", "modes, material and clips; carillon render and export read it"],
  ["zip", "For game engines (ZIP)", "sounds with a table of levels, model, modes for FMOD, Wwise, Unity, Unreal, Godot"],
  ["wav", "Sound (WAV)", "the solid struck at the selected target"],
  ["glb", "Model (GLB)", "surface with the material as colours and the modes, in one file"],
  ["gltf", "Model (glTF)", "the same as text"],
  ["dsp", "Faust (DSP)", "a synthesiser of the modes for plug-ins and boards"],
  ["npy", "Moduli (NPY)", "Young's modulus of every voxel, for NumPy and carillon modes"],
];

/**
 * Makes the list of exports.
 *
 * @param {import("../main.js").Parts} parts
 * @returns {HTMLElement}
 */
export function makeExports(parts) {
  return make(
    "ul",
    { class: "exports" },
    ...KINDS.map(([kind, name, use]) => {
      const press = button(name, () => void take(), { "data-kind": kind });
      async function take() {
        press.disabled = true;
        await attempt(parts, () => download(kind, parts.selection.current.target));
        press.disabled = false;
        press.focus();
      }
      return make("li", {}, press, make("span", { class: "hint" }, use));
    }),
  );
}

/**
 * Fetches an export and hands it to the browser as a download.
 *
 * @param {string} kind
 * @param {string | null} target
 */
async function download(kind, target) {
  const query = target === null ? "" : `?target=${encodeURIComponent(target)}`;
  const answer = await fetch(`/export/${kind}${query}`);
  if (!answer.ok) {
    const told = await answer.json().catch(() => ({}));
    throw new Error(told.error ?? `The export failed (status ${answer.status}).`);
  }
  const address = URL.createObjectURL(await answer.blob());
  const link = make("a", { href: address, download: nameIn(answer.headers, kind) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 60_000);
}

/**
 * Name of a file that the server gave it.
 *
 * @param {Headers} headers
 * @param {string} kind
 */
function nameIn(headers, kind) {
  const disposition = headers.get("Content-Disposition") ?? "";
  const coded = /filename\*=UTF-8''([^;]+)/i.exec(disposition)?.[1];
  if (coded) return decodeURIComponent(coded);
  return /filename="([^"]+)"/i.exec(disposition)?.[1] ?? `design.${kind}`;
}
