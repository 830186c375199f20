import assert from "node:assert/strict";
import { test } from "node:test";
import { aligned, newestAt, timeAt } from "../src/cursor.js";

test("a dragged cursor stays within the recording", () => {
  assert.deepEqual([-20, 0, 100, 400, 900].map((pixel) => timeAt(pixel, 400, 8)), [0, 0, 2, 8, 8]);
  assert.equal(timeAt(10, 0, 8), 0, "a plot without a width");
});

test("the newest value is the one before the cursor", () => {
  const times = [0, 0.5, 0.5, 2];
  assert.deepEqual([-1, 0, 0.4, 0.5, 1.9, 2, 9].map((time) => newestAt(times, time)), [-1, 0, 0, 2, 2, 3, 3]);
  assert.equal(newestAt([], 1), -1);
});

test("curves with different times share one axis", () => {
  const [times, first, second] = aligned([[[0, 1], [2, 3]], [[1, 5], [2, 6]]]);
  assert.deepEqual(times, [0, 1, 2]);
  assert.deepEqual([first, second], [[1, null, 3], [null, 5, 6]]);
  assert.deepEqual(aligned([]), [[]]);
});
