// Positions of a slider and values of its parameter, and displayed names of parameters.

/** Ratio of range to default from which a slider is logarithmic: equal distances are equal factors. */
const WIDE = 20;
/** Fraction of the slider at its lower end that represents 0 on a logarithmic scale from 0. */
const ZERO = 0.02;
/** Factor between the smallest number other than 0 and the largest, on a logarithmic scale from 0. */
const DECADES = 1e6;
/** Significant digits of a value on a logarithmic scale. */
const DIGITS = 3;

/** True if a slider of a parameter with this range is logarithmic, as it is for gains. */
export function isLogarithmic({ default: initial, min, max }) {
  if (!(min >= 0 && max > min)) return false;
  const usual = initial > 0 ? initial : min;
  return usual > 0 && max / usual >= WIDE;
}

/** The scale of a slider with positions from 0 to 1: converts positions to values and back. */
export function scaleOf(parameter) {
  const { min, max } = parameter;
  if (!isLogarithmic(parameter)) {
    return { valueAt: (position) => min + position * (max - min), positionOf: (value) => (value - min) / (max - min) };
  }
  const least = min > 0 ? min : Math.min(max / DECADES, parameter.default / 100);
  const zero = min > 0 ? 0 : ZERO;
  const span = Math.log(max / least);
  const valueAt = (position) => {
    if (position <= 0) return min;
    if (position >= 1) return max;
    if (position < zero) return 0;
    const value = least * Math.exp((span * (position - zero)) / (1 - zero));
    return Math.min(Math.max(Number(value.toPrecision(DIGITS)), min), max);
  };
  const positionOf = (value) => (value < least ? 0 : zero + ((1 - zero) * Math.log(value / least)) / span);
  return { valueAt, positionOf };
}

/** A name of a graph as text: `kp_scale` is "kp scale". */
export const readable = (name) => name.replaceAll("_", " ");
