// Statistics over the stripes of records, as hpcsweep.earthquakes has them: counted fractiles,
// capacities, and the lognormal fragility of largest likelihood with its 95 % band.

const ROUNDED = 1e-9; // by which p n may exceed a whole number through rounding
const QUANTILE = 1.959963984540054; // of the normal distribution, for 95 %

// The known ones of some values, ascending.
function ascending(values) {
  return Float64Array.from(values).filter((value) => !Number.isNaN(value)).sort();
}

// Counted fractile of ascending values: the smallest that a part of them does not exceed.
function fractile(sorted, part) {
  const n = sorted.length;
  return n ? sorted[Math.max(Math.ceil(part * n - ROUNDED), 1) - 1] : NaN;
}

// Fractile of responses that meets that of capacities: the value after, where p n is whole.
function responseFractile(sorted, part) {
  const n = sorted.length;
  return n ? sorted[n - Math.max(Math.ceil((1 - part) * n - ROUNDED), 1)] : NaN;
}

// Median of ascending values: of an even number the mean of the middle two.
function median(sorted) {
  return 0.5 * (fractile(sorted, 0.5) + responseFractile(sorted, 0.5));
}

// Capacity of a record with a response at each of the scales, and how often it crosses later.
function capacity(scales, responses, threshold) {
  const reached = Array.from(responses, (value) => value >= threshold);
  const first = reached.indexOf(true);
  const before = first < 0 ? scales.length : first;
  const crossings = reached.filter((own, k) => k && own !== reached[k - 1]).length;
  const later = crossings - (first > 0);
  for (let k = 0; k < before; k++) if (Number.isNaN(responses[k])) return { scale: NaN, later };
  if (first < 0) return { scale: Infinity, later };
  const [low, below] = first ? [responses[first - 1], scales[first - 1]] : [0, 0];
  const high = responses[first];
  const share = high === Infinity ? 0.5
    : Math.min(1, Math.max(0, (threshold - low) / (high > low ? high - low : 1)));
  return { scale: below + share * (scales[first] - below), later };
}

// Logarithm of the normal distribution, to 1.2e-7 of its value (Press et al., erfcc).
function logNormal(x) {
  const z = Math.abs(x) / Math.SQRT2;
  const t = 1 / (1 + 0.5 * z);
  const c = [0.17087277, -0.82215223, 1.48851587, -1.13520398, 0.27886807, -0.18628806, 0.09678418,
    0.37409196, 1.00002368, -1.26551223];
  const tail = Math.log(0.5 * t) - z * z + c.reduce((sum, own) => sum * t + own, 0);
  return x > 0 ? Math.log1p(-Math.exp(tail)) : tail;
}

// Fit capacities above 0, with `never` more records above the scale `last`: largest likelihood of
// h(x) = b0 + b1 ln x, by Newton's method with halved steps (hpcsweep.earthquakes.fragility).
function fitCapacities(found, never, last) {
  const logs = Array.from(found, Math.log);
  const n = logs.length;
  if (new Set(found).size < 2) return null;
  const s1 = logs.reduce((sum, x) => sum + x, 0);
  const s2 = logs.reduce((sum, x) => sum + x * x, 0);
  const end = Math.log(last);
  const likelihood = ([b0, b1]) => b1 > 0
    ? n * Math.log(b1) - 0.5 * (n * b0 * b0 + 2 * b0 * b1 * s1 + b1 * b1 * s2)
      + (never ? never * logNormal(-b0 - b1 * end) : 0)
    : -Infinity;
  const slopes = ([b0, b1]) => {
    const h = b0 + b1 * end;
    const m = never ? Math.exp(-0.5 * h * h - 0.5 * Math.log(2 * Math.PI) - logNormal(-h)) : 0;
    const weight = never * m * (m - h);
    return {
      gradient: [-n * b0 - b1 * s1 - never * m, n / b1 - b0 * s1 - b1 * s2 - never * m * end],
      curves: [n + weight, s1 + weight * end, s2 + n / (b1 * b1) + weight * end * end],
    };
  };
  const inverse = ([a, b, d]) => [d, -b, a].map((entry) => entry / (a * d - b * b));
  const mean = s1 / n;
  const spread = Math.sqrt(logs.reduce((sum, x) => sum + (x - mean) ** 2, 0) / n);
  let b = [-mean / spread, 1 / spread];
  let value = likelihood(b);
  for (let gained = Infinity, turn = 0; gained > 1e-12 * (n + never) && turn < 200; turn++) {
    const { gradient: [g0, g1], curves } = slopes(b);
    const [a, c, d] = inverse(curves);
    let next, part = 1;
    do {
      next = [b[0] + part * (a * g0 + c * g1), b[1] + part * (c * g0 + d * g1)];
      gained = likelihood(next) - value;
      part *= 0.5;
    } while (gained < 0 && part > 1e-10);
    if (gained > 0) [b, value] = [next, value + gained];
  }
  const [b0, b1] = b;
  const [v0, v01, v1] = inverse(slopes(b).curves);
  return {
    median: Math.exp(-b0 / b1),
    dispersion: 1 / b1,
    // probability at an intensity, and the ends of its band
    at: (x) => {
      const log = Math.log(x);
      const wide = QUANTILE * Math.sqrt(v0 + log * (2 * v01 + log * v1));
      return [0, -wide, wide].map((off) => Math.exp(logNormal(b0 + b1 * log + off)));
    },
  };
}
