// Tables: the components with their rates, budgets and misses by cause; the joints of the robots, with their limits.

const HEAD = [
  ["component", ""],
  ["phase", "life-cycle phase of the component"],
  ["rate, Hz", "steps per second: measured during the last half second / configured in the graph"],
  ["core", "CPU core that the component runs on"],
  ["execution p50, µs", "median execution time of a step"],
  ["p99, µs", "99th percentile of the execution time of a step"],
  ["max, µs", "longest execution time of a step"],
  ["budget, µs", "execution time that a step may take"],
  ["late wake", "missed steps: the component woke up too late"],
  ["long step", "missed steps: the previous step took too long"],
  ["stolen", "missed steps: another program was using the core"],
  ["late input", "missed steps: the input that triggers the step arrived too late"],
  ["skipped", "scheduled steps that did not run"],
  ["over budget", "steps that took longer than their budget"],
  ["errors", "steps that returned an error"],
  ["restarts", "number of times that the component was restarted"],
];

const micro = (ns) => (ns / 1000).toFixed(ns < 100000 ? 1 : 0);
const hertz = (hz) => (hz >= 100 ? hz.toFixed(0) : hz.toFixed(1));

/** Writes a cell; unchanged content is not touched, so that tooltips and selections stay. */
function write(element, cell) {
  const { text, tone = "", title = "" } = typeof cell === "object" ? cell : { text: cell };
  if (element.textContent !== String(text)) element.textContent = text;
  if (element.className !== tone) element.className = tone;
  if (element.title !== title) element.title = title;
}

/** Writes rows of cells into a table; the first row is its head. */
function fill(table, rows) {
  while (table.rows.length > rows.length) table.deleteRow(-1);
  rows.forEach((cells, index) => {
    const line = table.rows[index] ?? table.insertRow();
    while (line.cells.length > cells.length) line.deleteCell(-1);
    cells.forEach((cell, place) => {
      const tag = index === 0 ? "th" : "td";
      write(line.cells[place] ?? line.appendChild(document.createElement(tag)), cell);
    });
  });
}

const count = (number, tone) => ({ text: number, tone: number > 0 ? tone : "dim" });

export class Components {
  constructor(table, latencies) {
    this.table = table;
    this.latencies = latencies;
    this.budgets = new Map();
  }

  /** Applies the graph: planned rates and budgets. */
  plan({ components }) {
    this.planned = new Map(components.map((component) => [component.name, component]));
    const dash = HEAD.slice(1).map(() => "-");
    this.#show(components.map(({ name, kind }) => [{ text: name, title: kind }, ...dash]));
  }

  /** Applies the times of the run. */
  take({ components, latencies }) {
    this.rows = components.map((component) => this.#cells(component));
    this.#show(this.rows);
    const shown = latencies.map(({ from, to, max_ns: budget, run }) => {
      const { p50, p99, max } = run.latency_ns;
      return `${from} → ${to}: p50 ${micro(p50)} µs, p99 ${micro(p99)} µs, max ${micro(max)} µs of ${micro(budget)} µs, ` +
        `${run.missed} missed of ${run.count}`;
    });
    this.latencies.textContent = shown.join("; ");
  }

  #cells(component) {
    const { run, interval } = component;
    const planned = this.planned?.get(component.name);
    const budget = planned?.budget_ns;
    const { misses } = run;
    const over = budget && run.execution_ns.p99 > budget;
    const phase = component.safe ? "safe state" : component.phase;
    return [
      { text: component.name, title: planned?.kind },
      { text: phase, tone: phase === "running" ? "" : "bad" },
      { text: `${hertz(interval.rate_hz)} / ${planned ? hertz(planned.rate_hz) : "-"}` },
      component.core ?? "-",
      micro(run.execution_ns.p50),
      { text: micro(run.execution_ns.p99), tone: over ? "bad" : "" },
      micro(run.execution_ns.max),
      budget ? micro(budget) : "-",
      count(misses.late_wake, "bad"),
      count(misses.long_step, "bad"),
      count(misses.stolen, "bad"),
      count(misses.late_input, "bad"),
      count(misses.skipped, "bad"),
      count(misses.over_budget, "warn"),
      count(run.errors, "bad"),
      count(component.restarts, "bad"),
    ];
  }

  #show(rows) {
    fill(this.table, [HEAD.map(([text, title]) => ({ text, title })), ...rows]);
  }
}

/** Units of position, velocity and effort of joints that turn, and of those that slide. */
const TURNS = ["rad", "rad/s", "N m"];
const SLIDES = ["m", "m/s", "N"];
/** Fraction of the range of a joint within which it is near a limit. */
const NEAR = 0.01;

/** A number with four digits; values that round to zero have no sign. */
const fixed = (value) => (Math.abs(value) < 5e-5 ? 0 : value).toFixed(4);

/** Describes the position of a joint between its limits, and flags a joint at or near a limit. */
function within(joint, position) {
  const { lower, upper } = joint?.limit ?? {};
  if (!(upper > lower) || joint.jointType === "continuous" || position === undefined) return {};
  const margin = Math.min(position - lower, upper - position) / (upper - lower);
  return { title: `limits ${lower} to ${upper}`, tone: margin < 0 ? "bad" : margin < NEAR ? "warn" : "" };
}

export class Joints {
  constructor(table) {
    this.table = table;
  }

  /** Shows the joint states of the robots. */
  show(robots) {
    const rows = [];
    for (const { about, state, model } of robots) {
      for (const { name, position, velocity, effort } of state?.joints ?? []) {
        const joint = model?.joints[name];
        const units = joint?.jointType === "prismatic" ? SLIDES : [];
        const number = (value, index) => (value === undefined ? "-" : `${fixed(value)}${units[index] ? ` ${units[index]}` : ""}`);
        const label = robots.length > 1 ? `${about.name}: ${name}` : name;
        rows.push([label, { text: number(position, 0), ...within(joint, position) }, number(velocity, 1), number(effort, 2)]);
      }
    }
    const head = ["position", "velocity", "effort"].map((text, index) => `${text}, ${TURNS[index]}`);
    fill(this.table, [["joint", ...head], ...rows]);
    this.table.closest("details").hidden = rows.length === 0;
  }
}
