// The picture: camera, light, ground, scenes and targets. z points up, as in the world of a graph.

import {
  ACESFilmicToneMapping, Box3, BoxGeometry, DirectionalLight, HemisphereLight, Mesh, PCFShadowMap, PerspectiveCamera, Scene,
  Sphere, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { Follow, framingDistance } from "./follow.js";
import { Ground } from "./ground.js";
import { LEVELS, Quality } from "./quality.js";
import { axes, dispose, drawn, placeAt } from "./shapes.js";
import { studio, surface } from "./surfaces.js";
import { colour, isDark, onTheme } from "./theme.js";

/** Size from which objects are surroundings, m. */
const LARGE = 3;
/** Vertical angle of the camera, degrees. */
const ANGLE = 34;
/** Part of the picture that a framed box fills. */
const FILLED = 0.95;
/** Directions of the first camera and of the light. */
const FROM = new Vector3(0.8, -0.72, 0.31).normalize();
const LIGHT = new Vector3(0.42, -0.62, 0.95).normalize();
/** Steps in which the light follows, m, so that shadows move with their objects, not with the map. */
const LIGHT_STEP = 0.25;
/** Length of the axes of a target, as a fraction of the framed radius. */
const AXES = 0.17;
/** Name and entity of the world's ground among the scenes. */
const WORLD = "/world/scene";
const GROUND = "ground";

/** A canvas and its context, with antialiasing unless rendering is in software, where it would dominate the cost. */
function drawing() {
  const made = (antialias) => {
    const canvas = document.createElement("canvas");
    return { canvas, context: canvas.getContext("webgl2", { alpha: false, stencil: false, antialias }) };
  };
  const plain = made(false);
  const gl = plain.context;
  const more = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl ? gl.getParameter(more ? more.UNMASKED_RENDERER_WEBGL : gl.RENDERER) : "";
  // With software rendering, the first context of a page costs a tenth of a second: it is kept.
  if (/swiftshader|llvmpipe|softpipe/i.test(name)) return { ...plain, isSoftware: true };
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return { ...made(true), isSoftware: false };
}

export class View {
  #entities = new Map(); // by topic and id: the group and its frame
  #targets = new Map(); // by topic
  #follow = new Follow();
  #followed; // the base at the last picture
  #last; // time of the last picture
  #radius = 1; // of the framed objects, m
  #axes = AXES; // length of a target's axes, m

  constructor(element) {
    this.element = element;
    const { canvas, context, isSoftware } = drawing();
    this.renderer = new WebGLRenderer({ canvas, context });
    this.renderer.toneMapping = ACESFilmicToneMapping;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.quality = new Quality(isSoftware ? 1 : LEVELS.length - 1);
    element.prepend(canvas);
    this.scene = new Scene();
    this.sky = new HemisphereLight();
    this.sky.position.set(0, 0, 1);
    this.key = new DirectionalLight();
    this.fill = new DirectionalLight();
    this.fill.position.set(-0.7, 0.55, 0.35);
    this.scene.add(this.sky, this.key, this.key.target, this.fill);
    this.ground = new Ground(this.scene);
    this.camera = new PerspectiveCamera(ANGLE, 1, 0.01, 200);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.target.set(0, 0, 0.4);
    this.camera.position.copy(FROM).multiplyScalar(3).add(this.controls.target);
    this.controls.update();
    this.moved = false; // true once the user has moved the camera
    this.follows = true;
    this.controls.addEventListener("start", () => (this.moved = true));
    this.#paint();
    onTheme(() => this.#paint());
    new ResizeObserver(() => this.resize()).observe(element);
    this.#applyLevel();
    // A surface too small to see: its shaders are compiled while the robot is being loaded.
    this.first = new Mesh(new BoxGeometry(1e-5, 1e-5, 1e-5), surface({ r: 1, g: 1, b: 1 }));
    this.first.receiveShadow = true;
    this.first.frustumCulled = false;
    this.scene.add(this.first);
  }

  /** Light and colours of the theme. */
  #paint() {
    const dark = isDark();
    this.renderer.toneMappingExposure = dark ? 0.95 : 1.05;
    this.sky.color.set(dark ? "#c9d6ea" : "#f3f7ff");
    this.sky.groundColor.set(dark ? "#30363f" : "#8d8a86");
    this.sky.intensity = dark ? 1.25 : 1.7;
    this.key.color.set("#fff4e6");
    this.key.intensity = dark ? 2.5 : 2.6;
    this.fill.color.set("#bcd2ff");
    this.fill.intensity = dark ? 0.8 : 0.55;
    studio.above.value.set(dark ? "#9fb0c8" : "#eef3fa");
    studio.below.value.set(colour("--floor"));
    studio.rim.value = dark ? 0.35 : 0.45;
    this.ground?.paint();
  }

  #applyLevel(level = LEVELS[this.quality.level]) {
    this.level = level;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, level.ratio));
    this.key.castShadow = level.shadow > 0;
    if (level.shadow > 0 && this.key.shadow.mapSize.x !== level.shadow) {
      this.key.shadow.mapSize.set(level.shadow, level.shadow);
      this.key.shadow.map?.dispose();
      this.key.shadow.map = null;
    }
    this.key.shadow.radius = 3;
    this.resize();
  }

  /** Draws the next pictures at the best quality regardless of cost, for a screenshot. */
  finest() {
    this.pinned = true;
    this.#applyLevel(LEVELS.at(-1));
    this.renderer.setPixelRatio(2);
    this.resize();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (!width || !height) return;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  /** Draws the entities of a scene, replacing entities of the same name. */
  update(topic, { entities, deletions }) {
    const isGround = (id) => topic === WORLD && id === GROUND;
    const remove = (key) => {
      const entity = this.#entities.get(key);
      if (entity) dispose(entity.group);
      this.#entities.delete(key);
    };
    for (const deletion of deletions) {
      const own = [...this.#entities.keys()].filter((key) => key.startsWith(`${topic} `));
      own.filter((key) => deletion.type === 1 || key === `${topic} ${deletion.id}`).forEach(remove);
      if (deletion.type === 1 ? topic === WORLD : isGround(deletion.id)) this.ground.place();
    }
    for (const entity of entities) {
      const key = `${topic} ${entity.id}`;
      if (isGround(entity.id) && entity.cubes.length === 1) {
        const [{ pose, size, color }] = entity.cubes;
        this.ground.place((pose?.position?.z ?? 0) + 0.5 * (size?.z ?? 0), color);
        continue;
      }
      remove(key);
      const group = drawn(entity);
      // Forces come and go; the camera frames bodies.
      const isBody = [entity.cubes, entity.spheres, entity.cylinders, entity.triangles].some(({ length }) => length > 0);
      this.#entities.set(key, { group, frame: entity.frameId, isBody });
      this.scene.add(group);
    }
  }

  /** Draws a target as three axes. */
  target(topic, pose) {
    if (!this.#targets.has(topic)) {
      const target = axes();
      target.scale.setScalar(this.#axes);
      this.#targets.set(topic, target);
      this.scene.add(target);
    }
    placeAt(this.#targets.get(topic), pose);
  }

  /** Removes everything drawn by scenes and targets. */
  clear() {
    for (const { group } of this.#entities.values()) dispose(group);
    for (const target of this.#targets.values()) dispose(target);
    this.#entities.clear();
    this.#targets.clear();
    this.ground.place();
    this.#followed = undefined;
  }

  /** Draws a picture. `frames` has the poses of the entities' frames; `base` is the point that the camera follows. */
  render(frames, base, now) {
    for (const { group, frame } of this.#entities.values()) {
      const pose = frames.inWorld(frame);
      group.visible = pose !== undefined;
      if (pose) pose.decompose(group.position, group.quaternion, group.scale);
    }
    if (!this.pinned && this.quality.frame(now)) this.#applyLevel();
    this.#move(base, now);
    this.controls.update();
    this.#illuminate();
    this.ground.renderContact(this.renderer);
    this.renderer.render(this.scene, this.camera);
    this.#last = now;
  }

  /** Moves the camera with the base. */
  #move(base, now) {
    if (!base) return;
    if (this.#followed === undefined || !this.follows) this.#follow.begin(base.toArray());
    this.#followed = base;
    if (!this.follows) return;
    const shift = new Vector3(...this.#follow.step(base.toArray(), 1e-3 * (now - (this.#last ?? now))));
    this.camera.position.add(shift);
    this.controls.target.add(shift);
  }

  /** Light and shadows around the target of the camera. */
  #illuminate() {
    const radius = this.#radius;
    const centre = this.#followed && !this.moved ? this.controls.target : (this.#followed ?? this.controls.target);
    const { shadow, contact } = this.level;
    this.ground.focus(centre, radius, { shadows: shadow > 0, contact });
    const step = (x) => Math.round(x / LIGHT_STEP) * LIGHT_STEP;
    this.key.target.position.set(step(centre.x), step(centre.y), step(centre.z));
    this.key.position.copy(LIGHT).multiplyScalar(4 * radius + 1).add(this.key.target.position);
    const { camera } = this.key.shadow;
    const side = 1.7 * radius + LIGHT_STEP;
    if (camera.right === side) return;
    [camera.left, camera.right, camera.top, camera.bottom] = [-side, side, side, -side];
    [camera.near, camera.far] = [0.1, 8 * radius + 2];
    camera.updateProjectionMatrix();
    this.key.shadow.bias = -0.0008;
    this.key.shadow.normalBias = 0.012 * Math.max(radius, 0.3);
  }

  /** The number of bodies in the picture besides robots. */
  get count() {
    return [...this.#entities.values()].filter(({ isBody }) => isBody).length;
  }

  /** Frames a box, with the objects around it but without the ground. */
  look(box, frames) {
    if (this.first) dispose(this.first);
    this.first = undefined;
    for (const { group, frame, isBody } of this.#entities.values()) {
      const pose = isBody ? frames.inWorld(frame) : undefined;
      if (!pose) continue;
      pose.decompose(group.position, group.quaternion, group.scale);
      const thing = new Box3().setFromObject(group);
      if (thing.getSize(new Vector3()).length() < LARGE) box.union(thing);
    }
    const { center, radius } = box.getBoundingSphere(new Sphere());
    this.#radius = Math.max(radius, 0.2);
    this.controls.target.copy(center);
    this.#axes = AXES * Math.min(this.#radius, 1);
    for (const target of this.#targets.values()) target.scale.setScalar(this.#axes);
    const half = box.getSize(new Vector3()).multiplyScalar(0.5);
    const signs = [-1, 1];
    const corners = signs.flatMap((x) => signs.flatMap((y) => signs.map((z) => [x * half.x, y * half.y, z * half.z])));
    const distance = Math.max(framingDistance(corners, FROM.toArray(), ANGLE, this.camera.aspect, FILLED), 0.4);
    this.camera.position.copy(FROM).multiplyScalar(distance).add(center);
    this.controls.update();
    this.moved = false;
  }

  /** State of the camera and of the picture quality. */
  get state() {
    return {
      target: this.controls.target.toArray(),
      position: this.camera.position.toArray(),
      follows: this.follows,
      level: this.level.name,
      shadows: this.level.shadow > 0,
      rate: this.quality.rate ?? null,
    };
  }
}
