// The picture: light, ground grid, camera, and what scenes and targets draw. z points up, as in the world of a graph.

import {
  AmbientLight, ArrowHelper, AxesHelper, Box3, BoxGeometry, BufferGeometry, Color, CylinderGeometry, DirectionalLight,
  Float32BufferAttribute, GridHelper, Group,
  Mesh, MeshPhongMaterial, PerspectiveCamera, Quaternion, Scene, SphereGeometry, Vector3, WebGLRenderer,
} from "three";
import { colour, onTheme } from "./theme.js";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const LARGE = 3; // m: things from this size on are surroundings

const vector = (v) => new Vector3(v?.x ?? 0, v?.y ?? 0, v?.z ?? 0);
const quaternion = (q) => (q ? new Quaternion(q.x, q.y, q.z, q.w) : new Quaternion());

function place(object, pose) {
  object.position.copy(vector(pose?.position));
  object.quaternion.copy(quaternion(pose?.orientation));
  return object;
}

function material({ r, g, b, a } = { r: 0.6, g: 0.6, b: 0.6, a: 1 }) {
  return new MeshPhongMaterial({ color: new Color(r, g, b), opacity: a, transparent: a < 1, depthWrite: a >= 1 });
}

/** The group that a scene entity of Foxglove draws. */
function drawn(entity) {
  const group = new Group();
  const add = (geometry, { pose, color }) => group.add(place(new Mesh(geometry, material(color)), pose));
  for (const cube of entity.cubes) add(new BoxGeometry(cube.size.x, cube.size.y, cube.size.z), cube);
  for (const sphere of entity.spheres) {
    const geometry = new SphereGeometry(0.5, 24, 16);
    geometry.scale(sphere.size.x, sphere.size.y, sphere.size.z);
    add(geometry, sphere);
  }
  for (const cylinder of entity.cylinders) {
    const geometry = new CylinderGeometry(0.5 * cylinder.topScale, 0.5 * cylinder.bottomScale, 1, 24);
    geometry.rotateX(Math.PI / 2);
    geometry.scale(cylinder.size.x, cylinder.size.y, cylinder.size.z);
    add(geometry, cylinder);
  }
  for (const { pose, points, indices, color } of entity.triangles) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new Float32BufferAttribute(points.flatMap(({ x, y, z }) => [x, y, z]), 3));
    if (indices.length) geometry.setIndex(indices);
    geometry.computeVertexNormals();
    add(geometry, { pose, color });
  }
  for (const arrow of entity.arrows) {
    const along = new Vector3(1, 0, 0).applyQuaternion(quaternion(arrow.pose?.orientation));
    const length = Math.max(arrow.shaftLength + arrow.headLength, 1e-4);
    const { r, g, b } = arrow.color ?? { r: 1, g: 0, b: 0 };
    const hex = new Color(r, g, b).getHex();
    group.add(new ArrowHelper(along, vector(arrow.pose?.position), length, hex, arrow.headLength, arrow.headDiameter * 2));
  }
  return group;
}

function dispose(object) {
  object.removeFromParent();
  object.traverse((child) => {
    child.geometry?.dispose();
    for (const one of [child.material].flat()) one?.dispose();
  });
}

/** A canvas and its context: with smooth edges, unless the processor draws, where they would cost most of its time. */
function drawing() {
  const made = (antialias) => {
    const canvas = document.createElement("canvas");
    return { canvas, context: canvas.getContext("webgl2", { alpha: true, stencil: false, antialias }) };
  };
  const plain = made(false);
  const gl = plain.context;
  const more = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl ? gl.getParameter(more ? more.UNMASKED_RENDERER_WEBGL : gl.RENDERER) : "";
  // The first context of a page takes a tenth of a second of a processor that draws: it is kept.
  if (/swiftshader|llvmpipe|softpipe/i.test(name)) return plain;
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return made(true);
}

export class View {
  #entities = new Map(); // by topic and id: the group and its frame
  #targets = new Map(); // by topic

  constructor(element) {
    this.element = element;
    this.renderer = new WebGLRenderer(drawing());
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    element.append(this.renderer.domElement);
    this.scene = new Scene();
    [this.sky, this.sun] = [new AmbientLight(0xffffff), new DirectionalLight(0xffffff)];
    this.sun.position.set(2, -3, 5);
    this.scene.add(this.sky, this.sun);
    this.scene.add(new AxesHelper(0.2));
    this.#paint();
    onTheme(() => this.#paint());
    this.camera = new PerspectiveCamera(45, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(1.7, -1.5, 1.2);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.target.set(0.2, 0, 0.4);
    this.controls.update();
    this.moved = false; // true once the user has moved the camera
    this.controls.addEventListener("start", () => (this.moved = true));
    new ResizeObserver(() => this.resize()).observe(element);
    this.resize();
  }

  /** The light, and the colours of background and grid, whose lines are 25 cm apart. */
  #paint() {
    const light = Number(colour("--light"));
    [this.sky.intensity, this.sun.intensity] = [1.4 * light, 2.2 * light];
    this.scene.background = new Color(colour("--scene"));
    if (this.grid) dispose(this.grid);
    this.grid = new GridHelper(4, 16, colour("--axis"), colour("--cell"));
    this.grid.rotateX(Math.PI / 2);
    this.scene.add(this.grid);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (!width || !height) return;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  /** Draws the entities of a scene in place of those of the same name. */
  update(topic, { entities, deletions }) {
    const remove = (key) => {
      const entity = this.#entities.get(key);
      if (entity) dispose(entity.group);
      this.#entities.delete(key);
    };
    for (const deletion of deletions) {
      const own = [...this.#entities.keys()].filter((key) => key.startsWith(`${topic} `));
      own.filter((key) => deletion.type === 1 || key === `${topic} ${deletion.id}`).forEach(remove);
    }
    for (const entity of entities) {
      const key = `${topic} ${entity.id}`;
      remove(key);
      const group = drawn(entity);
      this.#entities.set(key, { group, frame: entity.frameId });
      this.scene.add(group);
    }
  }

  /** Draws a target as three axes. */
  target(topic, pose) {
    if (!this.#targets.has(topic)) {
      const axes = new AxesHelper(0.12);
      this.#targets.set(topic, axes);
      this.scene.add(axes);
    }
    place(this.#targets.get(topic), pose);
  }

  /** Forgets all that scenes and targets have drawn. */
  clear() {
    for (const { group } of this.#entities.values()) dispose(group);
    for (const axes of this.#targets.values()) dispose(axes);
    this.#entities.clear();
    this.#targets.clear();
  }

  /** Draws a picture. `frames` tells where the frames of entities are. */
  render(frames) {
    for (const { group, frame } of this.#entities.values()) {
      const pose = frames.inWorld(frame);
      group.visible = pose !== undefined;
      if (pose) pose.decompose(group.position, group.quaternion, group.scale);
    }
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }

  /** The number of things in the picture besides robots. */
  get count() {
    return this.#entities.size;
  }

  /** Moves the camera so that a box is well in the picture, with the things around it but not the ground. */
  look(box, frames) {
    for (const { group, frame } of this.#entities.values()) {
      const pose = frames.inWorld(frame);
      if (!pose) continue;
      pose.decompose(group.position, group.quaternion, group.scale);
      const thing = new Box3().setFromObject(group);
      if (thing.getSize(new Vector3()).length() < LARGE) box.union(thing);
    }
    const centre = box.getCenter(new Vector3());
    const radius = Math.max(box.getSize(new Vector3()).length() / 2, 0.2);
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).add(new Vector3(0.75, -0.75, 0.45).normalize().multiplyScalar(2.6 * radius));
    this.controls.update();
  }
}
