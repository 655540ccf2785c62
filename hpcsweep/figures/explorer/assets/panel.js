// A panel of the page of records: curves of all records, and those that are pointed at above them.

const REACH = 14; // pixels from the pointer within which a curve is pointed at

// A colour of the theme, light or dark.
const theme = (name) => getComputedStyle(document.body).getPropertyValue(`--${name}`).trim();

// A frame with axes, lines of all records below, and a layer for the ones that are pointed at.
class Panel {
  // `spec`: x and y, each { label, range } and splits and values if they are not numbers;
  // base(pen) draws, over(pen) what moves, curve(i) gives the points of record i, mark(pen, i,
  // colour) highlights it, stripe(height) is the scale that is pointed at
  constructor(element, spec, page) {
    Object.assign(this, { element, spec, page });
    const axis = (own) => ({
      ...AXIS, labelFont: AXIS.font, stroke: () => theme("ink"), label: () => own().label,
      grid: { show: true, stroke: () => theme("faint"), width: 1 },
      ...(own().splits ? { splits: () => own().splits, values: () => own().values } : {}),
    });
    this.plot = new uPlot({
      ...this.size(),
      padding: [6, 10, 0, 0],
      scales: {
        x: { time: false, range: () => spec.x().range },
        y: { range: () => spec.y().range },
      },
      series: [{}, { show: false }],
      legend: { show: false },
      cursor: { show: false },
      axes: [
        { ...axis(spec.x), labelSize: 18, size: 26, space: 42 },
        { ...axis(spec.y), labelSize: 18, size: (u, values) => axisSize(values), space: 24 }],
      hooks: { draw: [() => this.draw()] },
    }, [[0, 1], [null, null]], element);
    this.layer = document.createElement("canvas");
    const { over } = this.plot;
    over.append(this.layer);
    over.addEventListener("pointermove", (event) => page.point(this.nearest(event)));
    over.addEventListener("pointerleave", () => page.point(null));
    over.addEventListener("click", (event) => page.keep(this.nearest(event)));
  }

  size() {
    return { width: Math.max(160, this.element.clientWidth), height: this.spec.height() };
  }

  pen(ctx) {
    const { plot } = this;
    const ratio = window.devicePixelRatio || 1;
    const x = (value) => plot.valToPos(value, "x", true) - plot.bbox.left;
    const y = (value) => plot.valToPos(value, "y", true) - plot.bbox.top;
    return {
      // points that are not known break the line
      line(points, colour, width = 1, dash = []) {
        [ctx.strokeStyle, ctx.lineWidth, ctx.lineJoin] = [colour, width * ratio, "round"];
        ctx.setLineDash(dash.map((part) => part * ratio));
        ctx.beginPath();
        let open = false;
        for (const [across, up] of points) {
          const there = !Number.isNaN(across) && !Number.isNaN(up);
          if (there) ctx[open ? "lineTo" : "moveTo"](x(across), y(up));
          open = there;
        }
        ctx.stroke();
      },
      area(points, colour, alpha) {
        [ctx.fillStyle, ctx.globalAlpha] = [colour, alpha];
        ctx.beginPath();
        for (const [across, up] of points) ctx.lineTo(x(across), y(up));
        ctx.fill();
        ctx.globalAlpha = 1;
      },
      dots(points, colour, radius) {
        ctx.fillStyle = colour;
        for (const [across, up] of points) {
          ctx.beginPath();
          ctx.arc(x(across), y(up), radius * ratio, 0, 2 * Math.PI);
          ctx.fill();
        }
      },
    };
  }

  draw() {
    const { ctx, bbox } = this.plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.translate(bbox.left, bbox.top);
    this.spec.base(this.pen(ctx));
    ctx.restore();
    this.highlight();
  }

  highlight() {
    if (!this.layer) return; // the first drawing
    const { width, height } = this.plot.bbox;
    Object.assign(this.layer, { width, height });
    const pen = this.pen(this.layer.getContext("2d"));
    if (this.spec.over) this.spec.over(pen);
    for (const [record, colour] of this.page.marked()) this.spec.mark(pen, record, colour);
  }

  // The record whose curve is next to the pointer, and where; null if none is near.
  nearest(event) {
    const { plot } = this;
    const box = plot.over.getBoundingClientRect();
    const [px, py] = [event.clientX - box.left, event.clientY - box.top];
    const flat = (v, scale) => plot.valToPos(v, scale);
    let [least, found] = [REACH, null];
    for (let i = 0; i < this.page.n; i++) {
      let before = null;
      for (const [across, up] of this.spec.curve(i)) {
        const here = Number.isNaN(across) ? null : [flat(across, "x"), flat(up, "y")];
        if (here) {
          const [ax, ay] = before || here;
          const [dx, dy] = [here[0] - ax, here[1] - ay];
          const share = ((px - ax) * dx + (py - ay) * dy) / (dx * dx + dy * dy || 1);
          const part = Math.min(1, Math.max(0, share));
          const away = Math.hypot(px - ax - part * dx, py - ay - part * dy);
          if (away < least) [least, found] = [away, i];
        }
        before = here;
      }
    }
    return found === null ? null : { record: found, at: this.spec.stripe(plot.posToVal(py, "y")) };
  }

  show() {
    this.plot.setData([[0, 1], [null, null]], true);
  }
}
