// Steps of axes, and places in columns of times.

/** The last index whose time is at or before `time`; -1: none. */
export function lastBefore(count: number, timeOf: (index: number) => number, time: number): number {
  let low = 0;
  let high = count;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (timeOf(middle) <= time) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** A step between ticks that is 1, 2 or 5 times a power of ten, so that there are at most `most`. */
export function niceStep(range: number, most: number): number {
  const rough = range / Math.max(1, most);
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((n) => n * power).find((step) => step >= rough * 0.999) ?? 10 * power;
}

/** Steps of a clock: 1, 2, 5, 10, 15, 30 s, 1, 2, 5, 10 min. */
export function clockStep(range: number, most: number): number {
  return [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1800, 3600].find((step) => range / step <= most) ?? 7200;
}
