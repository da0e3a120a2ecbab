/** The design as a whole: the search, the fine solid, saving and opening, exports. */

import { ask } from "./chosen.js";
import { button, keepList, make, setText, setValue } from "./dom.js";
import { makeExports } from "./exports.js";
import { withSeconds } from "./numbers.js";

/** @typedef {import("../types.js").State} State */

/** Phases of clips that a search leaves out. */
const UNUSABLE = ["failed", "stopped"];
const NAMES = /^[A-Za-z0-9_-]{1,64}$/;

/**
 * Makes the panel of the design.
 *
 * @param {HTMLElement} element
 * @param {import("../main.js").Parts} parts
 */
export function makeProject(element, parts) {
  const { connection, state } = parts;
  /** @type {number | null} */
  let seconds = null;
  let found = "";

  const search = button("Optimise", () => void ask(parts, isSearching(state.current) ? "stop" : "optimise"), {
    class: "main wide",
    id: "optimise",
    "aria-describedby": "search-state",
  });
  const searchState = make("p", { class: "hint", id: "search-state" });
  const forget = button("Forget the material", () => void ask(parts, "forget_material"), {
    title: "Begin anew from the uniform material; undo brings it back",
  });

  const fine = make("input", { type: "checkbox", onchange: () => void ask(parts, "fine", { on: fine.checked }) });
  const fineState = make("p", { class: "hint", role: "status" });

  const name = make("input", {
    type: "text",
    id: "project-name-input",
    maxlength: 64,
    autocomplete: "off",
    spellcheck: "false",
    "aria-describedby": "project-name-help",
    oninput: () => showName(),
  });
  const nameHelp = make("p", { class: "hint", id: "project-name-help" });
  const save = make("form", { class: "row", onsubmit: saveAs }, name, make("button", {}, "Save as"));

  const choices = make("select", { id: "project-choice" });
  const open = make(
    "form",
    { class: "row", onsubmit: openChoice },
    choices,
    make("button", {}, "Open"),
  );

  element.append(
    search,
    searchState,
    make("label", { class: "check" }, fine, "Fine solid: as it is, not coarsened"),
    fineState,
    make(
      "details",
      { class: "more" },
      make("summary", {}, "Save, open, export"),
      make("div", { class: "pair" }, make("label", { for: "project-name-input" }, "Name"), save),
      nameHelp,
      make("div", { class: "pair" }, make("label", { for: "project-choice" }, "Project"), open),
      make("h3", {}, "Export"),
      makeExports(parts),
      make("div", { class: "row" }, forget),
    ),
  );

  /** @param {Event} event */
  async function saveAs(event) {
    event.preventDefault();
    const wanted = name.value.trim();
    if (!NAMES.test(wanted)) {
      name.setAttribute("aria-invalid", "true");
      showName();
      name.focus();
      return;
    }
    name.removeAttribute("aria-invalid");
    if (await ask(parts, "save", { name: wanted })) parts.say(`Saved as ${wanted}.`);
  }

  /** @param {Event} event */
  async function openChoice(event) {
    event.preventDefault();
    if (choices.value) await ask(parts, "open_project", { project: choices.value });
  }

  function showName() {
    const isWrong = name.hasAttribute("aria-invalid") && !NAMES.test(name.value.trim());
    if (!isWrong) name.removeAttribute("aria-invalid");
    const where = state.current ? ` in the workspace ${state.current.workspace}` : "";
    const rule = "Letters, digits, - and _.";
    nameHelp.classList.toggle("field-error", isWrong);
    setText(
      nameHelp,
      isWrong
        ? `Name: found ${name.value.trim() || "nothing"}, expected up to 64 letters, digits, - and _.`
        : `${rule} Its .yaml and .h5 are written${where}.`,
    );
  }

  /** @param {State} now */
  function showChoices(now) {
    const groups = [
      { label: "Projects here", entries: now.projects },
      { label: "Examples", entries: now.examples },
    ].filter((group) => group.entries.length > 0);
    keepList(
      choices,
      groups,
      (group) => group.label,
      (group) => make("optgroup", { label: group.label }),
      (element, group) => {
        keepList(
          element,
          group.entries,
          (entry) => entry.project,
          (entry) => make("option", { value: entry.project }),
          (option, entry) => setText(option, entry.name),
        );
      },
    );
    choices.disabled = groups.length === 0;
  }

  /** @param {State} now */
  function showSearch(now) {
    const why = whyNot(now);
    const { phase, message } = now.search;
    setText(search, { idle: "Optimise", starting: "Stop", running: "Stop" }[phase]);
    search.classList.toggle("running", phase !== "idle");
    search.disabled = phase === "idle" && why !== "";
    const time = seconds === null ? "" : ` for ${withSeconds(seconds)}`;
    const said = {
      idle: message ?? (why || [found, noteOn(now)].filter(Boolean).join(" ")),
      starting: message ?? "The search is being prepared \u2026",
      running: message ?? `The material is being sought${time}.`,
    };
    setText(searchState, said[phase]);
    searchState.hidden = said[phase] === "";
  }

  state.onChange((now, before) => {
    if (now.search.phase === "starting") seconds = null;
    showSearch(now);
    showChoices(now);
    if (!before || now.name !== before.name) setValue(name, now.name);
    showName();
    fine.checked = now.fine.on;
    fine.disabled = now.solid?.phase !== "ready" && !now.fine.on;
    const saidOfFine = { none: "", working: "It is being computed \u2026", ready: "" }[now.fine.phase];
    setText(fineState, now.fine.message ?? saidOfFine);
    fineState.hidden = fineState.textContent === "";
    forget.disabled = now.solid === null;
  });
  connection.onBinary("bank", (header) => {
    const words = String(header.verdict ?? "").split(":")[0];
    found = words ? `The design sounds ${words}; Cost says why.` : "";
    if (state.current) showSearch(state.current);
  });
  connection.onEvent("progress", (event) => {
    const before = seconds === null ? null : Math.round(seconds);
    seconds = event.seconds;
    if (state.current && before !== Math.round(event.seconds)) showSearch(state.current);
  });
}

/** @param {State | null} state */
function isSearching(state) {
  return state !== null && state.search.phase !== "idle";
}

/**
 * Why nothing can be sought yet; empty if it can. What is still being prepared is waited for.
 *
 * @param {State} state
 */
function whyNot(state) {
  if (!state.solid) return "Open a solid first.";
  if (state.solid.phase === "failed") return state.solid.message ?? "The solid could not be prepared.";
  if (state.targets.length === 0) return "Add a target first: a point and the clip that it shall sound like.";
  if (usedTargets(state).length > 0) return "";
  const failed = state.clips.find((clip) => UNUSABLE.includes(clip.phase));
  if (failed) return `${failed.name} cannot be used: choose another clip.`;
  return `Give ${state.targets[0]?.name ?? "the target"} a clip first.`;
}

/**
 * What a search has to wait for, or leaves out; empty if nothing.
 *
 * @param {State} state
 */
function noteOn(state) {
  if (state.solid?.phase !== "ready") return "The solid is being prepared \u2026";
  const used = usedTargets(state);
  const idle = state.targets.filter((target) => !used.includes(target)).map((target) => target.name);
  if (idle.length === 0) return "";
  return `Without a clip that can be used, ${idle.join(" and ")} ${idle.length > 1 ? "do" : "does"} not count.`;
}

/**
 * Targets with a clip that did not fail.
 *
 * @param {State} state
 */
function usedTargets(state) {
  const good = state.clips.filter((clip) => !UNUSABLE.includes(clip.phase)).map((clip) => clip.clip);
  return state.targets.filter((target) => target.clip !== null && good.includes(target.clip));
}
