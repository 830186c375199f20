// Geometry of the camera: the distance that frames points, and the motion that follows a base.

/** Time constant: the camera covers about two thirds of its distance from the base in this time, s. */
const TIME_CONSTANT = 0.25;
/** Motion between two frames from which a base was placed elsewhere, m: the camera follows immediately. */
const JUMP = 2;

const dot = (one, other) => one.reduce((sum, x, i) => sum + x * other[i], 0);
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
const unit = (v) => v.map((x) => x / Math.hypot(...v));

/**
 * Distance at which a camera sees all points, [x, y, z] in m relative to its target, within the fraction `filled`
 * of the picture. `from` is the direction to the camera, `degrees` its vertical angle, `aspect` width / height; z
 * is up.
 */
export function framingDistance(points, from, degrees, aspect, filled = 1) {
  const back = unit(from);
  const right = unit(cross([0, 0, 1], back));
  const up = cross(back, right);
  const high = Math.tan((degrees * Math.PI) / 360) * filled;
  const needed = points.map((point) => {
    const aside = Math.max(Math.abs(dot(point, right)) / (high * aspect), Math.abs(dot(point, up)) / high);
    return dot(point, back) + aside;
  });
  return Math.max(...needed);
}

/** Follows a point smoothly: the shift of the camera in each frame. */
export class Follow {
  #at; // the followed point, smoothed
  #target; // the newest point

  /** Starts at a point, [x, y, z] in m, without a transition. */
  begin(point) {
    this.#at = [...point];
    this.#target = [...point];
  }

  /** Shift of the camera after a time, s, with the followed point there: [x, y, z], m. */
  step(point, seconds) {
    if (!this.#at) this.begin(point);
    const jumped = Math.hypot(...point.map((x, i) => x - this.#target[i])) > JUMP;
    this.#target = [...point];
    const share = jumped ? 1 : 1 - Math.exp(-Math.max(seconds, 0) / TIME_CONSTANT);
    return this.#at.map((from, i) => {
      const shift = (point[i] - from) * share;
      this.#at[i] += shift;
      return shift;
    });
  }
}
