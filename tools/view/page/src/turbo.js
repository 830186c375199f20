// The colour map turbo: from dark blue over green to dark red, evenly bright, so that steps of depth are visible.
// https://research.google/blog/turbo-an-improved-rainbow-colormap-for-visualization/

/** Every 15th of the 256 colours. */
const KNOTS =
  "30123b3f3e9c4666dd458cfd2fb2f41ad4d022ebaa52fa7a8bff4bb7f735dbe236f5c53afea130f9751de84b0cce2d04a916017a0403";
const APART = 15;

const knots = KNOTS.match(/.{6}/g).map((knot) => knot.match(/../g).map((part) => parseInt(part, 16)));

/** The 256 colours as red, green and blue, interpolated linearly: within 6 of 255 of the original. */
export const COLOURS = Array.from({ length: 256 }, (_, index) => {
  const below = Math.min(Math.floor(index / APART), knots.length - 2);
  const share = index / APART - below;
  return knots[below].map((part, at) => Math.round(part + share * (knots[below + 1][at] - part)));
});
