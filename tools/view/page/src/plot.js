// Plots of the entries of one field of a topic, with names, units and newest values: live over the last seconds,
// or of a whole recording, with a cursor at the displayed position.

import uPlot from "uplot";
import { aligned, newestAt, timeAt } from "./cursor.js";
import { colour, onTheme } from "./theme.js";

const SECONDS = 10;
const REDRAW_MS = 100;
const HEIGHT = 200;
/** Height of the plot of a recording, which also uses the space of the parameters. */
const WHOLE_HEIGHT = 300;
const MOST = 8; // lines
const COLOURS = ["#3b82d6", "#f08a24", "#3fa35b", "#dc4b4b", "#9a6fd0", "#a0705a", "#dd77b4", "#22a9b8"];
/** Points of a line of a whole recording: more than the pixels of the plot. */
const POINTS = 1200;
/** Time after which missing curves are requested again, ms. */
const AGAIN_MS = 1000;

/** A number in about seven characters. */
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
  #offered = 0; // number of entries on offer
  #fields = "";
  #about = new Map(); // by topic: units and names of its fields
  #recording; // position and length of the displayed recording, s
  #whole; // content of the curves of the whole recording: topic, field, first entry
  #wholeAt = -Infinity; // time of the last request of curves

  constructor(connection, element, { topic, field, entries, legend, seek }) {
    this.connection = connection;
    this.element = element;
    this.topicSelect = topic;
    this.fieldSelect = field;
    this.entrySelect = entries;
    this.legend = legend;
    this.seek = seek;
    topic.addEventListener("change", () => this.show(topic.value));
    field.addEventListener("change", () => this.#begin(field.value));
    entries.addEventListener("change", () => this.#begin(this.#field, Number(entries.value)));
    this.take = (message, timestamp, fields) => this.#take(message, timestamp, fields);
    new ResizeObserver(() => this.chart?.setSize({ width: element.clientWidth, height: this.#height })).observe(element);
    onTheme(() => this.chart?.redraw());
  }

  get state() {
    return {
      topic: this.#topic,
      field: this.#field,
      points: this.#data[0].length,
      lines: this.#data.length - 1,
      names: [...this.legend.children].map((line) => line.dataset.name),
      newest: this.#data.slice(1).map((line) => line[this.#now()]),
      unit: this.#told(this.#field).unit,
      whole: this.#whole !== undefined,
      from: this.#data[0][0] ?? null,
      to: this.#data[0].at(-1) ?? null,
      cursor: this.#recording?.place ?? null,
    };
  }

  /** Offers these topics, of which `about` has units and names; shows `first` if none is shown yet. */
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

  /** Shows a whole recording of this length, s, with the cursor at this position. */
  cursor(place, length) {
    this.#recording = { place, length };
    if (this.#field !== undefined) this.#request();
    this.#drawCursor();
    this.#tell();
  }

  get #height() {
    return this.#whole ? WHOLE_HEIGHT : HEIGHT;
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
    this.#whole = undefined;
    this.#wholeAt = -Infinity;
    this.#end();
    if (this.#recording) this.#request();
  }

  #end() {
    this.chart?.destroy();
    this.chart = undefined;
    this.legend.replaceChildren();
  }

  /** Requests the curves of the whole recording unless they are shown or pending. */
  async #request() {
    const now = performance.now();
    if (this.#whole || now - this.#wholeAt < AGAIN_MS) return;
    this.#wholeAt = now;
    const asked = { topic: this.#topic, field: this.#field, first: this.#first, count: MOST, points: POINTS };
    try {
      const { entries, curves } = await this.connection.call("/motorium/curves", asked);
      const isAsked = this.#topic === asked.topic && this.#field === asked.field && this.#first === asked.first;
      if (!isAsked || this.#whole) return;
      this.#whole = asked;
      this.#offerEntries(entries);
      this.#data = aligned(curves);
      this.#end();
      if (curves.length) this.#chart(curves.length);
    } catch {
      // The connection is lost, or the field has no numbers: the plot stays empty.
    }
  }

  /** Offers the entries of a long array in groups that are drawn together. */
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
    const series = Array.from({ length: lines }, (_, line) => ({ label: name(line), stroke: COLOURS[line % COLOURS.length], width: 1.5, points: { show: false } }));
    const [stroke, grid] = [() => colour("--dim"), { stroke: () => colour("--grid"), width: 1 }];
    const label = unit ? `${this.#field}, ${unit}` : this.#field;
    const font = "11px system-ui, sans-serif";
    const whole = this.#whole !== undefined;
    const range = whole
      ? () => [0, Math.max(this.#recording.length, 1e-3)]
      : (_chart, from, to) => [from ?? 0, Math.max(to ?? 0, (from ?? 0) + 1)];
    this.chart = new uPlot(
      {
        width: this.element.clientWidth || 400,
        height: this.#height,
        legend: { show: false },
        cursor: whole ? { drag: { x: false, y: false } } : {},
        scales: { x: { time: false, range } },
        axes: [
          { stroke, grid, ticks: grid, font, size: 30, values: (_chart, ticks) => ticks.map((tick) => `${Number(tick.toFixed(2))} s`) },
          { stroke, grid, ticks: grid, font, size: 52, label, labelSize: 18, labelGap: 0, labelFont: font },
        ],
        series: [{}, ...series.map((one) => ({ ...one, spanGaps: whole }))],
        hooks: { setCursor: [() => this.#tell()], setSize: [() => this.#drawCursor()] },
      },
      this.#data,
      this.element,
    );
    if (whole) this.#addCursor();
    const shown = series.map(({ label, stroke }) => {
      const [line, mark, value] = ["div", "i", "b"].map((tag) => document.createElement(tag));
      line.dataset.name = label;
      mark.style.background = stroke;
      line.append(mark, `${label} `, value);
      return line;
    });
    this.legend.replaceChildren(...shown);
    this.#tell();
  }

  /** Adds the line at the displayed position; dragging it or the plot seeks another position. */
  #addCursor() {
    const { over } = this.chart;
    this.line = Object.assign(document.createElement("div"), { className: "cursor", title: "the time shown in 3D; drag to change it" });
    over.append(this.line);
    over.classList.add("seeks");
    const seek = ({ clientX }) => {
      const { left, width } = over.getBoundingClientRect();
      this.seek(timeAt(clientX - left, width, this.#recording.length));
    };
    over.addEventListener("pointerdown", (event) => {
      over.setPointerCapture(event.pointerId);
      seek(event);
    });
    over.addEventListener("pointermove", (event) => over.hasPointerCapture(event.pointerId) && seek(event));
    this.#drawCursor();
  }

  #drawCursor() {
    if (!this.#whole || !this.chart || !this.line) return;
    const { place, length } = this.#recording;
    this.line.style.left = `${length > 0 ? (100 * place) / length : 0}%`;
  }

  /** Index of the values shown next to the names while the pointer is off the plot. */
  #now() {
    return this.#whole ? newestAt(this.#data[0], this.#recording.place) : this.#data[0].length - 1;
  }

  /** Writes the values under the pointer into the legend, or else the current ones. */
  #tell() {
    const at = this.chart?.cursor.idx ?? this.#now();
    [...this.legend.children].forEach((line, index) => {
      const values = this.#data[index + 1];
      let from = at;
      // Lines of a recording have values at different times: use the latest one.
      while (this.#whole && from > 0 && values?.[from] == null) from -= 1;
      line.lastChild.textContent = short(values?.[from]);
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
    if (this.#whole) return;
    const field = fields.find(({ name }) => name === this.#field);
    if (!field) return;
    const all = [message[field.local]].flat();
    const values = all.slice(this.#first, this.#first + MOST).map(Number);
    const time = Number(timestamp) * 1e-9;
    // Time jumped back, as at a reset: restart the lines.
    if (time < (this.#data[0].at(-1) ?? Infinity) + (this.zero ?? 0)) {
      this.zero = time;
      this.#data = [[], ...this.#data.slice(1).map(() => [])];
    }
    this.#offerEntries(all.length);
    if (values.length > this.#data.length - 1 || !this.chart) {
      // New entries have no earlier line.
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
