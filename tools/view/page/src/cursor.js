// The cursor of a recording: times on a plot of the whole recording.

/** The time at a pixel of a plot of this width that shows a recording of this length, s, within the recording. */
export function timeAt(pixel, width, length) {
  if (!(width > 0)) return 0;
  return Math.min(Math.max(pixel / width, 0), 1) * length;
}

/** Index of the newest of the rising times that is not later than a time; -1 if all are later. */
export function newestAt(times, time) {
  let [from, to] = [0, times.length];
  while (from < to) {
    const middle = (from + to) >> 1;
    if (times[middle] <= time) from = middle + 1;
    else to = middle;
  }
  return from - 1;
}

/** Lines of points [time, value] over the times of all of them, in order; null where a line has no point. */
export function aligned(curves) {
  const times = [...new Set(curves.flat().map(([time]) => time))].sort((one, other) => one - other);
  const index = new Map(times.map((time, at) => [time, at]));
  const lines = curves.map((points) => {
    const line = new Array(times.length).fill(null);
    for (const [time, value] of points) line[index.get(time)] = value;
    return line;
  });
  return [times, ...lines];
}
