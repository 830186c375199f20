// The page of motorium view: displays data of the run, and sends it the user's input.

import { Box3, Vector3 } from "three";
import "uplot/dist/uPlot.min.css";
import { Connection } from "./connection.js";
import { Frames } from "./frames.js";
import { Parameters } from "./parameters.js";
import { Pictures } from "./pictures.js";
import { Playback } from "./playback.js";
import { Plot } from "./plot.js";
import { Robot } from "./robot.js";
import { View } from "./scene.js";
import { Components, Joints } from "./table.js";
import { toggleTheme } from "./theme.js";
import { Timeline } from "./timeline.js";

const $ = (id) => document.getElementById(id);
const SCENES = ["foxglove.SceneUpdate"];
const PICTURES = "foxglove.RawImage";
const TABLE_MS = 100;
const LOOK_MS = 3000;
/** Time between two pictures until the first robot is loaded, and the limit of this phase, ms after the page
 * started: with software rendering, drawing delays loading. */
const EMPTY_MS = 300;
const START_MS = 8000;

const connection = new Connection(`ws://${location.host}/${location.search}`);
const view = new View($("scene"));
const frames = new Frames();
const plot = new Plot(connection, $("plot"), {
  topic: $("plot-topic"),
  field: $("plot-field"),
  entries: $("plot-entries"),
  legend: $("plot-legend"),
  seek: (place) => playback.seek(place),
});
const cameras = new Pictures(connection, $("cameras"));
const parameters = new Parameters(connection, $("parameters"));
const components = new Components($("components"), $("latencies"));
const timeline = new Timeline($("timeline"));
const playback = new Playback(connection, $("playback"), (problem) => say(problem, true), (place, length) => plot.cursor(place, length));
const joints = new Joints($("joints"));

let robots = [];
let graph;
let run = { state: "waiting" };
let first; // the time of the first picture of the robots
let pictures = 0;
let looked; // the time at which the robots were framed first, and the number of objects in that picture
const exact = new Map(); // by topic: the newest exact joint state
const errors = [];
const subscribed = new Map(); // by topic: the listener

function say(text, bad = false) {
  $("message").textContent = text;
  $("message").title = text;
  $("message").className = bad ? "bad" : "";
  if (bad) errors.push(text);
}

function listen(topic, listener) {
  if (!topic || subscribed.has(topic)) return;
  subscribed.set(topic, listener);
  connection.subscribe(topic, listener);
}

/** Discards the displayed run; its last picture stays until another run starts. */
function forget() {
  for (const [topic, listener] of subscribed) connection.unsubscribe(topic, listener);
  subscribed.clear();
}

function begin(about) {
  graph = about;
  for (const robot of robots) robot.remove();
  frames.clear();
  view.clear();
  exact.clear();
  looked = undefined;
  robots = about.robots.map((robot) => {
    const shown = new Robot(robot, connection, view.scene, (problem) => say(problem, true));
    listen(robot.description, ({ data }) => shown.load(data));
    listen(robot.joints, (state) => shown.take(state));
    listen(robot.state, (state) => exact.set(robot.name, state));
    listen(robot.base, (told) => frames.take(told));
    listen(robot.transforms, (told) => {
      frames.take(told);
      shown.told(told);
    });
    listen(robot.odometry, ({ frameId, bodyFrameId, pose }) => {
      // The true pose of a base takes precedence over its wheel odometry.
      if (robot.base || !pose) return;
      const { position: translation, orientation: rotation } = pose;
      frames.take({ transforms: [{ parentFrameId: frameId, childFrameId: bodyFrameId, translation, rotation }] });
    });
    return shown;
  });
  components.plan(about);
  timeline.plan(about);
  parameters.plan(about);
  channels();
}

/** Subscribes to drawable topics, and offers topics with numbers for plots. */
function channels() {
  if (!graph) return;
  for (const { topic, schemaName } of connection.channels) {
    if (SCENES.includes(schemaName)) listen(topic, (update) => view.update(topic, update));
    if (schemaName === "foxglove.PoseInFrame") listen(topic, ({ pose }) => view.target(topic, pose));
    if (schemaName === "foxglove.FrameTransforms") listen(topic, (told) => frames.take(told));
  }
  cameras.offer(connection.channels.filter(({ schemaName }) => schemaName === PICTURES).map(({ topic }) => topic));
  const known = new Set(connection.channels.map(({ topic }) => topic));
  const offered = graph.topics.map(({ name }) => name).filter((name) => known.has(name));
  const joint = graph.robots.map(({ state }) => state).find((topic) => known.has(topic));
  if (offered.length) plot.offer(offered, graph.topics, joint);
}

function showRun() {
  const lost = !connection.connected;
  const held = run.state === "running" && run.latched;
  const words = lost ? "no connection" : held ? `stopped (${run.latched})` : run.state;
  $("graph").textContent = run.graph ?? "motorium";
  $("run").textContent = run.run ?? "";
  $("state").textContent = words;
  $("state").className = `badge ${lost ? "lost" : held ? "latched" : run.state}`;
  document.title = `${run.graph ?? "motorium"}: ${words}`;
  const runs = !lost && run.state === "running";
  $("stop").disabled = !runs;
  $("resume").hidden = !(runs && held);
  $("end").hidden = !runs;
  $("start").hidden = lost || !run.can_start;
  const recorded = run.state === "playback";
  $("stop").hidden = recorded;
  // Only a live run has times and parameters.
  $("times").hidden = $("tuning").hidden = recorded;
  playback.show(recorded);
}

async function command(name) {
  try {
    const { message } = await connection.call(`/motorium/${name}`);
    say(message.split("\n").at(-1));
  } catch (error) {
    say(error.message, true);
  }
}

for (const name of ["stop", "resume", "end", "start"]) $(name).addEventListener("click", () => command(name));
$("theme").addEventListener("click", toggleTheme);

/** Follows a moving base, or keeps the camera fixed. */
function follow(follows = !view.follows) {
  view.follows = follows;
  $("follow").setAttribute("aria-pressed", follows);
}
$("follow").addEventListener("click", () => follow());
$("frame").addEventListener("click", () => look());

const KEYS = { KeyF: () => follow(), KeyR: () => look() };
addEventListener("keydown", (event) => {
  const isTyping = event.target.closest?.("input, select, button") !== null && event.target.closest !== undefined;
  if (isTyping || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.code === "Space") {
    event.preventDefault();
    if (run.state === "playback") playback.toggle();
    else command("stop");
  }
  KEYS[event.code]?.();
});

connection.addEventListener("open", showRun);
connection.addEventListener("close", () => {
  forget();
  showRun();
});
connection.addEventListener("session", forget);
connection.addEventListener("channels", channels);
connection.addEventListener("status", ({ detail: { level, message } }) => say(message, level > 0));
connection.subscribe("/motorium/run", (state) => {
  run = state;
  showRun();
  if (run.state !== "running" && run.state !== "playback") return;
  if (graph?.run !== run.run) connection.again("/motorium/graph");
  else for (const robot of robots.filter(({ model }) => !model)) connection.again(robot.about.description);
});
connection.subscribe("/motorium/graph", (about) => {
  if (about.run !== graph?.run || subscribed.size === 0) begin(about);
});
connection.subscribe("/motorium/top", (top) => {
  components.take(top);
  timeline.take(top);
  $("time").textContent = `${top.elapsed_s.toFixed(1)} s`;
});

/** Frames the robots and the objects around them. */
function look() {
  const shown = robots.filter((robot) => robot.isShown);
  if (shown.length) view.look(shown.reduce((box, robot) => box.union(robot.box), new Box3()), frames);
}

/** Shows the number of loaded meshes until all are loaded. */
function showProgress() {
  const [loaded, all] = robots.map(({ progress }) => progress).reduce(([a, b], [c, d]) => [a + c, b + d], [0, 0]);
  $("progress").hidden = loaded === all;
  if (loaded === all) return;
  $("progress").firstElementChild.textContent = `meshes: ${loaded} of ${all}`;
  $("progress").lastElementChild.value = loaded / all;
}

let tabled = 0;
let emptied = -Infinity; // time of the last picture without a robot
function picture(now) {
  requestAnimationFrame(picture);
  for (const robot of robots) robot.place(frames);
  const shown = robots.length > 0 && robots.every((robot) => robot.isShown);
  const drawn = shown && robots.every((robot) => robot.isDrawn);
  if (!shown && (!graph || robots.length > 0) && now < START_MS) {
    if (now - emptied < EMPTY_MS) return;
    emptied = now;
  }
  // Meshes and objects around the robots arrive later: frame them, too.
  const isLate = looked && now - looked.time < LOOK_MS && !view.moved && (view.count > looked.count || drawn !== looked.drawn);
  if (shown && (!looked || isLate)) {
    looked = { time: looked?.time ?? now, count: view.count, drawn };
    look();
  }
  const bases = robots.filter((robot) => robot.isShown).map(({ base }) => base);
  const sum = bases.reduce((all, base) => all.add(base), new Vector3());
  view.render(frames, bases.length ? sum.divideScalar(bases.length) : undefined, now);
  showProgress();
  cameras.paint();
  pictures += 1;
  if (drawn && first === undefined) first = performance.timeOrigin + performance.now();
  if (now - tabled >= TABLE_MS) {
    tabled = now;
    joints.show(robots);
  }
}
requestAnimationFrame(picture);
showRun();

/** The state of the page, for programs that inspect it. */
globalThis.motorium = {
  /** The run, and the time of the first picture of the robots, ms since 1970; cheap while the page starts. */
  begun: () => ({ run, first_picture_ms: first ?? null }),
  state: () => ({
    connected: connection.connected,
    run,
    first_picture_ms: first ?? null,
    pictures,
    triangles: view.renderer.info.render.triangles,
    view: view.state,
    robots: robots.map((robot) => ({
      name: robot.about.name,
      topic: robot.about.state,
      drawn: robot.isDrawn,
      meshes: robot.progress,
      hulls: robot.shownHulls,
      base: robot.isShown ? robot.base.toArray() : null,
      deviation_m: robot.deviation(frames) ?? null,
      sequence: exact.has(robot.about.name) ? Number(exact.get(robot.about.name).stamp.sequence) : null,
      position: exact.get(robot.about.name)?.position ?? [],
      joints: Object.fromEntries((robot.state?.joints ?? []).map(({ name, position }) => [name, position])),
    })),
    components: (components.rows ?? []).map(([{ text }, , rate]) => ({ name: text, rate: rate.text })),
    timeline: timeline.state,
    playback: playback.state,
    parameters: parameters.values,
    plot: plot.state,
    cameras: cameras.state,
    errors,
  }),
  pixel: (topic, x, y) => cameras.pixel(topic, x, y),
  /** Draws at the best quality regardless of cost; resolves once such a picture is shown. */
  finest: async () => {
    view.finest();
    for (let count = 0; count < 3; count += 1) await new Promise(requestAnimationFrame);
  },
};
