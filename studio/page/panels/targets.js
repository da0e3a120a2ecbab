/** Targets: the points that are struck, their clips, and what one can hear of both. */

import { CLIP_ENDINGS } from "../solid/files.js";
import { ask, attempt, chosenTarget, clipOf, giveClip, mayReplaceClip, playClip, strikeTarget } from "./chosen.js";
import { button, find, keepList, make, setText, setValue } from "./dom.js";
import { fixed, withSeconds } from "./numbers.js";
import { makeRecording } from "./recording.js";

/** @typedef {import("../types.js").Target} Target */
/** @typedef {import("../types.js").Clip} Clip */
/** @typedef {import("./chosen.js").ClipPart} ClipPart */

/** @type {[ClipPart, string, string][]} */
const PARTS = [
  ["sound", "Clip", "The clip as it is"],
  ["modes", "Modes", "The modes of the clip alone"],
  ["rest", "Rest", "The clip less its modes"],
  ["noise", "Noise", "What is noise in the rest"],
];

/**
 * Makes the list of targets and the controls of the selected one.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 */
export function makeTargets(element, parts) {
  const { state, selection } = parts;
  const list = make("ul", { class: "target-list" });
  const none = make(
    "p",
    { class: "hint" },
    "No target yet. Strike a point of the solid and add it, or drop a clip onto the solid.",
  );
  const addHere = button("Add the point struck last", () => void addTarget(), { class: "main" });
  const addWhy = make("span", { class: "hint" });
  const about = makeDetails(parts);
  element.append(
    none,
    make("fieldset", { class: "plain" }, make("legend", { class: "hidden" }, "Selected target"), list),
    make("div", { class: "row" }, addHere, addWhy),
    about.element,
  );

  async function addTarget() {
    const { vertex } = selection.current;
    if (vertex !== null) await ask(parts, "add_target", { vertex });
  }

  /** @param {Target} target */
  function create(target) {
    const radio = make("input", {
      type: "radio",
      name: "target",
      value: target.name,
      onchange: () => selection.set({ target: target.name }),
    });
    return make(
      "li",
      {},
      make(
        "label",
        { class: "target" },
        radio,
        make("span", { class: "target-name" }, target.name),
        make("span", { class: "target-clip" }),
      ),
    );
  }

  /**
   * @param {HTMLElement} row
   * @param {Target} target
   */
  function update(row, target) {
    const clip = clipOf(state.current, target);
    const isChosen = selection.current.target === target.name;
    find(row, "input", HTMLInputElement).checked = isChosen;
    row.classList.toggle("chosen", isChosen);
    row.classList.toggle("failed", clip?.phase === "failed");
    setText(find(row, ".target-clip", HTMLElement), shortly(clip));
  }

  function show() {
    const targets = state.current?.targets ?? [];
    const isReady = (state.current?.solid?.surface ?? null) !== null;
    keepList(list, targets, (target) => target.name, create, update);
    none.hidden = targets.length > 0;
    addHere.disabled = !isReady || selection.current.vertex === null;
    setText(addWhy, !isReady ? "Open a solid first." : addHere.disabled ? "Strike a point first." : "");
    about.show();
  }

  state.onChange(show);
  selection.onChange(show);
}

/**
 * Controls of the selected target.
 *
 * @param {import("../main.js").Parts} parts
 */
function makeDetails(parts) {
  const { state, selection } = parts;
  const recording = makeRecording(parts);
  /** Listening to one must not be taken up by another one that is selected meanwhile. */
  const now = () => chosenTarget(parts);

  const name = make("input", { type: "text", id: "target-name", maxlength: 100, autocomplete: "off", onchange: rename });
  const clips = make("select", { id: "target-clip", onchange: choose });
  const file = make("input", {
    type: "file",
    class: "hidden",
    id: "target-file",
    accept: CLIP_ENDINGS.join(","),
    tabindex: -1,
    "aria-hidden": "true",
    onchange: upload,
  });
  const record = button("Record", () => {
    const target = now();
    if (target) void recording.start(target.name);
  }, { id: "record-clip" });
  const said = make("p", { class: "hint", id: "target-says", role: "status" });
  const bar = make("progress", { max: 1, "aria-labelledby": "target-says" });
  const stopSearch = button("Stop finding modes", () => askOfClip("stop_extraction"));
  const searchAgain = button("Find its modes", () => askOfClip("extract_again"));
  const extraction = make("div", { class: "row extraction" }, bar, stopSearch, searchAgain);
  const listen = PARTS.map(([part, text, title]) => button(text, () => void playClip(parts, now(), part), { title }));
  const struck = button("Solid", () => strikeTarget(parts, now()), { title: "The solid, struck there" });
  const stop = button("Stop", () => parts.player.stop(), { class: "quiet", title: "Stop the clip that plays" });
  stop.disabled = true;
  parts.player.onChange((playing) => {
    stop.disabled = playing === null;
  });
  const modes = make("input", {
    type: "text",
    inputmode: "numeric",
    size: 5,
    placeholder: "all",
    id: "target-modes",
    autocomplete: "off",
    onchange: takeModes,
  });
  const clipped = make("input", { type: "checkbox", id: "target-clipped", onchange: allowClipped });
  const move = button("Move to the point struck last", () => {
    const { vertex } = selection.current;
    const target = now();
    if (target && vertex !== null) void ask(parts, "change_target", { target: target.name, vertex });
  });
  const remove = button("Remove", () => {
    const target = now();
    if (target) void ask(parts, "remove_target", { target: target.name });
  });

  const element = make(
    "div",
    { class: "target-details", role: "group", "aria-label": "The selected target" },
    make("div", { class: "pair" }, make("label", { for: "target-name" }, "Name"), name),
    make(
      "div",
      { class: "pair" },
      make("label", { for: "target-clip" }, "Clip"),
      make("div", { class: "row" }, clips, button("File \u2026", () => file.click()), file, record),
    ),
    recording.element,
    said,
    extraction,
    make(
      "div",
      { class: "row tight", role: "group", "aria-label": "Listen" },
      make("span", { class: "row-label", "aria-hidden": "true" }, "Listen"),
      ...listen,
      struck,
      stop,
    ),
    make(
      "div",
      { class: "row" },
      make("label", { for: "target-modes" }, "Strongest modes taken"),
      modes,
      make("label", { class: "check" }, clipped, "The clip may be clipped"),
    ),
    make("div", { class: "row" }, move, remove),
  );

  /** @param {string} name of what is asked of the server for the clip of the selected target */
  function askOfClip(name) {
    const clip = clipOf(state.current, now());
    if (clip) void ask(parts, name, { clip: clip.clip });
  }

  async function rename() {
    const target = now();
    const wanted = name.value.trim();
    if (!target || wanted === target.name) return;
    if (wanted === "" || !(await ask(parts, "change_target", { target: target.name, name: wanted }))) {
      name.value = target.name;
    }
  }

  async function choose() {
    const target = now();
    const clip = state.current?.clips.find((one) => one.clip === clips.value);
    if (!target) return;
    if (clip && !(await mayReplaceClip(parts, target.name, clip.name))) show();
    else await ask(parts, "change_target", { target: target.name, clip: clip?.clip ?? null });
  }

  async function upload() {
    const target = now();
    const chosen = file.files?.[0];
    file.value = "";
    if (target && chosen) await giveClip(parts, target.name, chosen.name, chosen);
  }

  async function takeModes() {
    const target = now();
    const text = modes.value.trim();
    if (!target) return;
    const done = await attempt(parts, async () => {
      if (text !== "" && !/^[1-9]\d{0,4}$/.test(text)) {
        throw new Error(`Strongest modes taken: found ${text}, expected a whole number above 0, or nothing for all.`);
      }
      await parts.connection.call("change_target", { target: target.name, modes: text === "" ? null : Number(text) });
    });
    if (!done) modes.value = target.modes === null ? "" : String(target.modes);
  }

  function allowClipped() {
    const target = now();
    if (target) void ask(parts, "change_target", { target: target.name, allow_clipped: clipped.checked });
  }

  function show() {
    const target = now();
    const clip = clipOf(state.current, target);
    element.hidden = target === null;
    if (!target) return;
    setValue(name, target.name);
    setValue(modes, target.modes === null ? "" : String(target.modes));
    clipped.checked = target.allow_clipped;
    const choices = [{ clip: "", name: "none" }, ...(state.current?.clips ?? [])];
    keepList(clips, choices, (each) => each.clip, (each) => make("option", { value: each.clip }), (option, each) =>
      setText(option, each.name),
    );
    clips.value = target.clip ?? "";
    setText(said, sentence(clip));
    const isSought = clip?.phase === "listening";
    bar.hidden = stopSearch.hidden = !isSought;
    searchAgain.hidden = clip?.phase !== "stopped";
    extraction.hidden = !isSought && searchAgain.hidden;
    if (clip?.progress == null) bar.removeAttribute("value");
    else bar.value = clip.progress;
    listen.forEach((press, index) => {
      press.disabled = !clip || (index > 0 && clip.phase !== "ready");
    });
    struck.disabled = (state.current?.solid?.surface ?? null) === null;
    move.disabled = selection.current.vertex === null || selection.current.vertex === target.vertex;
  }

  return { element, show };
}

/**
 * What a line of the list says of a clip.
 *
 * @param {Clip | null} clip
 */
function shortly(clip) {
  if (!clip) return "no clip";
  const said = {
    waiting: "waits",
    listening: `finding modes${percent(clip)}`,
    ready: `${clip.modes.length} modes`,
    failed: "failed",
    stopped: "stopped",
  };
  return `${clip.name}, ${said[clip.phase]}`;
}

/** @param {Clip} clip @returns {string} share of what is done in its extraction; empty if it is not known */
function percent(clip) {
  return clip.progress === null ? "" : `, ${fixed(100 * clip.progress, 0)} %`;
}

/**
 * What is known of a clip, in a sentence.
 *
 * @param {Clip | null} clip
 */
function sentence(clip) {
  if (!clip) return "It has no clip: choose a file, record one, or drop one onto the solid.";
  if (clip.phase === "failed") return clip.message ?? "Its clip could not be read.";
  if (clip.phase === "waiting") return "Its clip waits until another one has been listened to.";
  if (clip.phase === "stopped") return `Its modes are not known: ${clip.message}.`;
  if (clip.phase === "listening") {
    return `Its modes are being found${clip.message ? `: ${clip.message}` : ""} \u2026`;
  }
  return `${withSeconds(clip.seconds)} at ${clip.rate_hz} Hz, ${clip.modes.length} modes found.`;
}
