// The page of responses to records: every panel shows the record that is pointed at.

const REACH = 14; // pixels from the pointer within which a curve is pointed at
const FENCE = 3; // distances between quartiles beyond the upper one, from which on is an outlier
const BEYOND = [1.1, 3]; // of the axis of fragility over the largest median, over the last stripe
const FEW = 100; // records up to which their curves cover each other
const FINE = 240; // points of a fitted curve

// A colour of the theme, light or dark.
const theme = (name) => getComputedStyle(document.body).getPropertyValue(`--${name}`).trim();
const inBrackets = (name) => (name ? `  [${name}]` : "");
const withUnit = (value, name, digits = 4) => shortNumber(value, digits) + (name ? ` ${name}` : "");
const DARK = window.matchMedia("(prefers-color-scheme: dark)");

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
      scales: { x: { time: false, range: () => spec.x().range }, y: { range: () => spec.y().range } },
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

class RecordsPage {
  constructor(study, data) {
    Object.assign(this, { study, data, n: study.records.length, scales: study.scales });
    Object.assign(this, { part: 0, at: study.scales.length >> 1, here: null, pin: null });
    this.response = Object.keys(study.responses)[0];
    byId("title").textContent = study.name;
    byId("collapses").hidden = !study.collapses;
    this.fillControls();
    byId("notes").replaceChildren(...this.notes().map((words) => {
      const p = document.createElement("p");
      p.textContent = words;
      return p;
    }));
    this.setResponse(this.response);
    this.listen();
  }

  get about() {
    return this.study.responses[this.response];
  }

  // The largest response of a record at a scale, at some places, and without contacts.
  value(record, at, places = this.places) {
    const row = ((this.part * this.n + record) * this.scales.length + at) * this.about.places.length;
    let largest = -Infinity;
    for (const place of places) {
      const own = this.data[this.response][row + place];
      if (Number.isNaN(own)) return NaN;
      if (own > largest) largest = own;
    }
    return largest / this.about.size;
  }

  free(record, at = this.scales.length - 1, places = this.places) {
    const row = (this.part * this.n + record) * this.about.places.length;
    const own = this.data[`${this.response}_alone`];
    const part = this.scales[at] / this.scales.at(-1) / this.about.size;
    return part * Math.max(...places.map((place) => own[row + place]));
  }

  get kind() {
    return this.study.parts[this.part];
  }

  // Colour of the records that are not pointed at, so that many show where they are dense.
  get grey() {
    return theme("grey") + (this.n > FEW ? "50" : "");
  }

  // Colour of what is counted and fitted.
  get own() {
    return DARK.matches ? this.study.colours.dark : this.study.colours.light;
  }

  // Everything that follows from response, place and structure.
  count() {
    const { n, scales } = this;
    const every = Array.from({ length: n }, (_, i) => i);
    this.curves = every.map((i) => Float64Array.from(scales, (_, k) => this.value(i, k)));
    this.alone = Float64Array.from(every, (i) => this.free(i));
    const stripes = scales.map((_, k) => ascending(this.curves.map((curve) => curve[k])));
    const parts = [0.16, 0.5, 0.84];
    this.fractiles = parts.map((part) => stripes.map((own) => responseFractile(own, part)));
    const sizes = ascending(this.curves.map((curve) =>
      Math.max(0, ...curve.filter(Number.isFinite))));
    this.largest = sizes.at(-1) || 1;
    const [low, high] = [0.25, 0.75].map((part) => sizes[Math.round(part * (n - 1))]);
    const inside = sizes.filter((size) => size <= high + FENCE * (high - low));
    this.outliers = high > low ? n - inside.length : 0;
    this.edge = this.outliers ? 1.1 * inside.at(-1) : 1.05 * this.largest;
    // contacts change something, beyond the rounding of float32
    this.touches = !this.kind.exact && this.curves.some((curve, i) => curve.some((own, k) =>
      Number.isFinite(own) && Math.abs(own - this.alone[i] * scales[k] / scales.at(-1)) > 1e-6 * this.largest));
    this.known = stripes.map((own) => own.length);
    this.countCapacities();
  }

  // Everything that follows from the threshold.
  countCapacities() {
    const { scales, curves, alone } = this;
    const last = scales.at(-1);
    const threshold = this.collapse ? Infinity : this.threshold;
    const exact = Array.from(alone, (own) => ({ scale: threshold * last / own, later: 0 }));
    this.capacity = this.kind.exact && !this.collapse
      ? exact : curves.map((curve) => capacity(scales, curve, threshold));
    const own = this.capacity.map(({ scale }) => scale);
    const finite = own.filter(Number.isFinite);
    this.never = own.filter((scale) => scale === Infinity).length;
    this.fit = fitCapacities(finite, this.never, last);
    this.sorted = ascending(own);
    this.freeSorted = ascending(this.touches && !this.collapse ? exact.map(({ scale }) => scale) : []);
    const medians = [this.fit ? this.fit.median : 0, fractile(this.freeSorted, 0.5) || 0];
    const farthest = Math.min(BEYOND[0] * Math.max(...medians), BEYOND[1] * last);
    this.highest = Math.max(last, farthest);
    if (this.kind.exact) this.highest = Math.max(last, BEYOND[0] * Math.max(0, ...finite));
    this.rank = own.map((scale) => this.sorted.lastIndexOf(scale) + 1);
  }

  // Points of a curve over the scales: flat to the edge where a structure collapses.
  upwards(values) {
    const points = [[0, 0]];
    for (let k = 0; k < values.length; k++) {
      if (values[k] === Infinity) {
        const middle = 0.5 * (this.scales[k] + points.at(-1)[1]);
        const across = points.at(-1)[0];
        points.push([across, middle], [Math.max(1.5 * this.edge, across), middle]);
        break;
      }
      points.push([values[k], this.scales[k]]);
    }
    return points;
  }

  steps(sorted) {
    const points = [[0, 0]];
    sorted.forEach((scale, i) => {
      if (scale <= this.highest) points.push([scale, i / sorted.length], [scale, (i + 1) / sorted.length]);
    });
    return [...points, [this.highest, points.at(-1)[1]]];
  }

  specs() {
    const { study } = this;
    const nearestStripe = (value) => this.scales.reduce((best, scale, k) =>
      Math.abs(scale - value) < Math.abs(this.scales[best] - value) ? k : best, 0);
    const room = (share, below) => () => Math.max(190, share * (window.innerHeight
      - byId("curves").getBoundingClientRect().top - window.scrollY) - below);
    const rest = { stripe: () => this.stripe() };
    const curves = {
      x: () => ({ label: this.about.label + inBrackets(this.about.unit), range: [0, this.edge] }),
      y: () => ({ label: this.kind.measure, range: [0, 1.02 * this.scales.at(-1)] }),
      height: room(1, 72), stripe: nearestStripe,
      base: (pen) => {
        for (const curve of this.curves) pen.line(this.upwards(curve), this.grey, 0.7);
        const dashes = [[6, 4], [], [6, 4]];
        this.fractiles.forEach((values, i) => pen.line(this.upwards(values), this.own, i === 1 ? 2.4 : 1.8, dashes[i]));
        const free = responseFractile(ascending(this.alone), 0.5);
        if (this.touches) pen.line([[0, 0], [free, this.scales.at(-1)]], study.stop, 2, [2, 3]);
      },
      over: (pen) => {
        const at = this.scales[this.stripe()];
        const across = this.collapse ? NaN : this.threshold;
        pen.line([[across, 0], [across, 2 * this.scales.at(-1)]], theme("ink"), 1, [1, 2]);
        pen.line([[0, at], [this.edge, at]], theme("ink"), 0.6, [1, 4]);
      },
      curve: (i) => this.upwards(this.curves[i]),
      mark: (pen, i, colour) => {
        pen.line(this.upwards(this.curves[i]), colour, 2.4);
        const at = this.stripe();
        pen.dots([[this.curves[i][at], this.scales[at]]], colour, 4.5);
      },
    };
    const fragility = {
      x: () => ({ label: this.kind.measure, range: [0, this.highest] }),
      y: () => ({ label: "share of records", range: [0, 1.02] }),
      height: room(0.5, 48), ...rest,
      base: (pen) => {
        if (this.fit) {
          const fine = Array.from({ length: FINE }, (_, i) => ((i + 1) / FINE) * this.highest);
          const shares = fine.map(this.fit.at);
          const line = (which) => fine.map((x, i) => [x, shares[i][which]]);
          pen.area([...line(1), ...line(2).reverse()], this.own, 0.2);
          const last = this.kind.exact ? Infinity : this.scales.at(-1);
          pen.line(line(0).filter(([x]) => x <= last), this.own, 2.2);
          pen.line(line(0).filter(([x]) => x > last), this.own, 2.2, [5, 4]);
        }
        pen.line(this.steps(this.sorted), this.own, 0.8);
        if (this.freeSorted.length) pen.line(this.steps(this.freeSorted), study.stop, 1.4, [2, 3]);
        const limit = this.collapse ? Infinity : this.threshold;
        pen.dots(this.scales.map((scale, k) =>
          [scale, this.curves.filter((curve) => curve[k] >= limit).length / Math.max(1, this.known[k])]), this.own, 2.6);
      },
      curve: (i) => [[this.capacity[i].scale, this.rank[i] / this.sorted.length]],
      mark: (pen, i, colour) => {
        const { scale } = this.capacity[i];
        if (!Number.isFinite(scale)) return;
        pen.line([[scale, 0], [scale, this.rank[i] / this.sorted.length]], colour, 1.6);
        pen.dots([[scale, this.rank[i] / this.sorted.length]], colour, 4.5);
      },
    };
    const levels = this.about.panels.flatMap(([, , own]) => own);
    const profiles = this.about.panels.map(([title, places, level]) => {
      const up = (values) => values.map((value, j) => [value, level[j]]);
      const of = (i) => places.map((place) => this.value(i, this.stripe(), [place]));
      const names = places.map((place) => this.about.places[place]);
      const every = level.filter((_, j) => level.length <= 12 || j % Math.ceil(level.length / 12) === 0);
      return {
        x: () => ({ label: title ? `building ${title}${inBrackets(this.about.unit)}` : this.about.label + inBrackets(this.about.unit), range: [0, this.widest()] }),
        y: () => ({
          label: "", range: [Math.min(...levels) - 0.5, Math.max(...levels) + 0.5],
          splits: every, values: every.map((own) => names[level.indexOf(own)]),
        }),
        height: room(0.5, 48), ...rest,
        base: (pen) => {
          const each = Array.from({ length: this.n }, (_, i) => of(i));
          for (const one of each) pen.line(up(one), this.grey, 0.7);
          const counted = (part) => up(places.map((_, j) => fractile(ascending(each.map((one) => one[j])), part)));
          pen.line(counted(0.16), this.own, 1.6, [6, 4]);
          pen.line(counted(0.84), this.own, 1.6, [6, 4]);
          pen.line(counted(0.5), this.own, 2.4);
          pen.dots(counted(0.5), this.own, 2.4);
          const alone = places.map((place) => fractile(ascending(Array.from({ length: this.n }, (_, i) => this.free(i, this.stripe(), [place]))), 0.5));
          if (this.touches) pen.line(up(alone), study.stop, 2, [2, 3]);
        },
        curve: (i) => up(of(i)),
        mark: (pen, i, colour) => {
          pen.line(up(of(i)), colour, 2.4);
          pen.dots(up(of(i)), colour, 3.5);
        },
      };
    });
    return { curves, fragility, profiles };
  }

  // Largest response at the stripe shown, of all places, without outliers of the curves.
  widest() {
    const every = this.about.places.map((_, place) => place);
    let largest = 0;
    for (let i = 0; i < this.n; i++) {
      const own = this.value(i, this.stripe(), every);
      if (Number.isFinite(own) && own > largest) largest = own;
    }
    return 1.05 * Math.min(largest || this.edge, this.outliers ? this.edge : Infinity);
  }

  // Stripe of the profile: that which is pointed at, or the chosen one.
  stripe() {
    return this.here ? this.here.at : this.at;
  }

  marked() {
    const { pointed, kept } = this.study.colours;
    const both = [];
    if (this.pin !== null) both.push([this.pin, kept]);
    if (this.here) both.push([this.here.record, pointed]);
    return both;
  }

  layout() {
    for (const { plot } of this.panels || []) plot.destroy();
    const { curves, fragility, profiles } = this.specs();
    const frames = profiles.map(() => document.createElement("div"));
    byId("profiles").replaceChildren(...frames);
    this.fragility = new Panel(byId("fragility"), fragility, this);
    this.profiles = profiles.map((spec, i) => new Panel(frames[i], spec, this));
    this.panels = [new Panel(byId("curves"), curves, this), this.fragility, ...this.profiles];
  }

  point(here) {
    if (!here && !this.here) return;
    if (here && this.here && here.record === this.here.record && here.at === this.here.at) return;
    const before = this.stripe();
    this.here = here;
    this.follow(before);
  }

  keep(here) {
    const before = this.stripe();
    this.pin = here ? here.record : null;
    if (here) this.at = here.at;
    byId("scale").value = this.at;
    this.follow(before);
  }

  // Draw what depends on the record and the stripe that are pointed at; the stripe was `before`.
  follow(before) {
    if (this.stripe() !== before) for (const panel of this.profiles) panel.show();
    for (const panel of this.panels) panel.highlight();
    this.tell();
  }

  show() {
    for (const panel of this.panels) panel.show();
    this.tell();
  }

  setResponse(response) {
    this.response = response;
    fillMenu(byId("place"), this.about.groups.map(([name], i) => [i, name]));
    this.places = this.about.groups[0][1];
    this.threshold = 1;
    this.count();
    // at first half of the records reach it in the middle of the stripes, rounded
    const middle = this.fractiles[1][this.scales.length >> 1];
    this.threshold = Number(((Number.isFinite(middle) && middle) || 0.5 * this.largest).toPrecision(2));
    this.countCapacities();
    this.keys(); // take room
    this.layout();
    this.showThreshold();
    this.tell();
  }

  setThreshold(threshold) {
    if (!(threshold > 0)) return;
    this.threshold = threshold;
    this.showCapacities();
    this.showThreshold();
  }

  showCapacities() {
    this.countCapacities();
    this.fragility.show();
    for (const panel of this.panels) panel.highlight();
    this.tell();
  }

  showThreshold() {
    byId("unit").textContent = this.about.unit;
    byId("slide").value = 1000 * this.threshold / this.largest;
    if (document.activeElement !== byId("threshold")) byId("threshold").value = +this.threshold.toPrecision(4);
  }

  // What is shown, in words and numbers.
  tell() {
    const { study, about, fit, kind } = this;
    const at = this.stripe();
    const unit = (study.parts[this.part].measure.match(/\[(.*)\]/) || ["", ""])[1];
    const measure = kind.measure.replace(/ *\[.*/, "");
    const stripe = `${measure} = ${withUnit(this.scales[at], unit)}`;
    byId("structure").textContent = [
      `${this.n} records × ${this.scales.length} scales of ${measure}`,
      ...(study.parts.length > 1 ? [`structure ${this.part + 1} of ${study.parts.length}`] : []),
      ...(this.outliers ? [`${this.outliers} outlier${this.outliers > 1 ? "s" : ""} beyond the edge, up to ${shortNumber(this.largest, 3)}`] : []),
      ...(kind.note ? [kind.note] : [])].join("; ");
    const { pointed, kept } = study.colours;
    this.keys();
    byId("profile-title").textContent = `${about.label} at ${stripe}`;
    byId("fit").textContent = this.fitWords(unit);
    const record = this.here ? this.here.record : this.pin;
    const name = record === null ? "" : study.records[record];
    const value = record === null ? NaN : this.curves[record][at];
    byId("readout").textContent = record === null ? "" : `${name} at ${stripe}: ${about.label} ${value === Infinity ? "collapse" : withUnit(value, about.unit)}, ` +
        `reaches ${this.collapse ? "collapse" : withUnit(this.threshold, about.unit)} ${this.capacityWords(record, unit)}`;
    const color = this.here ? pointed : kept;
    fillNumbers(record === null ? "Medians at this intensity" : name, this.numbers(record, at, unit));
    byId("numbers").caption.style.color = record === null ? "" : color;
  }

  capacityWords(record, unit) {
    const { scale, later } = this.capacity[record];
    if (Number.isNaN(scale)) return "at an intensity that is not known";
    if (scale === Infinity) return "at no stripe";
    return `at ${withUnit(scale, unit)}` + (later ? `, and crosses it ${later} times more` : "");
  }

  fitWords(unit) {
    const what = this.collapse ? "collapse" : `reach ${withUnit(this.threshold, this.about.unit)}`;
    const own = this.capacity.filter(({ scale }) => Number.isFinite(scale)).length;
    const words = [`${own} of ${this.n} records ${what}${this.kind.exact ? "" : " within the stripes"}`];
    if (this.fit) {
      words.push(`median ${withUnit(this.fit.median, unit)}, β = ${shortNumber(this.fit.dispersion, 3)}`);
      if (!this.kind.exact && (this.fit.median > this.scales.at(-1) || own < 0.5 * this.sorted.length)) words.push("an extrapolation beyond the last stripe");
      else if (this.fit.median < this.scales[0]) words.push("an extrapolation below the first stripe");
    } else words.push("no curve: two different capacities are needed");
    if (this.freeSorted.length) words.push(`${this.kind.alone}: median ${withUnit(fractile(this.freeSorted, 0.5), unit)}`);
    const again = this.capacity.filter(({ later }) => later).length;
    if (again) words.push(`${again} curves cross it again`);
    return words.join("; ");
  }

  numbers(record, at, unit) {
    const { study, response } = this;
    const rows = [];
    for (const [name, about] of Object.entries(study.responses)) {
      const places = about.places.map((_, place) => place);
      const [all, own] = [name !== response, this.places];
      this.response = name;
      const value = record === null
        ? fractile(ascending(Array.from({ length: this.n }, (_, i) => this.value(i, at, all ? places : own))), 0.5)
        : this.value(record, at, all ? places : own);
      this.response = response;
      if (!Number.isNaN(value)) rows.push([about.label.replace(/^peak /, ""), value === Infinity ? "collapse" : withUnit(value, about.unit, 3)]);
    }
    if (record === null) return rows;
    const factor = this.data.factor[this.part * this.n + record] * this.scales[at] / this.scales.at(-1);
    const free = this.touches ? [[this.kind.alone, withUnit(this.free(record, at), this.about.unit, 3)]] : [];
    const scale = this.capacity[record].scale;
    return [
      ["times the record", shortNumber(factor, 4)], ...rows, ...free,
      ["capacity", Number.isFinite(scale) ? withUnit(scale, unit) : "–"],
      ...study.facts.map(({ label, unit: own, values }) => [label, withUnit(values[record], own, 3)])];
  }

  // The legends.
  keys() {
    const { own, kind } = this;
    const alone = (words) => ["dotted", this.study.stop, `${kind.alone}${words}`];
    this.key("curves-key", [["solid", theme("grey"), "records"], ["solid", own, "median"],
      ["dashed", own, "16, 84 %"], ...(this.touches ? [alone(", median")] : [])]);
    this.key("fragility-key", [["solid", own, "lognormal, 95 % band"], ["dots", own, "counted"],
      ...(this.freeSorted.length ? [alone(", counted")] : [])]);
  }

  key(id, entries) {
    byId(id).replaceChildren(...entries.map(([style, colour, name]) => {
      const entry = document.createElement("span");
      const line = document.createElement("i");
      line.className = style;
      line.style.borderColor = colour;
      entry.append(line, name);
      return entry;
    }));
  }

  notes() {
    const name = this.study.file;
    return [
      "Keys on the analysis: left and right arrows point at the record of the next smaller or larger " +
        "response, up and down at the next intensity, Enter keeps the record, Escape leaves it.",
      "Fractiles are counted: the 84 % fractile is the smallest value that 84 % of the records do not " +
        "exceed. The capacity of a record is the smallest intensity whose response reaches the " +
        "threshold, on the line between two stripes; a lognormal distribution of largest likelihood " +
        "is fitted to capacities, records above the last stripe as such. The band is one of 95 %. " +
        "Without contacts and yielding capacities are exact, and go on beyond the stripes. " +
        "Curves are flat to the edge where a structure collapses.",
      "All responses are those of the file, rounded to 7 digits. Motions are not in this page: " +
        `hpcsweep plot ${name} --kind history --record NAME --scale X draws one.`,
    ];
  }

  fillControls() {
    const { study } = this;
    fillMenu(byId("response"), Object.entries(study.responses).map(([id, { label }]) => [id, label]));
    fillMenu(byId("scale"), this.scales.map((scale, k) => [k, shortNumber(scale)]));
    byId("scale").value = this.at;
    byId("menus").replaceChildren(...study.menus.map(({ name, values }, axis) => {
      const label = document.createElement("label");
      const menu = document.createElement("select");
      menu.id = `menu-${axis}`;
      fillMenu(menu, values.map((value, i) => [i, value]));
      label.append(`${name} `, menu);
      return label;
    }));
  }

  listen() {
    const on = (id, event, act) => byId(id).addEventListener(event, act);
    on("menus", "change", () => {
      const at = this.study.menus.map((_, axis) => Number(byId(`menu-${axis}`).value));
      this.part = this.study.parts.findIndex((part) => part.at.every((own, i) => own === at[i]));
      this.count();
      this.show();
    });
    on("response", "change", (event) => this.setResponse(event.target.value));
    on("place", "change", (event) => {
      this.places = this.about.groups[event.target.value][1];
      this.count();
      this.show();
      this.showThreshold();
    });
    on("slide", "input", (event) => this.setThreshold((event.target.value / 1000) * this.largest));
    on("threshold", "input", (event) => this.setThreshold(Number(event.target.value)));
    on("collapse", "change", (event) => {
      this.collapse = event.target.checked;
      this.showCapacities();
    });
    on("scale", "change", (event) => {
      this.at = Number(event.target.value);
      this.show();
    });
    on("curves", "keydown", (event) => this.press(event));
    window.addEventListener("resize", () => {
      for (const panel of this.panels) panel.plot.setSize(panel.size());
    });
    DARK.addEventListener("change", () => this.show());
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const across = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    const up = { ArrowDown: -1, ArrowUp: 1 }[event.key];
    const { record, at } = this.here || { record: this.pin, at: this.at };
    const within = (i, n) => Math.min(n - 1, Math.max(0, i));
    const order = [...this.curves.keys()].sort((i, j) => this.curves[i][at] - this.curves[j][at]);
    const first = order[this.n >> 1];
    if (across) {
      const place = record === null ? this.n >> 1 : within(order.indexOf(record) + across, this.n);
      this.point({ record: order[place], at });
    } else if (up) this.point({ record: record ?? first, at: within(at + up, this.scales.length) });
    else if (event.key === "Enter") this.keep(this.here);
    else if (event.key === "Escape") this.point(null);
    else return;
    event.preventDefault();
  }
}

start(async (meta) => new RecordsPage(meta, await decodeArrays(meta)));
