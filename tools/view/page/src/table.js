// Tables: the components with their rates, budgets and misses by cause; the joints of the robots.

const HEAD = [
  ["component", ""],
  ["phase", "phase of its life"],
  ["rate", "steps a second: measured in the last half second, and as the graph has it"],
  ["core", "the core it is pinned to"],
  ["execution p50", "of a step, µs"],
  ["p99", "of a step, µs"],
  ["max", "of a step, µs"],
  ["budget", "execution time allowed a step, µs"],
  ["late wake", "steps missed: woken too late"],
  ["long step", "steps missed: the step before took too long"],
  ["stolen", "steps missed: another program had the core"],
  ["late input", "steps missed: what triggers it came too late"],
  ["skipped", "releases left out"],
  ["over budget", "steps that took longer than the budget"],
  ["errors", "steps that returned an error"],
  ["restarts", "times it was started again"],
];

const micro = (ns) => (ns / 1000).toFixed(ns < 100000 ? 1 : 0);
const hertz = (hz) => (hz >= 100 ? hz.toFixed(0) : hz.toFixed(1));

function row(cells, tag = "td") {
  const line = document.createElement("tr");
  for (const cell of cells) {
    const { text, tone = "", title = "" } = typeof cell === "object" ? cell : { text: cell };
    const element = document.createElement(tag);
    element.textContent = text;
    element.className = tone;
    element.title = title;
    line.append(element);
  }
  return line;
}

const count = (number, tone) => ({ text: number, tone: number > 0 ? tone : "dim" });

export class Components {
  constructor(table, latencies) {
    this.table = table;
    this.latencies = latencies;
    this.budgets = new Map();
  }

  /** Takes the graph: rates and budgets as they are planned. */
  plan({ components }) {
    this.planned = new Map(components.map((component) => [component.name, component]));
    const dash = HEAD.slice(1).map(() => "-");
    this.#show(components.map(({ name, kind }) => [{ text: name, title: kind }, ...dash]));
  }

  /** Takes the times of the run. */
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
    const head = row(HEAD.map(([text, title]) => ({ text, title })), "th");
    this.table.replaceChildren(head, ...rows.map((cells) => row(cells)));
  }
}

export class Joints {
  constructor(table) {
    this.table = table;
  }

  /** Shows the joint states of the robots. */
  show(robots) {
    const rows = [];
    const number = (value) => (value === undefined ? "-" : value.toFixed(4));
    for (const { about, state } of robots) {
      for (const joint of state?.joints ?? []) {
        const name = robots.length > 1 ? `${about.name}: ${joint.name}` : joint.name;
        const line = row([name, number(joint.position), number(joint.velocity), number(joint.effort)]);
        line.dataset.joint = `${about.name}.${joint.name}`;
        rows.push(line);
      }
    }
    this.table.replaceChildren(row(["joint", "position", "velocity", "effort"], "th"), ...rows);
  }
}
