import assert from "node:assert/strict";
import { test } from "node:test";
import { LEVELS, Quality } from "../src/quality.js";

/** Draws frames for a time at the rate that the renderer reaches on each level; the levels of each second. */
function run(quality, seconds, rates, from = 0) {
  const levels = [];
  let now = from;
  for (let second = 0; second < seconds; second += 1) {
    const end = from + 1000 * (second + 1);
    while (now < end) {
      now += 1000 / rates(quality.level);
      quality.frame(now);
    }
    levels.push(quality.level);
  }
  return levels;
}

const BEST = LEVELS.length - 1;

test("levels grow in cost and only the better ones have shadows", () => {
  assert.deepEqual(LEVELS.map(({ shadow }) => shadow > 0), [false, false, false, true, true]);
  for (const [level, { ratio }] of LEVELS.slice(1).entries()) assert.ok(ratio >= LEVELS[level].ratio);
});

test("a slow renderer loses shadows within seconds and then stays", () => {
  const quality = new Quality(BEST);
  const levels = run(quality, 20, (level) => [30, 20, 8, 5, 3][level]);
  assert.ok(LEVELS[levels[3]].shadow === 0, `${levels}`);
  assert.deepEqual(levels.slice(6), levels.slice(6).map(() => 1));
});

test("a fast renderer rises to the best level", () => {
  const levels = run(new Quality(1), 30, () => 60);
  assert.equal(levels.at(-1), BEST);
  assert.equal(levels[1], 1, "it does not rise immediately");
});

test("a rate between slow and fast changes nothing", () => {
  const levels = run(new Quality(2), 30, () => 25);
  assert.deepEqual(new Set(levels), new Set([2]));
});

test("a level that does not last is tried more and more rarely", () => {
  const quality = new Quality(1);
  const levels = run(quality, 600, (level) => (level >= 2 ? 6 : 60));
  const tries = levels.map((level, second) => (level === 2 && levels[second - 1] === 1 ? second : 0)).filter(Boolean);
  assert.ok(tries.length >= 3 && tries.length < 10, `${tries}`);
  const gaps = tries.slice(1).map((second, index) => second - tries[index]);
  assert.ok(gaps.every((gap, index) => index === 0 || gap > gaps[index - 1]), `${gaps}`);
});

test("a hidden page is not a slow renderer", () => {
  const quality = new Quality(BEST);
  let now = 0;
  for (let hour = 0; hour < 5; hour += 1) {
    run(quality, 2, () => 60, now);
    now += 3_600_000;
  }
  assert.equal(quality.level, BEST);
});
