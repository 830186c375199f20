// A robot: its model from URDF, moved by the joint states of the run, placed by the transforms that the run's kinematics
// compute.

import { Box3, Group, Matrix4, Mesh, Vector3 } from "three";
import { ColladaLoader } from "three/addons/loaders/ColladaLoader.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { OBJLoader } from "three/addons/loaders/OBJLoader.js";
import { STLLoader } from "three/addons/loaders/STLLoader.js";
import URDFLoader from "urdf-loader";
import { shadowed, smoothed } from "./shapes.js";
import { fromFile, fromUrdf, surface } from "./surfaces.js";

/** Collision shapes of a link, shown until its meshes are loaded. */
const HULL = surface({ r: 0.62, g: 0.66, b: 0.71 });

/** The object of a mesh file. */
async function mesh(uri, bytes, material) {
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
  const text = () => new TextDecoder().decode(buffer);
  switch (uri.split(".").pop().toLowerCase()) {
    case "stl":
      return new Mesh(smoothed(new STLLoader().parse(buffer)), material);
    case "dae":
      return new ColladaLoader().parse(text(), "").scene;
    case "obj": {
      const lines = text();
      const object = new OBJLoader().parse(lines);
      const hasNormals = /^vn /m.test(lines);
      object.traverse((child) => {
        if (!child.isMesh) return;
        child.material = material;
        if (!hasNormals) child.geometry = smoothed(child.geometry);
      });
      return object;
    }
    case "glb":
    case "gltf":
      return (await new GLTFLoader().parseAsync(buffer, "")).scene;
    default:
      throw new Error(`${uri}: the page cannot draw meshes of this type`);
  }
}

/** Names of the meshes of a description within elements of this kind. */
function meshesIn(text, kind) {
  const elements = [...new DOMParser().parseFromString(text, "text/xml").querySelectorAll(`link > ${kind} mesh`)];
  return new Set(elements.map((element) => element.getAttribute("filename")));
}

/** Gives a loaded object the materials and shadows of the page. */
function finished(object, material) {
  object.traverse((child) => {
    if (!child.isMesh) return;
    child.material = Array.isArray(child.material) ? child.material.map(material) : material(child.material);
  });
  return shadowed(object);
}

export class Robot {
  #missing = 0;
  #meshes = 0;

  /** `about` is the robot's entry in the graph; `failed` is called for meshes that cannot be drawn. */
  constructor(about, connection, scene, failed) {
    this.about = about;
    this.connection = connection;
    this.scene = scene;
    this.failed = failed;
    this.model = undefined;
    this.state = undefined; // the newest joint state
    this.posed = false;
  }

  /** Builds the model of a description. Links are drawn as their collision shapes until their meshes are loaded. */
  load(text) {
    if (text === this.text) return; // sent again
    this.text = text;
    this.model?.removeFromParent();
    this.#missing = this.#meshes = 0;
    const visuals = meshesIn(text, "visual");
    const isVisual = /<visual[\s>]/.test(text);
    const hulls = isVisual && visuals.size > 0 ? this.#hulls(text, visuals) : new Map();
    const loader = this.#loader((uri, material) => this.#mesh(uri, material));
    loader.parseVisual = isVisual;
    loader.parseCollision = !isVisual;
    this.model = finished(loader.parse(text), fromUrdf);
    for (const [name, hull] of hulls) this.model.links[name]?.add(hull);
    this.hulls = hulls;
    this.#showHulls();
    this.model.visible = false;
    for (const joint of Object.values(this.model.joints)) joint.ignoreLimits = true;
    this.scene.add(this.model);
    if (this.state) this.#move();
  }

  /** A loader of descriptions. `load` returns the object of a mesh; until then its link is drawn as a hull. */
  #loader(load) {
    const loader = new URDFLoader();
    loader.packages = (name) => `package://${name}`;
    loader.loadMeshCb = async (uri, _manager, material, done) => {
      try {
        done(finished(await load(uri, material), fromFile));
      } catch (error) {
        this.failed(error.message);
        done(null, error);
      }
      this.#showHulls();
    };
    return loader;
  }

  async #mesh(uri, material) {
    this.#missing += 1;
    this.#meshes += 1;
    try {
      return await mesh(uri, await this.connection.fetchAsset(uri), fromUrdf(material));
    } finally {
      this.#missing -= 1;
    }
  }

  /** Collision shapes of the links with meshes, by link. Meshes that are also visuals are loaded once. */
  #hulls(text, visuals) {
    const loader = this.#loader(async (uri) => {
      if (visuals.has(uri)) return new Group();
      return mesh(uri, await this.connection.fetchAsset(uri), HULL);
    });
    [loader.parseVisual, loader.parseCollision] = [false, true];
    const model = loader.parse(text);
    const hulls = new Map();
    for (const [name, link] of Object.entries(model.links)) {
      if (!link.urdfNode.querySelector("visual mesh")) continue;
      const hull = new Group();
      hull.add(...link.children.filter((child) => child.isURDFCollider));
      hulls.set(name, finished(hull, () => HULL));
    }
    return hulls;
  }

  /** Hides the hulls of links with loaded meshes. */
  #showHulls() {
    for (const [name, hull] of this.hulls ?? []) {
      const visuals = this.model.links[name].children.filter((child) => child.isURDFVisual);
      hull.visible = visuals.some(({ children }) => children.length === 0);
    }
  }

  /** Names of the links drawn as hulls. */
  get shownHulls() {
    return [...(this.hulls ?? [])].filter(([, hull]) => hull.visible).map(([name]) => name);
  }

  /** Numbers of loaded meshes and of all meshes. */
  get progress() {
    return [this.#meshes - this.#missing, this.#meshes];
  }

  /** Applies a message of joint states. */
  take(state) {
    this.state = state;
    if (this.model) this.#move();
  }

  #move() {
    for (const { name, position } of this.state.joints) {
      if (position !== undefined) this.model.joints[name]?.setJointValue(position);
    }
    this.posed = true;
  }

  /** Moves to the pose of its root link in the frames. */
  place(frames) {
    if (!this.model || !this.posed) return;
    const pose = frames.inWorld(this.about.frame_prefix + this.model.urdfName);
    if (pose) pose.decompose(this.model.position, this.model.quaternion, this.model.scale);
    this.model.visible = pose !== undefined;
  }

  /** True if it is in the picture, with hulls for missing meshes. */
  get isShown() {
    return this.model?.visible === true;
  }

  /** Position of its root in the world. */
  get base() {
    return this.model.position;
  }

  /** True if it is in the picture completely. */
  get isDrawn() {
    return this.model !== undefined && this.model.visible && this.#missing === 0;
  }

  get box() {
    return new Box3().setFromObject(this.model);
  }

  /** Records the time of the newest transforms. */
  told({ transforms }) {
    this.toldAt = transforms.at(-1)?.timestamp;
  }

  /**
   * Largest distance between a drawn link and its pose by the run's kinematics, m. Undefined while joints and
   * transforms belong to different samples.
   */
  deviation(frames) {
    const [one, other] = [this.state?.timestamp, this.toldAt];
    if (!one || one.seconds !== other?.seconds || one.nanos !== other?.nanos) return undefined;
    this.place(frames);
    if (!this.model?.visible) return undefined;
    this.model.updateMatrixWorld(true);
    let largest;
    for (const [name, link] of Object.entries(this.model.links)) {
      const told = frames.inWorld(this.about.frame_prefix + name);
      if (!told) continue;
      const corner = new Vector3(0.1, 0.1, 0.1);
      const distance = corner.clone().applyMatrix4(told).distanceTo(corner.applyMatrix4(new Matrix4().copy(link.matrixWorld)));
      largest = Math.max(largest ?? 0, distance);
    }
    return largest;
  }

  remove() {
    this.model?.removeFromParent();
  }
}
