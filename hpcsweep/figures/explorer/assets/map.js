// The map over (A, Omega): uPlot draws axes and takes the pointer, a pixel buffer the runs.

// Edges of the cells around ascending values.
function cellEdges(values) {
  const n = values.length;
  const edges = new Float64Array(n + 1);
  for (let i = 1; i < n; i++) edges[i] = 0.5 * (values[i - 1] + values[i]);
  const margin = n > 1 ? 0 : 0.005 * Math.abs(values[0]) || 0.005;
  edges[0] = n > 1 ? 1.5 * values[0] - 0.5 * values[1] : values[0] - margin;
  edges[n] = n > 1 ? 1.5 * values[n - 1] - 0.5 * values[n - 2] : values[0] + margin;
  return edges;
}

// Index of the cell that holds x, or -1.
function cellOf(edges, x) {
  let low = 0;
  let high = edges.length - 1;
  if (!(x >= edges[0] && x <= edges[high])) return -1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (edges[middle] <= x) low = middle;
    else high = middle;
  }
  return low;
}

// Cell of each of `n` pixels that span [from, to].
function cellsOfPixels(edges, from, to, n) {
  const cells = new Int32Array(n);
  for (let i = 0; i < n; i++) cells[i] = cellOf(edges, from + ((i + 0.5) / n) * (to - from));
  return cells;
}

class RunMap {
  // `events`: point(frame, amplitude), leave(), choose(frame, amplitude), view(a, w)
  constructor(element, study, events) {
    this.element = element;
    this.study = study;
    this.events = events;
    this.aEdges = cellEdges(study.amplitude);
    this.wEdges = cellEdges(study.omega);
    this.view = this.whole();
    this.below = 105; // height of legend and words under the map
    this.canvas = document.createElement("canvas");
    this.canvas.id = "map-pixels";
    this.plot = new uPlot(this.options(), [[0, 1], [null, null]], element);
    const over = this.plot.over;
    this.marks = {};
    for (const kind of ["row", "pin", "here"]) {
      this.marks[kind] = document.createElement("div");
      this.marks[kind].className = `mark ${kind}`;
      over.append(this.marks[kind]);
    }
    this.listen(over);
  }

  whole() {
    const ends = (edges) => [edges[0], edges[edges.length - 1]];
    return { a: ends(this.aEdges), w: ends(this.wEdges) };
  }

  size() {
    const width = Math.max(320, this.element.clientWidth);
    const room = window.innerHeight - this.element.getBoundingClientRect().top - window.scrollY;
    return { width, height: Math.max(320, Math.min(room - this.below, 1.25 * width)) };
  }

  options() {
    const { omega } = this.study;
    const one = omega.length === 1 ? { splits: () => omega, values: () => omega.map(String) } : {};
    return {
      ...this.size(),
      padding: [8, 12, 0, 0],
      scales: {
        x: { time: false, range: () => this.view.a },
        y: { range: () => this.view.w },
      },
      series: [{}, { show: false }],
      legend: { show: false },
      cursor: { points: { show: false }, drag: { x: true, y: true, uni: 20, setScale: false } },
      axes: [
        { ...AXIS, label: axisLabel(this.study, "x"), labelSize: 20, labelFont: AXIS.font, size: 28 },
        { ...AXIS, ...one, label: axisLabel(this.study, "y"), labelSize: 20, labelFont: AXIS.font, size: 48 },
      ],
      hooks: {
        drawAxes: [(u) => u.ctx.drawImage(this.canvas, u.bbox.left, u.bbox.top)],
        draw: [(u) => this.drawGrazing(u)],
        setSelect: [(u) => this.zoomToSelection(u)],
      },
    };
  }

  // The grazing amplitude of every frame, the closed form.
  drawGrazing(u) {
    const { grazing, omega, colours } = this.study;
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    u.ctx.clip();
    u.ctx.strokeStyle = colours.grazing;
    u.ctx.beginPath();
    grazing.forEach((a, i) => {
      if (a !== null) u.ctx.lineTo(u.valToPos(a, "x", true), u.valToPos(omega[i], "y", true));
    });
    u.ctx.stroke();
    u.ctx.restore();
  }

  listen(over) {
    let down = null;
    over.addEventListener("pointermove", (event) => {
      const cell = this.cellAt(event);
      if (cell) this.events.point(...cell);
    });
    over.addEventListener("pointerleave", () => this.events.leave());
    over.addEventListener("pointerdown", (event) => (down = [event.clientX, event.clientY]));
    over.addEventListener("click", (event) => {
      const still = down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 5;
      const cell = still && this.cellAt(event);
      if (cell) this.events.choose(...cell);
    });
    over.addEventListener("dblclick", () => this.setView(this.whole()));
    over.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        const box = over.getBoundingClientRect();
        const at = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
        this.zoom(Math.exp(Math.max(-100, Math.min(100, event.deltaY)) * 0.003), at);
      },
      { passive: false });
  }

  cellAt(event) {
    const box = this.plot.over.getBoundingClientRect();
    const { a, w } = this.view;
    const x = a[0] + ((event.clientX - box.left) / box.width) * (a[1] - a[0]);
    const y = w[1] - ((event.clientY - box.top) / box.height) * (w[1] - w[0]);
    const cell = [cellOf(this.wEdges, y), cellOf(this.aEdges, x)];
    return cell[0] < 0 || cell[1] < 0 ? null : cell;
  }

  // Zoom by a factor about a place of the plot in [0, 1] x [0, 1] from its top left.
  zoom(factor, at = [0.5, 0.5]) {
    const about = (range, whole, share) => {
      const centre = range[0] + share * (range[1] - range[0]);
      const width = Math.min(factor * (range[1] - range[0]), whole[1] - whole[0]);
      const low = Math.min(Math.max(centre - share * width, whole[0]), whole[1] - width);
      return [low, low + width];
    };
    const whole = this.whole();
    this.setView({ a: about(this.view.a, whole.a, at[0]), w: about(this.view.w, whole.w, 1 - at[1]) });
  }

  zoomToSelection(u) {
    const { left, top, width, height } = u.select;
    if (width < 6 && height < 6) return;
    const full = { w: u.over.clientWidth, h: u.over.clientHeight };
    const [a, w] = [this.view.a, this.view.w];
    const part = (range, from, to) => [
      range[0] + from * (range[1] - range[0]), range[0] + to * (range[1] - range[0])];
    const view = {
      a: width < 6 ? a : part(a, left / full.w, (left + width) / full.w),
      w: height < 6 ? w : part(w, 1 - (top + height) / full.h, 1 - top / full.h),
    };
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.setView(view);
  }

  setView(view) {
    this.view = view;
    this.paint();
    this.events.view(view);
  }

  // Colour the pixels: `key(run)` indexes `table`.
  colour(direction, key, table) {
    this.look = { direction, key, table };
    this.paint();
  }

  paint() {
    if (!this.look) return;
    const { bbox } = this.plot;
    const width = Math.max(1, Math.round(bbox.width));
    const height = Math.max(1, Math.round(bbox.height));
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    const context = this.canvas.getContext("2d");
    const image = context.createImageData(width, height);
    const pixels = new Uint32Array(image.data.buffer);
    const { a, w } = this.view;
    const columns = cellsOfPixels(this.aEdges, a[0], a[1], width);
    const rows = cellsOfPixels(this.wEdges, w[1], w[0], height);
    const { direction, key, table } = this.look;
    for (let y = 0, at = 0; y < height; y++) {
      if (y > 0 && rows[y] === rows[y - 1]) {
        pixels.copyWithin(at, at - width, at);
        at += width;
        continue;
      }
      const start = rows[y] < 0 ? -1 : this.study.run(rows[y], direction, 0);
      for (let x = 0; x < width; x++, at++) {
        if (start >= 0 && columns[x] >= 0) pixels[at] = table[key(start + columns[x])];
      }
    }
    context.putImageData(image, 0, 0);
    this.plot.setData([this.view.a, [null, null]], true);
  }

  // Show where the pointed run and the selected one are.
  mark(here, pin) {
    const { a, w } = this.view;
    const over = this.plot.over;
    const place = (mark, run) => {
      const x = run && (this.study.amplitude[run.amplitude] - a[0]) / (a[1] - a[0]);
      const y = run && (w[1] - this.study.omega[run.frame]) / (w[1] - w[0]);
      const seen = run && x >= 0 && x <= 1 && y >= 0 && y <= 1;
      mark.style.display = seen ? "" : "none";
      if (!seen) return;
      mark.style.top = `${y * over.clientHeight}px`;
      if (!mark.classList.contains("row")) mark.style.left = `${x * over.clientWidth}px`;
    };
    place(this.marks.row, here || pin);
    place(this.marks.here, here);
    place(this.marks.pin, pin);
  }

  // Leave room for legend and words under the map.
  leaveBelow(height) {
    if (height === this.below) return;
    this.below = height;
    this.resize();
  }

  resize() {
    this.plot.setSize(this.size());
    this.paint();
  }
}
