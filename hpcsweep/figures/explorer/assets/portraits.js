// Phase portraits of the selected run: (u, v) of some floors, orbit and stroboscopic points.

const [SMALL_IN_A_ROW, LARGE_IN_A_ROW] = [3, 4];

class Portraits {
  constructor(element, study) {
    this.element = element;
    this.study = study;
    this.panels = [];
    this.orbit = null;
    this.large = false;
    element.addEventListener("click", () => this.enlarge(!this.large));
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.enlarge(false);
    });
  }

  // Show the portraits over the whole window, or in their place.
  enlarge(large) {
    if (large === this.large) return;
    this.large = large;
    this.element.classList.toggle("large", large);
    this.resize();
  }

  layout(floors) {
    for (const panel of this.panels) panel.plot.destroy();
    this.element.replaceChildren();
    this.panels = floors.map((floor) => {
      const panel = { floor, x: [0, 1], y: [0, 1] };
      panel.plot = new uPlot(this.options(panel, floors.length), [[0, 1], [null, null]], this.element);
      return panel;
    });
  }

  size(count) {
    const most = this.large ? LARGE_IN_A_ROW : SMALL_IN_A_ROW;
    const columns = Math.ceil(count / Math.ceil(count / most));
    if (this.large) {
      const rows = Math.ceil(count / columns);
      const { clientWidth, clientHeight } = this.element;
      return { width: Math.floor(clientWidth / columns) - 8, height: Math.floor(clientHeight / rows) - 8 };
    }
    const side = Math.floor((this.element.parentElement.clientWidth - 2 * columns) / columns);
    const below = window.innerHeight - this.element.getBoundingClientRect().top - window.scrollY;
    const height = Math.max(150, Math.min(280, below - 8));
    return { width: Math.max(110, Math.min(side, 340)), height };
  }

  options(panel, count) {
    const i = floorName(this.study, panel.floor);
    const small = { ...AXIS, font: "11px sans-serif", labelFont: "11px sans-serif", labelSize: 14 };
    return {
      ...this.size(count),
      padding: [5, 6, 0, 0],
      scales: { x: { time: false, range: () => panel.x }, y: { range: () => panel.y } },
      series: [{}, { show: false }],
      legend: { show: false },
      cursor: { show: false },
      axes: [
        { ...small, label: `u${i}${unit(this.study, "length")}`, size: 22, space: () => (this.large ? 60 : 26) },
        { ...small, label: `v${i}${unit(this.study, "velocity")}`, size: (u, values) => axisSize(values), space: 24 },
      ],
      hooks: { draw: [(u) => this.draw(u, panel)] },
    };
  }

  // Show an orbit {line, points} of states, or nothing.
  show(orbit) {
    this.orbit = orbit;
    const n = this.study.nFloors;
    for (const panel of this.panels) {
      const states = orbit ? [...orbit.line, ...orbit.points] : [];
      panel.x = this.range(states, panel.floor);
      panel.y = this.range(states, n + panel.floor);
      panel.plot.setData([panel.x, [null, null]], true);
    }
  }

  range(states, component) {
    let low = Infinity;
    let high = -Infinity;
    for (const z of states) {
      low = Math.min(low, z[component]);
      high = Math.max(high, z[component]);
    }
    return low <= high ? padded(low, high) : [0, 1];
  }

  draw(u, panel) {
    if (!this.orbit) return;
    const { ctx, bbox } = u;
    const n = this.study.nFloors;
    const x = (z) => u.valToPos(z[panel.floor], "x", true);
    const y = (z) => u.valToPos(z[n + panel.floor], "y", true);
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const stop of this.study.structure.stops[panel.floor]) {
      if (stop < panel.x[0] || stop > panel.x[1]) continue;
      const at = u.valToPos(stop, "x", true);
      ctx.strokeStyle = this.study.colours.stop;
      ctx.setLineDash([6, 4]);
      ctx.beginPath();
      ctx.moveTo(at, bbox.top);
      ctx.lineTo(at, bbox.top + bbox.height);
      ctx.stroke();
      ctx.setLineDash([]);
    }
    ctx.strokeStyle = this.orbit.colour;
    ctx.globalAlpha = this.orbit.periodic ? 1 : 0.45;
    ctx.lineWidth = this.orbit.periodic ? 1.2 : 0.7;
    ctx.beginPath();
    this.orbit.line.forEach((z, i) => (i ? ctx.lineTo(x(z), y(z)) : ctx.moveTo(x(z), y(z))));
    ctx.stroke();
    ctx.globalAlpha = 1;
    ctx.fillStyle = "#fff";
    ctx.strokeStyle = "#000";
    const radius = this.orbit.periodic ? 3 : 2;
    for (const z of this.orbit.points) {
      ctx.beginPath();
      ctx.arc(x(z), y(z), radius, 0, 2 * Math.PI);
      ctx.fill();
      ctx.stroke();
    }
    ctx.restore();
  }

  resize() {
    for (const panel of this.panels) panel.plot.setSize(this.size(this.panels.length));
  }
}
