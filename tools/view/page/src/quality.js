// The quality of the picture: as high as the measured frame rate allows.

/** Levels from the cheapest to the best: maximum pixel ratio, contact shadows, size of the shadow map. */
export const LEVELS = [
  { name: "reduced", ratio: 0.75, contact: false, shadow: 0 },
  { name: "plain", ratio: 1, contact: false, shadow: 0 },
  { name: "contact", ratio: 1, contact: true, shadow: 0 },
  { name: "shadows", ratio: 1.5, contact: true, shadow: 1024 },
  { name: "full", ratio: 2, contact: true, shadow: 2048 },
];

/** Frame rates below which the level falls, and above which a better one is tried, Hz. */
export const SLOW = 12;
export const FAST = 45;
/** Window of the frame rate, ms. */
export const WINDOW_MS = 1000;
/** Time of fast frames before a better level is tried, ms; doubled each time that the level did not last. */
const PATIENCE_MS = 3000;
const MOST_PATIENCE_MS = 300_000;
/** Minimum time for which a level must last, ms. */
const LASTING_MS = 15_000;
/** Pause between two frames above which the page was hidden, ms; it is not measured. */
const PAUSE_MS = 2000;

export class Quality {
  #level;
  #frames = 0;
  #since; // start of the window
  #last; // previous frame
  #fastSince;
  #patience = PATIENCE_MS;
  #raised = -Infinity;
  /** Frames per second of the last window; undefined before its end. */
  rate;

  constructor(level) {
    this.#level = level;
  }

  get level() {
    return this.#level;
  }

  /** Counts a frame at a time, ms. Returns true if the level has changed. */
  frame(now) {
    if (this.#last === undefined || now - this.#last > PAUSE_MS) {
      this.#begin(now);
      this.#fastSince = undefined;
    }
    this.#last = now;
    if (this.#since === now) return false;
    this.#frames += 1;
    const length = now - this.#since;
    if (length < WINDOW_MS) return false;
    this.rate = (1000 * this.#frames) / length;
    const began = this.#since;
    this.#begin(now);
    return this.#decide(began, now);
  }

  #begin(now) {
    this.#since = now;
    this.#frames = 0;
  }

  #decide(began, now) {
    if (this.rate < FAST) this.#fastSince = undefined;
    else this.#fastSince ??= began;
    if (this.rate < SLOW && this.#level > 0) {
      if (now - this.#raised < LASTING_MS) this.#patience = Math.min(2 * this.#patience, MOST_PATIENCE_MS);
      this.#level -= 1;
      return true;
    }
    const isBest = this.#level === LEVELS.length - 1;
    if (isBest || this.#fastSince === undefined || now - this.#fastSince < this.#patience) return false;
    this.#level += 1;
    this.#raised = now;
    this.#fastSince = undefined;
    return true;
  }
}
