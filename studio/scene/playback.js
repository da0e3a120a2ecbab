/** How far the scene is: what is seen follows what is heard. */

/** @typedef {import("./sound.js").SceneSound} SceneSound */

/** What is drawn now is seen so much later, when the screen shows its next picture. */
export const SCREEN_SECONDS = 1 / 60;
/** Beyond that, the sound's time has jumped: what is seen would be another picture's. */
const JUMP_SECONDS = SCREEN_SECONDS;
/** Of what the sound's time is off, how much is made good with each picture. */
const CORRECTION = 0.1;

/** Lets time pass evenly, where the sound's own comes in pieces of some milliseconds. */
export class Clock {
  constructor() {
    this.restart();
  }

  /** Takes the next time as it is told. */
  restart() {
    /** @type {{seconds: number, now: number} | null} */
    this.last = null;
  }

  /**
   * @param {number} told [s]
   * @param {number} now When it was, by a clock that runs evenly [s]
   * @returns {number} [s]
   */
  follow(told, now) {
    const expected = this.last ? this.last.seconds + now - this.last.now : told;
    const off = told - expected;
    const seconds =
      Math.abs(off) > JUMP_SECONDS
        ? told
        : Math.max(this.last?.seconds ?? told, expected + CORRECTION * off);
    this.last = { seconds, now };
    return seconds;
  }
}

export class Playback {
  /**
   * @param {SceneSound} sound
   * @param {number} seconds How long the scene takes.
   */
  constructor(sound, seconds) {
    this.sound = sound;
    this.seconds = seconds;
    /** Second of the scene that is seen. */
    this.at = 0;
    /** Whether it plays, or is going to as soon as the browser lets it. */
    this.wanted = false;
    /** Whether it plays. */
    this.runs = false;
    /** Whether it is kept still for a while, as the timeline is held. */
    this.held = false;
    this.loop = false;
    this.clock = new Clock();
    /** What was seen and what was heard when something was drawn last [s]. */
    this.drawn = { seconds: 0, heard: 0 };
    /** @type {(() => void)[]} */
    this.listeners = [];
  }

  /** @param {() => void} listener Called when it begins, ends, or is somewhere else. */
  onChange(listener) {
    this.listeners.push(listener);
  }

  #tell() {
    for (const listener of this.listeners) listener();
  }

  /** Plays on, from the beginning if it is at the end. */
  async play() {
    if (this.wanted) return;
    this.wanted = true;
    if (this.at >= this.seconds) this.at = 0;
    this.#tell();
    await this.sound.allowed();
    if (this.wanted && !this.runs && !this.held) this.#begin();
  }

  #begin() {
    this.runs = true;
    this.clock.restart();
    this.sound.play(this.at);
    this.#tell();
  }

  pause() {
    this.wanted = false;
    this.runs = false;
    this.sound.stop();
    this.#tell();
  }

  toggle() {
    if (this.wanted) this.pause();
    else this.play();
  }

  /** @param {number} seconds Where it goes on, or stays if it is not playing. */
  seek(seconds) {
    this.at = Math.min(this.seconds, Math.max(0, seconds));
    if (this.runs) this.#begin();
    else this.#tell();
  }

  /** Stays still and silent until `letGo`, wherever it is sought. */
  hold() {
    if (this.held) return;
    this.held = true;
    this.runs = false;
    this.sound.stop();
  }

  letGo() {
    if (!this.held) return;
    this.held = false;
    if (this.wanted) this.#begin();
  }

  /**
   * Called for each picture.
   *
   * @returns {number} Second of the scene that it shows.
   */
  frame() {
    if (!this.runs) return this.at;
    const { heard } = this.sound;
    if (heard < this.sound.from) return this.at;
    // The sound's time goes on beyond the scene's end, where nothing more is heard of it.
    const told = Math.min(this.seconds, heard + SCREEN_SECONDS);
    this.at = Math.min(this.seconds, this.clock.follow(told, performance.now() / 1000));
    this.drawn = { seconds: this.at, heard: told };
    if (this.at >= this.seconds) this.#end();
    return this.at;
  }

  #end() {
    if (this.loop) this.seek(0);
    else this.pause();
  }
}
