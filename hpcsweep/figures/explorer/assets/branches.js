// Branches of periodic orbits beneath the orbit diagrams, and all that is known of one's point.

const NEAR = 10; // pixels from the pointer within which a point of a branch is pointed at

class Branches {
  constructor(study) {
    this.study = study;
    this.states = study.data.branch_point.length / (2 * study.nFloors);
    this.steps = study.data.branch_value.length;
  }

  of(frame) {
    return this.study.branches[frame] || [];
  }

  component(branch, k, turn, i) {
    return this.study.data.branch_point[i * this.states + branch.state + k * branch.period + turn];
  }

  draw(u, frame, floor, pointed) {
    const { branch_value: value, branch_stable: stable } = this.study.data;
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const ratio = window.devicePixelRatio || 1;
    for (const steady of [0, 1]) {
      ctx.lineWidth = (steady ? 2 : 0.8) * ratio;
      for (const branch of this.of(frame)) {
        ctx.strokeStyle = branch.colour;
        ctx.beginPath();
        for (let turn = 0; turn < branch.period; turn++) {
          for (let k = 0, open = false; k < branch.count; k++) {
            const own = stable[branch.step + k] && stable[branch.step + Math.max(k - 1, 0)];
            if (Boolean(own) !== Boolean(steady)) open = false;
            else {
              const at = (j) => [
                u.valToPos(value[branch.step + j], "x", true),
                u.valToPos(this.component(branch, j, turn, floor), "y", true)];
              if (!open) ctx.moveTo(...at(Math.max(k - 1, 0)));
              ctx.lineTo(...at(k));
              open = true;
            }
          }
        }
        ctx.stroke();
      }
    }
    if (pointed) {
      ctx.strokeStyle = "#000";
      ctx.fillStyle = pointed.branch.colour;
      ctx.lineWidth = 1.5 * ratio;
      for (let turn = 0; turn < pointed.branch.period; turn++) {
        ctx.beginPath();
        ctx.arc(
          u.valToPos(value[pointed.branch.step + pointed.k], "x", true),
          u.valToPos(this.component(pointed.branch, pointed.k, turn, floor), "y", true),
          4 * ratio, 0, 2 * Math.PI);
        ctx.fill();
        ctx.stroke();
      }
    }
    ctx.restore();
  }

  // The point of a branch next to a place of a diagram, null if none is near.
  nearest(u, frame, floor, x, y) {
    const value = this.study.data.branch_value;
    let [least, found] = [NEAR, null];
    for (const branch of this.of(frame)) {
      for (let k = 0; k < branch.count; k++) {
        const across = u.valToPos(value[branch.step + k], "x") - x;
        if (Math.abs(across) >= least) continue;
        for (let turn = 0; turn < branch.period; turn++) {
          const away = Math.hypot(across, u.valToPos(this.component(branch, k, turn, floor), "y") - y);
          if (away < least) [least, found] = [away, { branch, k }];
        }
      }
    }
    return found;
  }

  forcing({ branch, k }) {
    const [amplitude, omega] = [0, this.steps].map((o) => this.study.data.branch_forcing[o + branch.step + k]);
    return { amplitude, omega };
  }

  // Rows of the table of numbers.
  numbers(point) {
    const { study, steps } = this;
    const at = point.branch.step + point.k;
    const n = 2 * study.nFloors;
    const mu = (i) => {
      const [re, im] = [0, n].map((o) => study.data.branch_multiplier[(o + i) * steps + at]);
      const size = im ? ` (${shortNumber(Math.hypot(re, im), 3)})` : "";
      return shortNumber(re, 4) + (im ? `${im < 0 ? " − " : " + "}${shortNumber(Math.abs(im), 4)}i` : "") + size;
    };
    return [
      ["branch", String(point.branch.number)],
      ["period", `P${point.branch.period}`],
      ["motion", study.data.branch_stable[at] ? "stable" : "unstable"],
      ["contact set C", study.arrays.branch_contact.names[study.data.branch_contact[at]]],
      ...Array.from({ length: n }, (_, i) => [`multiplier μ${subscript(i + 1)}`, mu(i)]),
    ];
  }

  // The orbit, each forcing period integrated from its stored point, as an unstable one needs it;
  // with the contacts that close and open, and how far it is from closing.
  orbit(point) {
    const { study } = this;
    const { amplitude, omega } = this.forcing(point);
    const { structure } = study;
    const n = 2 * study.nFloors;
    const integrator = new Integrator(structure, amplitude, omega);
    const state = (turn) => Float64Array.from({ length: n }, (_, i) =>
      this.component(point.branch, point.k, turn % point.branch.period, i));
    const result = { line: [], points: [], closed: 0, signature: [], failed: false, periodic: true };
    const beyond = (z) => structure.contacts.map(({ direction, gap }) =>
      direction.reduce((sum, [i, d]) => sum + d * z[i], -gap));
    for (let turn = 0; turn < point.branch.period && !result.failed; turn++) {
      const z = state(turn);
      result.points.push(Float64Array.from(z));
      result.line.push(Float64Array.from(z));
      let [before, since] = [beyond(z), 0];
      result.failed = !integrator.advance(z, (now, tau) => {
        result.line.push(Float64Array.from(now));
        const after = beyond(now);
        after.forEach((x, c) => {
          if (x > 0 === before[c] > 0) return;
          const at = since + ((tau - since) * before[c]) / (before[c] - x);
          result.signature.push({ contact: c, closes: x > 0, phase: turn + at / integrator.period });
        });
        [before, since] = [after, tau];
      });
      result.closed = Math.max(result.closed, distance(state(turn + 1), z, structure.units));
    }
    result.colour = point.branch.colour;
    return result;
  }

  words(orbit) {
    const sequence = orbit.signature
      .map(({ contact, closes, phase }) =>
        `${this.study.structure.contacts[contact].name} ${closes ? "closes" : "opens"} ${phase.toFixed(3)}`);
    return `Signature, in forcing periods: ${sequence.join(", ") || "no contact"}. Each period is ` +
      `integrated in this page from its stored point; the next is met to ${shortNumber(orbit.closed, 2)}.`;
  }
}
