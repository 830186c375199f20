// The pictures of cameras: the newest of each, painted when the page draws; depths as colours.

import { COLOURS } from "./turbo.js";

/** By encoding: bytes per pixel, and the indices of red, green and blue. */
const ENCODINGS = {
  rgb8: { bytes: 3, places: [0, 1, 2] },
  bgr8: { bytes: 3, places: [2, 1, 0] },
  mono8: { bytes: 1, places: [0, 0, 0] },
};
const DEPTH = "32FC1";
const NONE = [40, 40, 40]; // a pixel without a depth

/** The depths of a picture, row by row, m; 0 for no depth. */
function depthsOf({ width, height, step, data }) {
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const depths = new Float32Array(width * height);
  for (let y = 0; y < height; y += 1) {
    for (let x = 0; x < width; x += 1) depths[y * width + x] = view.getFloat32(y * step + 4 * x, true);
  }
  return depths;
}

/** Writes the bytes of a picture as pixels of a canvas. */
function paintBytes({ width, height, step, data }, { bytes, places: [red, green, blue] }, pixels) {
  for (let y = 0, to = 0; y < height; y += 1) {
    for (let x = 0, from = y * step; x < width; x += 1, from += bytes, to += 4) {
      pixels[to] = data[from + red];
      pixels[to + 1] = data[from + green];
      pixels[to + 2] = data[from + blue];
      pixels[to + 3] = 255;
    }
  }
}

/** Writes depths as pixels of a canvas; returns the smallest and the largest depth, m. */
function paintDepths(depths, pixels) {
  let [near, far] = [Infinity, 0];
  for (const depth of depths) {
    if (!isDepth(depth)) continue;
    near = Math.min(near, depth);
    far = Math.max(far, depth);
  }
  const scale = (COLOURS.length - 1) / (far - near || 1);
  depths.forEach((depth, index) => {
    const [red, green, blue] = isDepth(depth) ? COLOURS[Math.round((depth - near) * scale)] : NONE;
    pixels[4 * index] = red;
    pixels[4 * index + 1] = green;
    pixels[4 * index + 2] = blue;
    pixels[4 * index + 3] = 255;
  });
  return [near, far];
}

const isDepth = (depth) => depth > 0 && Number.isFinite(depth);

class Camera {
  #newest;
  #painted; // the message that is on the canvas
  #depths;
  #range = "";

  constructor(topic, connection, isOpen) {
    this.topic = topic;
    this.element = document.createElement("details");
    this.element.dataset.pictures = topic;
    this.element.open = isOpen;
    const name = document.createElement("summary");
    name.textContent = topic.replace(/\/image$/, "");
    this.canvas = document.createElement("canvas");
    this.canvas.width = this.canvas.height = 0;
    this.caption = document.createElement("p");
    this.caption.className = "dim";
    this.caption.textContent = "no image yet";
    this.element.append(name, this.canvas, this.caption);
    this.take = (message) => (this.#newest = message);
    // Hidden pictures are not subscribed.
    const listen = () => (this.element.open ? connection.subscribe : connection.unsubscribe).call(connection, topic, this.take);
    this.element.addEventListener("toggle", listen);
    if (isOpen) listen();
    this.canvas.addEventListener("pointermove", ({ offsetX, offsetY }) => {
      const scale = this.canvas.width / this.canvas.clientWidth;
      this.#point(Math.floor(offsetX * scale), Math.floor(offsetY * scale));
    });
    this.canvas.addEventListener("pointerleave", () => this.#point());
  }

  leave(connection) {
    connection.unsubscribe(this.topic, this.take);
    this.element.remove();
  }

  /** Paints the newest picture unless it is already on the page. */
  paint() {
    const picture = this.#newest;
    if (!picture || picture === this.#painted || !this.element.open) return;
    this.#painted = picture;
    const { width, height, step, encoding, data } = picture;
    const known = ENCODINGS[encoding];
    if (!known && encoding !== DEPTH) {
      this.caption.textContent = `cannot show images with the encoding ${encoding}`;
      return;
    }
    if (this.canvas.width !== width || this.canvas.height !== height) {
      [this.canvas.width, this.canvas.height] = [width, height];
    }
    const pixels = new ImageData(width, height);
    if (known) {
      paintBytes(picture, known, pixels.data);
      this.#range = "";
    } else {
      this.#depths = depthsOf(picture);
      const [near, far] = paintDepths(this.#depths, pixels.data);
      this.#range = far > 0 ? `, blue ${near.toFixed(3)} m to red ${far.toFixed(3)} m` : ", no depth";
    }
    this.canvas.getContext("2d").putImageData(pixels, 0, 0);
    this.#point();
  }

  /** A pixel of the displayed picture: its colours, or its depth in m. */
  pixel(x, y) {
    const { width, height, step, encoding, data } = this.#painted ?? { width: 0, height: 0 };
    if (x < 0 || y < 0 || x >= width || y >= height) return undefined;
    if (encoding === DEPTH) return [this.#depths[y * width + x]];
    const { bytes } = ENCODINGS[encoding] ?? { bytes: 0 };
    return [...data.slice(y * step + x * bytes, y * step + (x + 1) * bytes)];
  }

  get state() {
    const { width, height, encoding, timestamp } = this.#painted ?? {};
    const time = timestamp && [Number(timestamp.seconds), timestamp.nanos];
    return { topic: this.topic, shown: this.element.open, time, width, height, encoding, caption: this.caption.textContent };
  }

  #point(x = -1, y = -1) {
    const { width, height, encoding } = this.#painted ?? {};
    const value = this.pixel(x, y);
    const unit = encoding === DEPTH ? " m" : "";
    const pixel = value ? `; (${x}, ${y}): ${value.map((part) => Number(part.toFixed(4))).join(", ")}${unit}` : "";
    if (width) this.caption.textContent = `${width} × ${height}, ${encoding}${this.#range}${pixel}`;
  }
}

export class Pictures {
  #cameras = new Map(); // by topic

  constructor(connection, section) {
    this.connection = connection;
    this.section = section;
  }

  /** Offers the pictures of these topics, with the first one open. */
  offer(topics) {
    for (const [topic, camera] of this.#cameras) {
      if (topics.includes(topic)) continue;
      camera.leave(this.connection);
      this.#cameras.delete(topic);
    }
    for (const topic of topics) {
      if (this.#cameras.has(topic)) continue;
      const camera = new Camera(topic, this.connection, this.#cameras.size === 0);
      this.#cameras.set(topic, camera);
      this.section.append(camera.element);
    }
    this.section.hidden = topics.length === 0;
  }

  paint() {
    for (const camera of this.#cameras.values()) camera.paint();
  }

  pixel(topic, x, y) {
    return this.#cameras.get(topic)?.pixel(x, y);
  }

  get state() {
    return [...this.#cameras.values()].map(({ state }) => state);
  }
}
