import assert from "node:assert/strict";
import { test } from "node:test";
import { Follow, framingDistance } from "../src/follow.js";

const near = (one, other, tolerance = 1e-9) => assert.ok(Math.abs(one - other) < tolerance, `${one}, expected ${other}`);

/** Frames of a base that moves along x at this speed, m/s: the distance of the camera behind it after the last. */
function behind(follow, speed, seconds, fps) {
  follow.begin([0, 0, 0]);
  let [base, camera] = [0, 0];
  for (let frame = 0; frame < seconds * fps; frame += 1) {
    base += speed / fps;
    camera += follow.step([base, 0, 0], 1 / fps)[0];
  }
  return base - camera;
}

test("camera stays a fixed distance behind a walking base", () => {
  // A first-order lag of 0.25 s behind a ramp of 0.8 m/s is 0.2 m late, at any rate of frames that is not far below.
  near(behind(new Follow(), 0.8, 10, 200), 0.2, 0.002);
  near(behind(new Follow(), 0.8, 20, 200), behind(new Follow(), 0.8, 10, 200), 1e-9);
  assert.ok(behind(new Follow(), 0.8, 10, 8) < 0.2);
});

test("camera reaches a base that has stopped", () => {
  const follow = new Follow();
  follow.begin([0, 0, 0]);
  let camera = 0;
  for (let frame = 0; frame < 300; frame += 1) camera += follow.step([0.5, 0, 0], 0.01)[0];
  near(camera, 0.5, 1e-4);
  assert.deepEqual(follow.step([0.5, 0, 0], 0), [0, 0, 0]);
});

test("camera jumps with a base that is placed elsewhere", () => {
  const follow = new Follow();
  follow.begin([0, 0, 0.3]);
  assert.deepEqual(follow.step([5, -1, 0.3], 0.016), [5, -1, 0]);
});

test("camera ignores the time in which it did not follow", () => {
  const follow = new Follow();
  follow.begin([0, 0, 0]);
  follow.begin([1, 0, 0]);
  assert.deepEqual(follow.step([1, 0, 0], 10), [0, 0, 0]);
});

test("framed points fill the picture and none is outside", () => {
  const corners = [-1, 1].flatMap((x) => [-1, 1].flatMap((y) => [-1, 1].map((z) => [0.2 * x, 0.3 * y, 0.9 * z])));
  for (const [from, aspect] of [[[1, 0, 0], 1.2], [[0.8, -0.72, 0.31], 1.2], [[0.8, -0.72, 0.31], 0.4]]) {
    const length = Math.hypot(...from);
    const back = from.map((x) => x / length);
    const distance = framingDistance(corners, from, 34, aspect, 0.9);
    // Projected by hand: right is z cross back, up is back cross right.
    const [flat] = [Math.hypot(back[0], back[1])];
    const right = [-back[1] / flat, back[0] / flat, 0];
    const up = [-back[2] * right[1], back[2] * right[0], flat];
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const tan = Math.tan((17 * Math.PI) / 180);
    const seen = corners.map((corner) => {
      const depth = distance - dot(corner, back);
      return Math.max(Math.abs(dot(corner, right)) / depth / tan / aspect, Math.abs(dot(corner, up)) / depth / tan);
    });
    near(Math.max(...seen), 0.9, 1e-9);
  }
});
