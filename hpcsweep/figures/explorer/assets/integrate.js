// The equations of motion (equations.py) integrated in the page, by Dormand and Prince's 5(4).

const TOLERANCE = 1e-8; // of a step, in the structure's units of a state
const CLOSED = 1e-6; // an orbit ends where it began
const SETTLING_ORBITS = 60;
const CHAOS_PERIODS = 100;
const CHAOS_DRAWN = 25;
const LONGEST_STEP = 1 / 120; // of the shortest period of the forcing, for a smooth line
const MOST_STEPS = 200000; // of a forcing period

// A contact is active for x = direction . u - gap > 0 and adds -push S(rho x) x to u''.
function accelerations(structure, amplitude, omega) {
  const { floors: n, rho, stiffness, damping, forcing, harmonics, contacts } = structure;
  return (tau, z, out) => {
    let ground = 0;
    for (const [order, size, phase] of harmonics) {
      ground += amplitude * size * Math.sin(order * omega * tau + phase);
    }
    for (let i = 0; i < n; i++) {
      let a = ground * forcing[i];
      const k = stiffness[i];
      const d = damping[i];
      for (let j = 0; j < n; j++) a -= k[j] * z[j] + d[j] * z[n + j];
      out[i] = z[n + i];
      out[n + i] = a;
    }
    for (const { direction, gap, push } of contacts) {
      let x = -gap;
      for (const [i, d] of direction) x += d * z[i];
      let s;
      if (rho === null) s = x > 0 ? 1 : x < 0 ? 0 : 0.5;
      else s = 1 / (1 + Math.exp(-rho * x));
      if (s === 0) continue;
      for (const [i, p] of push) out[n + i] -= p * s * x;
    }
  };
}

const DP = [
  [1 / 5],
  [3 / 40, 9 / 40],
  [44 / 45, -56 / 15, 32 / 9],
  [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
  [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
  [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
];
const DP_TIME = [1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1];
const DP_ERROR = [
  71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40,
];

// Carries a state through forcing periods; `visit`, if given, sees every accepted state.
class Integrator {
  constructor(structure, amplitude, omega) {
    this.f = accelerations(structure, amplitude, omega);
    this.period = (2 * Math.PI) / omega;
    this.size = 2 * structure.floors;
    this.k = Array.from({ length: 7 }, () => new Float64Array(this.size));
    this.units = structure.units;
    const orders = structure.harmonics.map(([order]) => order);
    this.longest = (this.period * LONGEST_STEP) / Math.max(...orders);
    this.step = this.longest;
  }

  advance(z, visit) {
    const { f, k, size, period, longest, units } = this;
    const half = size / 2;
    const next = new Float64Array(size);
    let tau = 0;
    let h = Math.min(this.step, longest);
    f(0, z, k[0]);
    for (let count = 0; count < MOST_STEPS; count++) {
      const last = tau + h >= period * (1 - 1e-14);
      const used = last ? period - tau : h;
      for (let s = 0; s < 6; s++) {
        for (let i = 0; i < size; i++) {
          let sum = 0;
          for (let j = 0; j <= s; j++) sum += DP[s][j] * k[j][i];
          next[i] = z[i] + used * sum;
        }
        f(tau + DP_TIME[s] * used, next, k[s + 1]);
      }
      let error = 0;
      for (let i = 0; i < size; i++) {
        let e = 0;
        for (let j = 0; j < 7; j++) e += DP_ERROR[j] * k[j][i];
        const scale = TOLERANCE * (units[i < half ? 0 : 1] + Math.max(Math.abs(z[i]), Math.abs(next[i])));
        error = Math.max(error, Math.abs(used * e) / scale);
      }
      if (!(error < Infinity)) return false;
      const factor = Math.min(4, Math.max(0.2, 0.9 * Math.max(error, 1e-10) ** -0.2));
      if (error <= 1) {
        tau += used;
        z.set(next);
        k[0].set(k[6]);
        if (visit) visit(z, tau);
        if (last) return true;
      }
      if (!last || error > 1) h = Math.min(used * factor, longest);
      this.step = h;
    }
    return false;
  }
}

// The largest difference of two states in their units.
function distance(a, b, units) {
  let most = 0;
  const half = a.length / 2;
  for (let i = 0; i < a.length; i++) {
    most = Math.max(most, Math.abs(a[i] - b[i]) / units[i < half ? 0 : 1]);
  }
  return most;
}

// The orbit of a run from a rounded point of it. Leaves the browser time between periods.
// Returns null if `cancelled` says so, else {line, points, closed, settling, failed}; line and
// points are arrays of states.
async function orbitFrom(structure, amplitude, omega, start, period, cancelled) {
  const integrator = new Integrator(structure, amplitude, omega);
  const z = Float64Array.from(start);
  const result = { line: [], points: [], closed: NaN, settling: 0, failed: false };
  let since = performance.now();
  const rest = async () => {
    if (performance.now() - since > 10) {
      await new Promise((resume) => setTimeout(resume, 0));
      since = performance.now();
    }
    return cancelled();
  };
  const visit = (state) => result.line.push(Float64Array.from(state));
  if (!period) {
    for (let j = 0; j < CHAOS_PERIODS; j++) {
      result.points.push(Float64Array.from(z));
      if (j === 0) visit(z);
      if (!integrator.advance(z, j < CHAOS_DRAWN ? visit : null)) result.failed = true;
      if (result.failed || (await rest())) break;
    }
    return cancelled() ? null : result;
  }
  for (let orbit = 0; orbit <= SETTLING_ORBITS; orbit++) {
    const before = Float64Array.from(z);
    result.line = [before];
    result.points = [];
    for (let j = 0; j < period; j++) {
      result.points.push(Float64Array.from(z));
      if (!integrator.advance(z, visit)) {
        result.failed = true;
        return result;
      }
      if (await rest()) return null;
    }
    result.closed = distance(before, z, structure.units);
    result.settling = orbit * period;
    if (result.closed < CLOSED) break;
  }
  return result;
}
