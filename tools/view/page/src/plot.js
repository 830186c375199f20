// Live plots: the entries of one field of one topic over the last seconds.

import uPlot from "uplot";

const SECONDS = 10;
const REDRAW_MS = 100;
const MOST = 8; // lines
const COLOURS = ["#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#17becf"];

/** The fields of a message that hold numbers, and how many. */
function numbersOf(message) {
  const fields = [];
  for (const [name, value] of Object.entries(message)) {
    if (name.startsWith("$") || name === "stamp") continue;
    if (typeof value === "number" || typeof value === "bigint") fields.push({ name, count: 1 });
    else if (Array.isArray(value) && typeof value[0] === "number") fields.push({ name, count: value.length });
  }
  return fields;
}

export class Plot {
  #data = [[]];
  #drawn = 0;
  #topic;
  #field;
  #fields = "";
  #wanted; // a topic to begin with

  constructor(connection, element, topicSelect, fieldSelect) {
    this.connection = connection;
    this.element = element;
    this.topicSelect = topicSelect;
    this.fieldSelect = fieldSelect;
    topicSelect.addEventListener("change", () => this.show(topicSelect.value));
    fieldSelect.addEventListener("change", () => this.#begin(fieldSelect.value));
    this.take = (message, timestamp) => this.#take(message, timestamp);
    new ResizeObserver(() => this.chart?.setSize({ width: element.clientWidth, height: 190 })).observe(element);
  }

  get state() {
    return { topic: this.#topic, field: this.#field, points: this.#data[0].length, lines: this.#data.length - 1 };
  }

  /** Offers these topics; shows `first` if none is shown yet. */
  offer(topics, first) {
    this.topicSelect.replaceChildren(...topics.map((topic) => new Option(topic, topic)));
    const shown = topics.includes(this.#topic) ? this.#topic : (first ?? topics[0]);
    if (shown !== undefined) this.show(shown, true);
  }

  show(topic, again = false) {
    this.topicSelect.value = topic;
    if (topic === this.#topic && again) return;
    if (this.#topic !== undefined) this.connection.unsubscribe(this.#topic, this.take);
    this.#topic = topic;
    this.#fields = "";
    this.#field = undefined;
    this.connection.subscribe(topic, this.take);
  }

  #begin(field) {
    this.#field = field;
    this.#data = [[]];
    this.chart?.destroy();
    this.chart = undefined;
  }

  #chart(lines) {
    const series = Array.from({ length: lines }, (_, index) => ({
      label: lines > 1 ? `[${index}]` : this.#field,
      stroke: COLOURS[index % COLOURS.length],
      width: 1.5,
      value: (_chart, value) => (value == null ? "-" : value.toFixed(4)),
    }));
    const grid = { stroke: "#eceff2" };
    this.chart = new uPlot(
      {
        width: this.element.clientWidth || 400,
        height: 190,
        legend: { show: true, live: true },
        scales: { x: { time: false } },
        axes: [{ grid, values: (_chart, ticks) => ticks.map((tick) => `${Number(tick.toFixed(2))} s`) }, { grid, size: 56 }],
        series: [{ label: "time", value: (_chart, value) => (value == null ? "-" : `${value.toFixed(2)} s`) }, ...series],
      },
      this.#data,
      this.element,
    );
  }

  #take(message, timestamp) {
    const fields = numbersOf(message);
    const names = fields.map(({ name }) => name).join();
    if (names !== this.#fields) {
      this.#fields = names;
      this.fieldSelect.replaceChildren(...fields.map(({ name }) => new Option(name, name)));
      const known = (name) => fields.some((field) => field.name === name);
      const first = fields.find(({ count }) => count > 1) ?? fields[0];
      const kept = [this.#field, "position"].find((name) => name && known(name)) ?? first?.name;
      this.fieldSelect.value = kept;
      this.#begin(kept);
    }
    if (this.#field === undefined) return;
    const values = [message[this.#field]].flat().slice(0, MOST).map(Number);
    const time = Number(timestamp) * 1e-9;
    const [times] = this.#data;
    // Another number of entries, or time that goes back as at a reset: the lines begin anew.
    if (values.length !== this.#data.length - 1 || time < (times.at(-1) ?? 0) + (this.zero ?? 0)) {
      this.zero = time;
      this.#data = [[], ...values.map(() => [])];
      this.chart?.destroy();
      this.#chart(values.length);
    }
    this.#data[0].push(time - this.zero);
    values.forEach((value, index) => this.#data[index + 1].push(value));
    const oldest = time - this.zero - SECONDS;
    while (this.#data[0][0] < oldest) for (const line of this.#data) line.shift();
    const now = performance.now();
    if (now - this.#drawn > REDRAW_MS) {
      this.#drawn = now;
      this.chart.setData(this.#data);
    }
  }
}
