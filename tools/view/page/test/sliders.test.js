import assert from "node:assert/strict";
import { test } from "node:test";
import { isLogarithmic, readable, scaleOf } from "../src/sliders.js";

const GAIN = { default: 5, min: 0, max: 1000 };
const STIFFNESS = { default: 300, min: 1e-3, max: 1e6 };
const SPEED = { default: 1, min: 0, max: 2 };

test("gains are logarithmic and factors are not", () => {
  assert.deepEqual([GAIN, STIFFNESS, SPEED].map(isLogarithmic), [true, true, false]);
  assert.equal(isLogarithmic({ default: 0, min: 0, max: 1000 }), false, "the default does not indicate a usual size");
  assert.equal(isLogarithmic({ default: 1, min: -1000, max: 1000 }), false);
});

test("ends of a slider are the limits of its parameter", () => {
  for (const parameter of [GAIN, STIFFNESS, SPEED, { default: 0, min: -3, max: 5 }]) {
    const { valueAt, positionOf } = scaleOf(parameter);
    assert.deepEqual([valueAt(0), valueAt(1)], [parameter.min, parameter.max]);
    assert.ok(Math.abs(positionOf(parameter.min)) < 1e-12 && Math.abs(positionOf(parameter.max) - 1) < 1e-12);
  }
});

test("values rise with the position and come back to it", () => {
  for (const parameter of [GAIN, STIFFNESS, SPEED]) {
    const { valueAt, positionOf } = scaleOf(parameter);
    let last = -Infinity;
    for (let position = 0; position <= 1; position += 0.01) {
      const value = valueAt(position);
      assert.ok(value >= last && value >= parameter.min && value <= parameter.max, `${value} after ${last}`);
      last = value;
      if (value > 0) assert.ok(Math.abs(positionOf(value) - position) < 2e-3, `${position}: ${value}, ${positionOf(value)}`);
    }
  }
});

test("equal distances on a logarithmic slider are equal factors", () => {
  const { valueAt } = scaleOf(STIFFNESS);
  for (const position of [0.1, 0.4, 0.7]) {
    const factor = valueAt(position + 0.2) / valueAt(position);
    // 9 decades over the whole slider
    assert.ok(Math.abs(Math.log10(factor) - 1.8) < 0.01, `${factor}`);
  }
});

test("a logarithmic slider reaches zero and a value near the default", () => {
  const { valueAt, positionOf } = scaleOf(GAIN);
  assert.equal(valueAt(0.01), 0);
  assert.equal(positionOf(0), 0);
  const at = positionOf(GAIN.default);
  assert.ok(at > 0.3 && at < 0.8, `${at}`);
  assert.equal(valueAt(at), 5);
});

test("names of parameters are readable", () => {
  assert.equal(readable("left_foot_position_weight"), "left foot position weight");
});
