// The timeline of the graph: predicted by the plan, and measured in the run, below each other.

const SVG = "http://www.w3.org/2000/svg";
const LEFT = 130; // of the bars, for the names
const LANE = 24;
const TOP = 18; // for the legend
const BELOW = 18; // for the axis
const LONGEST_NS = 10e6;

const micro = (ns) => `${(ns / 1000).toFixed(ns < 100000 ? 1 : 0)} µs`;
const onAxis = (ns) => (ns === 0 ? "0" : ns >= 1e6 ? `${ns / 1e6} ms` : `${ns / 1e3} µs`);

/** Distance of the marks of an axis: four to ten of them. */
function grain(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return [power / 5, power / 2, power].find((step) => length / step <= 10) ?? power;
}

function add(parent, name, attributes, text) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  parent.append(element);
  return element;
}

export class Timeline {
  #lanes = [];
  #measured = new Map(); // by component: the steps of the last interval, ns from the start
  #length = 0;

  constructor(element) {
    this.element = element;
    new ResizeObserver(() => this.#draw()).observe(element);
  }

  get state() {
    const lanes = this.#lanes.map(({ component, core, segments }) => ({
      component,
      core,
      predicted: segments.map(({ start_ns, end_ns, activity }) => [start_ns, end_ns, activity]),
      measured: this.#measured.get(component) ?? [],
    }));
    return { length_ns: this.#length, lanes };
  }

  /** Applies the graph: the first 10 ms of its predicted timeline. A lockstep graph has none. */
  plan({ timeline, components, topics }) {
    const writers = new Map(topics.map(({ name, writer }) => [name, writer]));
    this.triggers = new Map(components.map(({ name, trigger }) => [name, writers.get(trigger)]));
    this.#measured.clear();
    this.#length = Math.min(timeline?.length_ns ?? 0, LONGEST_NS);
    const shown = ({ start_ns: start }) => start < this.#length;
    this.#lanes = (timeline?.cores ?? []).flatMap(({ core, lanes }) =>
      lanes.map(({ component, releases_ns: releases, segments }) => ({
        component,
        core,
        releases: releases.filter((release) => release < this.#length),
        segments: segments.filter(shown),
      })),
    );
    this.#draw();
  }

  /** Applies the times of the run: start and length of each step are medians of the last interval. */
  take({ components }) {
    const times = new Map(components.map(({ name, interval }) => [name, interval]));
    const lanes = new Map(this.#lanes.map((lane) => [lane.component, lane]));
    this.#measured.clear();
    for (const { component } of this.#lanes) this.#steps(component, lanes, times, new Set());
    this.#draw();
  }

  /** Steps of a component as measured: after its releases, or after the steps of the component that wakes it. */
  #steps(component, lanes, times, above) {
    if (this.#measured.has(component)) return this.#measured.get(component);
    const [lane, interval] = [lanes.get(component), times.get(component)];
    if (!lane || !interval?.steps || above.has(component)) return [];
    const { releases } = lane;
    const writer = this.triggers.get(component);
    const woken = writer ? this.#steps(writer, lanes, times, new Set([...above, component])) : [];
    const begins = woken.length
      ? releases.map((_, index) => woken[Math.floor((index * woken.length) / releases.length)][1])
      : releases;
    const { lateness_ns: late, execution_ns: execution } = interval;
    const steps = begins.map((begin) => {
      const start = begin + late.p50;
      return [start, start + execution.p50, begin + late.p99 + execution.p99];
    });
    this.#measured.set(component, steps);
    return steps;
  }

  #draw() {
    const width = this.element.clientWidth;
    this.element.replaceChildren();
    if (!this.#lanes.length || width < 2 * LEFT) return;
    const height = TOP + LANE * this.#lanes.length + BELOW;
    const svg = add(this.element, "svg", { width, height, role: "img", "aria-label": "timeline" });
    const x = (ns) => LEFT + ((width - LEFT - 30) * ns) / this.#length;
    add(svg, "rect", { class: "predicted", x: LEFT, y: 4, width: 14, height: 8 });
    add(svg, "text", { x: LEFT + 20, y: 12 }, "predicted, if each step uses its whole budget");
    add(svg, "rect", { class: "measured", x: LEFT + 310, y: 4, width: 14, height: 8 });
    add(svg, "text", { x: LEFT + 330, y: 12 }, "measured: median of the last interval (thin bar: p99)");
    const [step, bottom] = [grain(this.#length), height - BELOW];
    for (let mark = 0; mark <= this.#length; mark += step) {
      add(svg, "line", { x1: x(mark), x2: x(mark), y1: TOP, y2: bottom });
      add(svg, "text", { x: x(mark), y: height - 4, "text-anchor": "middle" }, onAxis(mark));
    }
    this.#lanes.forEach((lane, index) => this.#lane(svg, lane, TOP + LANE * index, x));
  }

  #lane(svg, { component, core, segments }, y, x) {
    const group = add(svg, "g", {});
    const measured = this.#measured.get(component) ?? [];
    const ends = segments.filter(({ activity }) => activity === "step").map(({ end_ns: end }) => end);
    const words = [`${component} on core ${core}`];
    if (ends.length) words.push(`predicted: ends by ${micro(ends[0])}`);
    if (measured.length) words.push(`measured: ends by ${micro(measured[0][1])}, p99 ${micro(measured[0][2])}`);
    add(group, "title", {}, words.join("\n"));
    add(group, "text", { x: LEFT - 8, y: y + 15, "text-anchor": "end" }, component);
    const bar = (name, top, high, from, to) =>
      add(group, "rect", { class: name, x: x(from), y: top, width: Math.max(x(to) - x(from), 1), height: high });
    for (const { start_ns: from, end_ns: to, activity } of segments) {
      bar(activity === "step" ? "predicted" : "spin", y + 4, 8, from, to);
    }
    for (const [from, to, tail] of measured) {
      bar("tail", y + 15.5, 1, from, Math.min(tail, this.#length));
      bar("measured", y + 12, 8, from, to);
    }
  }
}
