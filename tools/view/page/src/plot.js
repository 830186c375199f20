// Live plots: the entries of one field of one topic over the last seconds, with their names, units and newest values.

import uPlot from "uplot";
import { colour, onTheme } from "./theme.js";

const SECONDS = 10;
const REDRAW_MS = 100;
const HEIGHT = 200;
const MOST = 8; // lines
const COLOURS = ["#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#17becf"];

/** A number in seven characters or so. */
function short(value) {
  if (value == null || Number.isNaN(value)) return "-";
  const size = Math.abs(value);
  return size !== 0 && (size < 1e-3 || size >= 1e5) ? value.toExponential(2) : value.toFixed(size < 100 ? 4 : 1);
}

export class Plot {
  #data = [[]];
  #drawn = 0;
  #topic;
  #field;
  #first = 0; // entry of the first line
  #offered = 0; // entries among which one can choose
  #fields = "";
  #about = new Map(); // by topic: units and names of its fields

  constructor(connection, element, { topic, field, entries, legend }) {
    this.connection = connection;
    this.element = element;
    this.topicSelect = topic;
    this.fieldSelect = field;
    this.entrySelect = entries;
    this.legend = legend;
    topic.addEventListener("change", () => this.show(topic.value));
    field.addEventListener("change", () => this.#begin(field.value));
    entries.addEventListener("change", () => this.#begin(this.#field, Number(entries.value)));
    this.take = (message, timestamp, fields) => this.#take(message, timestamp, fields);
    new ResizeObserver(() => this.chart?.setSize({ width: element.clientWidth, height: HEIGHT })).observe(element);
    onTheme(() => this.chart?.redraw());
  }

  get state() {
    return {
      topic: this.#topic,
      field: this.#field,
      points: this.#data[0].length,
      lines: this.#data.length - 1,
      names: [...this.legend.children].map((line) => line.dataset.name),
      newest: this.#data.slice(1).map((line) => line.at(-1)),
      unit: this.#told(this.#field).unit,
    };
  }

  /** Offers these topics, of which `about` tells units and names; shows `first` if none is shown yet. */
  offer(topics, about, first) {
    this.#about = new Map(about.map(({ name, fields }) => [name, fields]));
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
    this.#first = this.#offered = 0;
    this.connection.subscribe(topic, this.take);
  }

  /** Unit of a field, and names of its entries. */
  #told(field) {
    const fields = this.#about.get(this.#topic) ?? {};
    const { unit = "", entries = [] } = fields[field] ?? {};
    return { unit, entries: entries.length ? entries : (fields[""]?.entries ?? []) };
  }

  #begin(field, first = 0) {
    if (field !== this.#field) this.#offered = 0;
    [this.#field, this.#first] = [field, first];
    this.#data = [[]];
    this.#end();
  }

  #end() {
    this.chart?.destroy();
    this.chart = undefined;
    this.legend.replaceChildren();
  }

  /** Offers the entries of a long array by groups of as many as are drawn at a time. */
  #offerEntries(count) {
    if (count <= this.#offered) return;
    this.#offered = count;
    this.entrySelect.hidden = count <= MOST;
    if (count <= MOST) return this.entrySelect.replaceChildren();
    const { entries } = this.#told(this.#field);
    const name = (index) => entries[index] ?? `[${index}]`;
    const groups = Array.from({ length: Math.ceil(count / MOST) }, (_, group) => {
      const [from, to] = [group * MOST, Math.min((group + 1) * MOST, count) - 1];
      return new Option(from === to ? name(from) : `${name(from)} … ${name(to)}`, from);
    });
    this.entrySelect.replaceChildren(...groups);
    this.entrySelect.value = this.#first;
  }

  #chart(lines) {
    const { unit, entries } = this.#told(this.#field);
    const name = (line) => (lines === 1 && this.#first === 0 && !entries[0] ? this.#field : (entries[this.#first + line] ?? `[${this.#first + line}]`));
    const series = Array.from({ length: lines }, (_, line) => ({ label: name(line), stroke: COLOURS[line % COLOURS.length], width: 1.5 }));
    const [stroke, grid] = [() => colour("--text"), { stroke: () => colour("--grid"), width: 1 }];
    const label = unit ? `${this.#field}, ${unit}` : this.#field;
    this.chart = new uPlot(
      {
        width: this.element.clientWidth || 400,
        height: HEIGHT,
        legend: { show: false },
        scales: { x: { time: false, range: (_chart, from, to) => [from ?? 0, Math.max(to ?? 0, (from ?? 0) + 1)] } },
        axes: [
          { stroke, grid, ticks: grid, size: 30, values: (_chart, ticks) => ticks.map((tick) => `${Number(tick.toFixed(2))} s`) },
          { stroke, grid, ticks: grid, size: 52, label, labelSize: 18, labelGap: 0, labelFont: "12px system-ui, sans-serif" },
        ],
        series: [{}, ...series],
        hooks: { setCursor: [() => this.#tell()] },
      },
      this.#data,
      this.element,
    );
    const shown = series.map(({ label, stroke }) => {
      const [line, mark, value] = ["div", "i", "b"].map((tag) => document.createElement(tag));
      line.dataset.name = label;
      mark.style.background = stroke;
      line.append(mark, `${label} `, value);
      return line;
    });
    this.legend.replaceChildren(...shown);
  }

  /** Writes the values under the pointer into the legend, else the newest. */
  #tell() {
    const at = this.chart?.cursor.idx ?? this.#data[0].length - 1;
    [...this.legend.children].forEach((line, index) => {
      line.lastChild.textContent = short(this.#data[index + 1]?.[at]);
    });
  }

  #take(message, timestamp, fields) {
    const names = fields.map(({ name }) => name).join();
    if (names !== this.#fields) {
      this.#fields = names;
      this.fieldSelect.replaceChildren(...fields.map(({ name }) => new Option(name, name)));
      const is = (name) => fields.some((field) => field.name === name);
      const first = fields.find(({ isList }) => isList) ?? fields[0];
      const kept = [this.#field, "position"].find((name) => name && is(name)) ?? first?.name;
      this.fieldSelect.value = kept;
      this.#begin(kept);
    }
    const field = fields.find(({ name }) => name === this.#field);
    if (!field) return;
    const all = [message[field.local]].flat();
    const values = all.slice(this.#first, this.#first + MOST).map(Number);
    const time = Number(timestamp) * 1e-9;
    // Time that goes back, as at a reset: the lines begin anew.
    if (time < (this.#data[0].at(-1) ?? Infinity) + (this.zero ?? 0)) {
      this.zero = time;
      this.#data = [[], ...this.#data.slice(1).map(() => [])];
    }
    this.#offerEntries(all.length);
    if (values.length > this.#data.length - 1 || !this.chart) {
      // Entries that were not there before have no line there.
      const none = () => this.#data[0].map(() => null);
      this.#data.push(...values.slice(this.#data.length - 1).map(none));
      this.#end();
      this.#chart(this.#data.length - 1);
    }
    this.#data[0].push(time - this.zero);
    this.#data.slice(1).forEach((line, index) => line.push(values[index] ?? null));
    const oldest = time - this.zero - SECONDS;
    while (this.#data[0][0] < oldest) for (const line of this.#data) line.shift();
    const now = performance.now();
    if (now - this.#drawn > REDRAW_MS) {
      this.#drawn = now;
      this.chart.setData(this.#data);
      this.#tell();
    }
  }
}
