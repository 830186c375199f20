// The playback bar of a recording: play and pause, position, speed.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];

export class Playback {
  #told;
  #held = false; // true while the user moves the slider
  #sought; // the position requested last, until the answer

  /** `moved` is called with the displayed position, s, and the length of the recording. */
  constructor(connection, bar, failed, moved) {
    this.moved = moved;
    this.connection = connection;
    this.bar = bar;
    this.failed = failed;
    [this.button, this.place, this.time, this.speed] = ["button", "input", "span", "select"].map((name) => bar.querySelector(name));
    this.speed.replaceChildren(...SPEEDS.map((speed) => new Option(`${speed} ×`, speed)));
    this.button.addEventListener("click", () => this.#ask({ plays: !this.#told?.plays }));
    this.speed.addEventListener("change", () => this.#ask({ speed: Number(this.speed.value) }));
    this.place.addEventListener("pointerdown", () => (this.#held = true));
    this.place.addEventListener("change", () => (this.#held = false));
    this.place.addEventListener("input", () => this.seek(Number(this.place.value)));
    connection.subscribe("/motorium/playback", (told) => this.#take(told));
  }

  get state() {
    return this.#told ?? null;
  }

  /** Toggles between play and pause. */
  toggle() {
    this.#ask({ plays: !this.#told?.plays });
  }

  /** Seeks a position, s; of requests in fast succession, only the last ones are sent. */
  async seek(place_s) {
    const busy = this.#sought !== undefined;
    this.#sought = place_s;
    if (busy) return;
    while (this.#sought !== undefined) {
      const sought = this.#sought;
      await this.#ask({ place_s: sought });
      if (this.#sought === sought) this.#sought = undefined;
    }
  }

  /** The bar is only shown for recordings. */
  show(is_recording) {
    this.bar.hidden = !is_recording;
  }

  async #ask(wish) {
    try {
      this.#take(await this.connection.call("/motorium/play", { plays: this.#told?.plays ?? true, ...wish }));
    } catch (error) {
      this.failed(error.message);
    }
  }

  #take(told) {
    this.#told = told;
    const { length_s: length, place_s: place, speed, plays } = told;
    this.button.textContent = plays ? "pause" : "play";
    this.place.max = length;
    this.place.step = Math.max(length / 1000, 0.001);
    if (!this.#held) this.place.value = place;
    this.time.textContent = `${place.toFixed(2)} / ${length.toFixed(2)} s`;
    this.speed.value = speed;
    this.moved(place, length);
  }
}
