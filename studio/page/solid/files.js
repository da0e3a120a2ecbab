/** Files that come to the page: meshes and clips, dropped or chosen. */

import { attempt, giveClip } from "../panels/chosen.js";

/** @typedef {import("../main.js").Parts} Parts */

/**
 * Metres per unit of a file, and what people call it.
 *
 * @type {[number, string][]}
 */
export const UNITS = [
  [1, "m"],
  [0.01, "cm"],
  [0.001, "mm"],
  [0.0254, "inch"],
];

/** Endings of clips, as the server takes them (`studio/server/uploads.py`). */
export const CLIP_ENDINGS = [".wav", ".wave", ".flac", ".ogg", ".oga", ".aif", ".aiff", ".mp3"];
const MESHES = /\.(obj|stl|ply|off|glb|gltf)$/i;

/** @param {File} file @returns {"mesh" | "clip" | null} what it is taken for */
export function kindOf(file) {
  const name = file.name.toLowerCase();
  if (CLIP_ENDINGS.some((ending) => name.endsWith(ending)) || file.type.startsWith("audio/")) return "clip";
  if (MESHES.test(file.name) || file.type.startsWith("model/")) return "mesh";
  return null;
}

/**
 * Sends a mesh and opens it.
 *
 * @param {Parts} parts
 * @param {File} file
 * @param {number} unit metres per unit of the file
 * @returns {Promise<void>}
 */
export async function openMesh({ connection, say }, file, unit) {
  try {
    say(`Sending ${file.name}.`);
    const mesh = await connection.upload("mesh", file.name, file);
    await connection.call("open_mesh", { mesh, unit });
  } catch (error) {
    say(/** @type {Error} */ (error).message, "error");
  }
}

/**
 * Sends a clip and gives it to a target: the one at a vertex, a new one there, or the selected one.
 *
 * @param {Parts} parts
 * @param {File} file
 * @param {number | null} vertex where it was dropped on the solid
 * @returns {Promise<void>}
 */
export async function takeClip(parts, file, vertex) {
  const { connection, selection, state, say } = parts;
  const there = state.current?.targets.find((target) => target.vertex === vertex);
  const target = vertex === null ? selection.current.target : (there?.name ?? null);
  if (target !== null) {
    await giveClip(parts, target, file.name, file);
  } else if (vertex === null) {
    say(`${file.name} needs a target: drop it on the solid, where it was struck.`, "error");
  } else {
    await attempt(parts, async () => {
      say(`Sending ${file.name}.`);
      const clip = await connection.upload("clip", file.name, file);
      await connection.call("add_target", { vertex, clip });
    });
  }
}

/**
 * Takes what is dropped on the page.
 *
 * @param {Parts} parts
 * @param {HTMLElement} solid where a clip becomes a target
 * @param {(x: number, y: number) => number | null} vertexAt which vertex is at pixels of the page
 * @param {(vertex: number | null) => void} hover told where a clip would become a target
 * @param {(file: File) => void} openFile opens a mesh
 */
export function acceptDrops(parts, solid, vertexAt, hover, openFile) {
  /** @param {DragEvent} event @returns {boolean} */
  const carriesFiles = (event) => event.dataTransfer?.types.includes("Files") ?? false;
  /** @param {DragEvent} event @returns {number | null} */
  const under = (event) =>
    event.target instanceof Node && solid.contains(event.target) ? vertexAt(event.clientX, event.clientY) : null;
  const end = () => {
    delete document.body.dataset.dropping;
    hover(null);
  };
  document.addEventListener("dragover", (event) => {
    if (!carriesFiles(event)) return;
    event.preventDefault();
    document.body.dataset.dropping = "";
    hover(under(event));
  });
  document.addEventListener("dragleave", (event) => {
    if (event.relatedTarget === null) end();
  });
  document.addEventListener("drop", async (event) => {
    if (!carriesFiles(event)) return;
    event.preventDefault(); // or the browser would leave the page for the file
    const vertex = under(event);
    end();
    const files = [...(event.dataTransfer?.files ?? [])];
    for (const file of files) {
      const kind = kindOf(file);
      if (kind === "mesh") openFile(file);
      else if (kind === "clip") await takeClip(parts, file, vertex);
      else parts.say(`${file.name}: expected a mesh (obj, stl, ply, ...) or a clip (wav, flac, ...).`, "error");
    }
  });
}
