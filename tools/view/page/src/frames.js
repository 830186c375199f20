// The tree of frames, built from transforms.

import { Matrix4, Quaternion, Vector3 } from "three";

const ROOT = "world";

export class Frames {
  #parents = new Map(); // by child: the parent and the pose in it

  /** Applies the transforms of a message. */
  take({ transforms }) {
    for (const { parentFrameId, childFrameId, translation: t, rotation: r } of transforms) {
      const pose = new Matrix4().compose(
        new Vector3(t?.x ?? 0, t?.y ?? 0, t?.z ?? 0),
        r ? new Quaternion(r.x, r.y, r.z, r.w) : new Quaternion(),
        new Vector3(1, 1, 1),
      );
      this.#parents.set(childFrameId, { parent: parentFrameId, pose });
    }
  }

  /** The pose of a frame in the world; undefined if unknown. */
  inWorld(frame) {
    const pose = new Matrix4();
    for (let steps = 0; frame !== ROOT; steps += 1) {
      const link = this.#parents.get(frame);
      if (!link || steps > 100) return undefined;
      pose.premultiply(link.pose);
      frame = link.parent;
    }
    return pose;
  }

  clear() {
    this.#parents.clear();
  }
}
