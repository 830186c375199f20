// A robot: its model from URDF, moved by the joint states of the run, placed by the transforms that the run's kinematics
// compute.

import { Box3, Matrix4, Mesh, Vector3 } from "three";
import { ColladaLoader } from "three/addons/loaders/ColladaLoader.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { OBJLoader } from "three/addons/loaders/OBJLoader.js";
import { STLLoader } from "three/addons/loaders/STLLoader.js";
import URDFLoader from "urdf-loader";

/** The object of a mesh file. */
async function mesh(uri, bytes, material) {
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
  const text = () => new TextDecoder().decode(buffer);
  switch (uri.split(".").pop().toLowerCase()) {
    case "stl":
      return new Mesh(new STLLoader().parse(buffer), material);
    case "dae":
      return new ColladaLoader().parse(text(), "").scene;
    case "obj": {
      const object = new OBJLoader().parse(text());
      object.traverse((child) => {
        if (child.isMesh) child.material = material;
      });
      return object;
    }
    case "glb":
    case "gltf":
      return (await new GLTFLoader().parseAsync(buffer, "")).scene;
    default:
      throw new Error(`${uri}: no kind of mesh that the page can draw`);
  }
}

export class Robot {
  #missing = 0;

  /** `about` is the robot's entry in the graph; `failed` is told of meshes that cannot be drawn. */
  constructor(about, connection, scene, failed) {
    this.about = about;
    this.scene = scene;
    this.model = undefined;
    this.state = undefined; // the newest joint state
    this.posed = false;
    this.load = (text) => {
      this.model?.removeFromParent();
      const loader = new URDFLoader();
      // Visuals, else what the robot collides with.
      loader.parseVisual = /<visual[\s>]/.test(text);
      loader.parseCollision = !loader.parseVisual;
      loader.packages = (name) => `package://${name}`;
      loader.loadMeshCb = async (uri, _manager, material, done) => {
        this.#missing += 1;
        try {
          done(await mesh(uri, await connection.fetchAsset(uri), material));
        } catch (error) {
          failed(error.message);
          done(null, error);
        }
        this.#missing -= 1;
      };
      this.model = loader.parse(text);
      this.model.visible = false;
      for (const joint of Object.values(this.model.joints)) joint.ignoreLimits = true;
      scene.add(this.model);
      if (this.state) this.#move();
    };
  }

  /** Takes a message of joint states. */
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

  /** Stands where the frames have its root link. */
  place(frames) {
    if (!this.model || !this.posed) return;
    const pose = frames.inWorld(this.about.frame_prefix + this.model.urdfName);
    if (pose) pose.decompose(this.model.position, this.model.quaternion, this.model.scale);
    this.model.visible = pose !== undefined;
  }

  /** True if all of it is in the picture. */
  get isDrawn() {
    return this.model !== undefined && this.model.visible && this.#missing === 0;
  }

  get box() {
    return new Box3().setFromObject(this.model);
  }

  /** Takes the time of the transforms that were told last. */
  told({ transforms }) {
    this.toldAt = transforms.at(-1)?.timestamp;
  }

  /**
   * The largest distance between a link as it is drawn and where the run's kinematics have it, m. Undefined while joints and
   * transforms are of two samples.
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
