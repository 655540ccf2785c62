// The orbit diagrams of one frame: stroboscopic displacement of some floors against A.

// The unit of a quantity behind a label, or behind a number; nothing where it has no name.
function unit(study, quantity) {
  const name = study.unitNames[quantity];
  return name ? ` [${name}]` : "";
}

function inUnit(study, quantity) {
  const name = study.unitNames[quantity];
  return name ? ` ${name}` : "";
}

function subscript(number) {
  return String(number).replace(/\d/g, (d) => "₀₁₂₃₄₅₆₇₈₉"[d]);
}

// The ends of an axis; values that differ by rounding are drawn as equal.
function padded(low, high, share = 0.07) {
  const same = high - low <= 1e-6 * Math.max(Math.abs(low), Math.abs(high));
  const margin = (same ? 0.05 * Math.abs(high) : share * (high - low)) || 0.05;
  return [low - margin, high + margin];
}

// Name a floor (index from 0) behind the letter of its displacement or velocity.
function floorName(study, floor) {
  const { names } = study.structure;
  return names.length ? ` ${names[floor]}` : subscript(floor + 1);
}

// A frequency or an amplitude with its unit where the units have names, in cycles as well.
function omegaWords(study, omega) {
  const { cycles } = study.unitNames;
  return shortNumber(omega, 6) + (cycles
    ? `${inUnit(study, "frequency")} = ${shortNumber(omega / (2 * Math.PI), 6)} ${cycles}` : "");
}

function amplitudeWords(study, amplitude) {
  return shortNumber(amplitude, 6) + (study.unitNames.cycles ? inUnit(study, "acceleration") : "");
}

// What drives a run: of a sweep along another parameter each has a forcing, or a structure, of
// its own; `amplitude` and `omega` of the study are then the values along the axes.
function drive(study, frame, amplitude) {
  const { steps } = study;
  return steps
    ? { structure: steps.structures[amplitude] ?? study.structure,
      amplitude: steps.amplitude[frame][amplitude], omega: steps.omega[frame][amplitude] }
    : { structure: study.structure, amplitude: study.amplitude[amplitude], omega: study.omega[frame] };
}

// The forcing of a run, after the value of a key that the sweep is along.
function placeWords(study, frame, amplitude) {
  const run = drive(study, frame, amplitude);
  const { key, quantity } = study.axes.x;
  const along = key ? `${key} = ${shortNumber(study.amplitude[amplitude], 6)}${inUnit(study, quantity)}, ` : "";
  return `${along}A = ${amplitudeWords(study, run.amplitude)}, Ω = ${omegaWords(study, run.omega)}`;
}

// What a frame has in common.
function frameWords(study, frame) {
  const value = study.omega[frame];
  const words = { frequency: () => ` at Ω = ${omegaWords(study, value)}`, acceleration: () => ` at A = ${amplitudeWords(study, value)}` };
  return words[study.axes.y.quantity]?.() ?? "";
}

function axisLabel(study, axis) {
  const { label, quantity } = study.axes[axis];
  return label + unit(study, quantity);
}

const LEAST_PANEL = 64; // height of a floor's diagram in pixels
const LABELLED_PANEL = 92; // least height with room for the whole label
function horizontalLine(u, y, colour) {
  if (y < u.scales.y.min || y > u.scales.y.max) return;
  const at = u.valToPos(y, "y", true);
  u.ctx.save();
  u.ctx.strokeStyle = colour;
  u.ctx.setLineDash([6, 4]);
  u.ctx.beginPath();
  u.ctx.moveTo(u.bbox.left, at);
  u.ctx.lineTo(u.bbox.left + u.bbox.width, at);
  u.ctx.stroke();
  u.ctx.restore();
}

class OrbitDiagrams {
  // `events`: choose(amplitude index), zoom(range of A or null), branch(point or null)
  constructor(element, study, events) {
    this.element = element;
    this.study = study;
    this.events = events;
    this.range = null;
    Object.assign(this, { frame: 0, direction: 0, amplitude: 0 });
    this.panels = [];
    this.edges = cellEdges(study.amplitude);
    this.everyFrame = null;
    this.branches = study.branches.length ? new Branches(study) : null;
    this.pointed = null; // point of a branch
    this.motion = null; // quantity that colours the points; null: their direction
    this.axis = LEAST_AXIS; // width of the numbers beside all panels
  }

  // Make a panel for each of the floors (indices from 0), the top one first.
  layout(floors) {
    for (const panel of this.panels) panel.plot.destroy();
    this.element.replaceChildren();
    this.axis = LEAST_AXIS;
    this.panels = [...floors].reverse().map((floor, place) => {
      const panel = { floor, y: [0, 1], canvas: document.createElement("canvas") };
      panel.plot = new uPlot(
        this.options(panel, place === floors.length - 1, floors.length),
        [this.range, [null, null]], this.element);
      panel.plot.over.addEventListener("click", (event) => this.click(panel, event));
      panel.plot.over.addEventListener("pointerdown", (e) => (panel.down = e.clientX));
      panel.plot.over.addEventListener("dblclick", () => this.events.zoom(null));
      if (this.branches) {
        panel.plot.over.addEventListener("pointermove", (event) => this.point(panel, event));
        panel.plot.over.addEventListener("pointerleave", () => this.events.branch(null));
      }
      return panel;
    });
  }

  size(last, count) {
    const room = Math.max(240, 0.44 * window.innerHeight);
    const width = Math.max(320, this.element.clientWidth);
    const height = Math.max(LEAST_PANEL, Math.round(room / count));
    return { width, height: height + (last ? 36 : 0) };
  }

  // Whether the panels are high enough for labels with units.
  labelled(count = this.panels.length) {
    return this.size(false, count).height >= LABELLED_PANEL;
  }

  options(panel, last, count) {
    const size = this.size(last, count);
    const whole = this.labelled(count) ? `(jT)${unit(this.study, "length")}` : "";
    const name = `u${floorName(this.study, panel.floor)}${whole}`;
    return {
      ...size,
      padding: [5, 12, last ? 0 : 3, 0],
      scales: { x: { time: false, range: () => this.range }, y: { range: () => panel.y } },
      series: [{}, { show: false }],
      legend: { show: false },
      cursor: {
        points: { show: false }, y: false,
        drag: { x: true, y: false, setScale: false }, sync: { key: "diagrams" },
      },
      axes: [
        last
          ? { ...AXIS, label: axisLabel(this.study, "x"), labelSize: 18, labelFont: AXIS.font, size: 24 }
          : { ...AXIS, size: 4, values: () => [] },
        { ...AXIS, label: name, labelSize: 18, labelFont: AXIS.font, size: () => this.axis, space: 24 },
      ],
      hooks: {
        draw: [(u) => this.draw(u, panel), (u) => this.widen(u)],
        setSelect: [(u) => this.zoomToSelection(u)],
      },
    };
  }

  click(panel, event) {
    if (Math.abs(event.clientX - panel.down) > 4) return;
    const box = panel.plot.over.getBoundingClientRect();
    const share = (event.clientX - box.left) / box.width;
    const cell = cellOf(this.edges, this.range[0] + share * (this.range[1] - this.range[0]));
    if (cell >= 0) this.events.choose(cell);
  }

  point({ plot, floor }, event) {
    const box = plot.over.getBoundingClientRect();
    const place = [event.clientX - box.left, event.clientY - box.top];
    this.events.branch(this.branches.nearest(plot, this.frame, floor, ...place));
  }

  zoomToSelection(u) {
    if (u.select.width < 6) return;
    const at = (left) => u.posToVal(left, "x");
    const range = [at(u.select.left), at(u.select.left + u.select.width)];
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.events.zoom(range);
  }

  // Show a frame; `direction` is drawn on top, `amplitude` is marked.
  show(frame, direction, amplitude, hold) {
    Object.assign(this, { frame, direction, amplitude });
    for (const panel of this.panels) {
      panel.y = this.verticalRange(panel.floor, hold);
      panel.plot.setData([this.range, [null, null]], true);
    }
  }

  // Make room beside all panels for the longest numbers of one.
  widen(u) {
    const needed = axisSize(u.axes[1]._values);
    if (needed <= this.axis) return;
    this.axis = needed;
    queueMicrotask(() => this.panels.forEach(({ plot }) => plot.redraw(false, true)));
  }

  verticalRange(floor, hold) {
    if (!this.study.data.points) return [0, 1];
    const ranges = this.study.arrays.points.ranges;
    if (!hold) return padded(...ranges[this.frame][floor]);
    if (!this.everyFrame) {
      this.everyFrame = ranges[0].map((_, i) => [
        Math.min(...ranges.map((r) => r[i][0])), Math.max(...ranges.map((r) => r[i][1]))]);
    }
    return padded(...this.everyFrame[floor]);
  }

  draw(u, panel) {
    const { amplitude, range, study } = this;
    for (const stop of study.structure.stops[panel.floor]) {
      horizontalLine(u, stop, study.colours.stop);
    }
    if (this.branches) this.branches.draw(u, this.frame, panel.floor, this.pointed);
    if (study.data.points) {
      this.paint(u, panel);
      u.ctx.drawImage(panel.canvas, u.bbox.left, u.bbox.top);
    }
    const grazing = study.grazing[this.frame];
    if (grazing >= range[0] && grazing <= range[1]) {
      const at = u.valToPos(grazing, "x", true);
      u.ctx.fillStyle = study.colours.grazing;
      u.ctx.fillRect(at - 0.5, u.bbox.top, 1, u.bbox.height);
    }
    const a = study.amplitude[amplitude];
    if (a >= range[0] && a <= range[1]) {
      const at = u.valToPos(a, "x", true);
      u.ctx.fillStyle = "rgba(0, 0, 0, 0.45)";
      u.ctx.fillRect(at - 0.5, u.bbox.top, 1, u.bbox.height);
    }
  }

  paint(u, panel) {
    const { canvas, floor } = panel;
    const { study, frame } = this;
    const width = Math.max(1, Math.round(u.bbox.width));
    const height = Math.max(1, Math.round(u.bbox.height));
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    const context = canvas.getContext("2d");
    if (!panel.image || panel.image.width !== width || panel.image.height !== height) {
      panel.image = context.createImageData(width, height);
      panel.pixels = new Uint32Array(panel.image.data.buffer);
    }
    const pixels = panel.pixels.fill(0);
    const { points, counts } = study.data;
    const [low, high] = study.arrays.points.ranges[frame][floor];
    const [from, to] = [u.scales.y.min, u.scales.y.max];
    const scale = height / (to - from);
    const step = (scale * (high - low)) / (2 ** study.bits - 2);
    const base = (to - low) * scale + step;
    const offset = floor * study.nPoints;
    const shared = Math.round(window.devicePixelRatio || 1);
    const sparse = width / study.nAmplitudes > 3 * shared ? 1 : 0;
    const order = study.directions.map((_, d) => d).filter((d) => d !== this.direction);
    for (const direction of [...order, this.direction]) {
      const first = study.run(frame, direction, 0);
      const own = pixel(study.colours.directions[direction]);
      const large = ((direction === this.direction ? 2 : 3) + sparse) * shared;
      for (let a = 0; a < study.nAmplitudes; a++) {
        // large where an orbit was found and fine elsewhere, as in the figures
        const side = study.data.period[first + a] ? large : (1 + sparse) * shared;
        const half = side >> 1;
        const share = (study.amplitude[a] - this.range[0]) / (this.range[1] - this.range[0]);
        const x = Math.round(share * width) - half;
        if (x < 0 || x + side > width) continue;
        const colour = this.motion ? pixel(this.motion.colour(first + a)) : own;
        const start = offset + study.starts[first + a];
        const end = start + counts[first + a];
        for (let i = start; i < end; i++) {
          const y = Math.round(base - points[i] * step) - half;
          if (y < 0 || y + side > height) continue;
          for (let dy = 0, at = y * width + x; dy < side; dy++, at += width) {
            for (let dx = 0; dx < side; dx++) pixels[at + dx] = colour;
          }
        }
      }
    }
    context.putImageData(panel.image, 0, 0);
  }

  resize() {
    const count = this.panels.length;
    this.panels.forEach((p, i) => p.plot.setSize(this.size(i === count - 1, count)));
  }
}
