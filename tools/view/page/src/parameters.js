// Parameters: a slider for a bounded number, a field for an unbounded one, a list for a choice, a check box for
// a boolean.

import { isLogarithmic, readable, scaleOf } from "./sliders.js";

const STEPS = 1000;

function element(tag, properties) {
  return Object.assign(document.createElement(tag), properties);
}

/** The inputs of one parameter: `show` displays a value; `changed` is called with the user's values. */
function inputs(parameter, changed) {
  const { default: initial, min, max, choices = [] } = parameter;
  if (typeof initial === "boolean") {
    const box = element("input", { type: "checkbox", className: "wide box" });
    box.addEventListener("change", () => changed(box.checked));
    return { elements: [box], show: (value) => (box.checked = value) };
  }
  if (typeof initial === "string") {
    const list = element("select", { className: "wide" });
    list.append(...choices.map((choice) => new Option(choice, choice)));
    list.addEventListener("change", () => changed(list.value));
    return { elements: [list], show: (value) => (list.value = value) };
  }
  if (Array.isArray(initial)) {
    const field = element("input", { type: "text", className: "wide", title: "numbers, separated by commas" });
    field.addEventListener("change", () => {
      const numbers = field.value.split(",").map(Number);
      changed(numbers, "float64_array");
    });
    return { elements: [field], show: (value) => (field.value = value.join(", ")) };
  }
  // A whole number in JSON may be a float without a fraction: the server knows the type.
  const field = element("input", { type: "number", min: min ?? "", max: max ?? "", step: "any" });
  field.addEventListener("change", () => field.value !== "" && changed(Number(field.value)));
  const exact = (value) => (field.value = Number(value.toPrecision(12)));
  if (min == null || max == null) {
    return { elements: [element("span", {}), field], show: exact };
  }
  const { valueAt, positionOf } = scaleOf(parameter);
  const title = isLogarithmic(parameter) ? `${min} to ${max}, logarithmic` : `${min} to ${max}`;
  const slider = element("input", { type: "range", min: 0, max: 1, step: 1 / STEPS, title });
  slider.addEventListener("input", () => {
    const value = valueAt(Number(slider.value));
    exact(value);
    changed(value);
  });
  const show = (value) => {
    slider.value = positionOf(value);
    exact(value);
  };
  return { elements: [slider, field], show };
}

export class Parameters {
  #shown = new Map(); // by name: the function that shows a value
  values = {};

  constructor(connection, place) {
    this.connection = connection;
    this.place = place;
    connection.addEventListener("parameters", ({ detail }) => this.take(detail));
  }

  /** Creates the inputs for the parameters of a graph. */
  plan({ components }) {
    this.#shown.clear();
    this.place.replaceChildren();
    this.place.closest("details").hidden = components.every(({ parameters }) => parameters.length === 0);
    for (const component of components) {
      if (component.parameters.length) this.place.append(element("h3", { textContent: readable(component.name) }));
      for (const parameter of component.parameters) {
        const name = `${component.name}.${parameter.name}`;
        const { elements, show } = inputs(parameter, (value, type) => this.#set(name, value, type));
        const line = element("div", { className: "parameter", title: `${name}: ${parameter.doc}` });
        line.dataset.parameter = name;
        const label = element("label", { textContent: readable(parameter.name) });
        if (parameter.unit) label.append(element("span", { className: "unit", textContent: `, ${parameter.unit}` }));
        line.append(label, ...elements);
        this.place.append(line);
        this.#shown.set(name, show);
        show(parameter.default);
      }
    }
    this.connection.getParameters();
  }

  take(parameters) {
    for (const { name, value } of parameters) {
      this.values[name] = value;
      // An input in use is not changed.
      const line = document.activeElement?.closest?.("[data-parameter]");
      if (line?.dataset.parameter === name && this.#moving) continue;
      this.#shown.get(name)?.(value);
    }
  }

  #moving = false;
  #pending;

  /** Sends a value; while a slider moves, the newest one, at most 20 per second. */
  #set(name, value, type) {
    const begin = this.#pending === undefined;
    this.#moving = true;
    this.#pending = { name, value, type };
    if (!begin) return;
    const send = () => {
      const { name, value, type } = this.#pending;
      this.connection.setParameter(name, value, type);
      const sent = this.#pending;
      setTimeout(() => {
        if (this.#pending === sent) {
          this.#pending = undefined;
          this.#moving = false;
        } else {
          send();
        }
      }, 50);
    };
    send();
  }
}
