// The page of responses to records: every panel shows the record that is pointed at.

const FENCE = 3; // distances between quartiles beyond the upper one, from which on is an outlier
const BEYOND = [1.1, 3]; // of the axis of fragility over the largest median, over the last stripe
const DARK = window.matchMedia("(prefers-color-scheme: dark)");

class RecordsPage {
  constructor(study, data) {
    Object.assign(this, { study, data, n: study.records.length, scales: study.scales });
    Object.assign(this, { part: 0, at: study.scales.length >> 1, here: null, pin: null });
    this.response = Object.keys(study.responses)[0];
    byId("title").textContent = study.name;
    byId("collapses").hidden = !study.collapses;
    this.fillControls();
    writeNotes(study);
    this.setResponse(this.response);
    this.listen();
  }

  get about() {
    return this.study.responses[this.response];
  }

  // The largest response of a record at a scale, at some of its places; or that beside it.
  value(record, at, places = this.places, response = this.response, beside = "") {
    const { size, places: { length } } = this.study.responses[response];
    const row = ((this.part * this.n + record) * this.scales.length + at) * length;
    let largest = -Infinity;
    for (const place of places) {
      const own = this.data[response + beside][row + place];
      if (Number.isNaN(own)) return NaN;
      if (own > largest) largest = own;
    }
    return largest / size;
  }

  // The same without contacts.
  free(record, at, places = this.places) {
    return this.value(record, at, places, this.response, "_alone");
  }

  // A scale over the last one.
  upTo(at) {
    return this.scales[at] / this.scales.at(-1);
  }

  // Share of the known records that reach the threshold at a scale.
  share(at) {
    const limit = this.collapse ? Infinity : this.threshold;
    return this.curves.filter((curve) => curve[at] >= limit).length / Math.max(1, this.known[at]);
  }

  // Facts about the structure that is shown.
  get kind() {
    return this.study.parts[this.part];
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
    this.alone = every.map((i) => Float64Array.from(scales, (_, k) => this.free(i, k)));
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
    const apart = (own, i, k) => Math.abs(own - this.alone[i][k]);
    this.touches = !this.kind.exact && this.curves.some((curve, i) => curve.some((own, k) =>
      Number.isFinite(own) && apart(own, i, k) > 1e-6 * this.largest));
    this.known = stripes.map((own) => own.length);
    this.countCapacities();
  }

  // Everything that follows from the threshold.
  countCapacities() {
    const { scales, curves, alone } = this;
    const last = scales.at(-1);
    const threshold = this.collapse ? Infinity : this.threshold;
    const exact = alone.map((curve) => ({ scale: threshold * last / curve.at(-1), later: 0 }));
    this.capacity = this.kind.exact && !this.collapse
      ? exact : curves.map((curve) => capacity(scales, curve, threshold));
    const own = this.capacity.map(({ scale }) => scale);
    const finite = own.filter(Number.isFinite);
    this.never = own.filter((scale) => scale === Infinity).length;
    this.fit = fitCapacities(finite, this.never, last);
    this.sorted = ascending(own);
    const counted = this.kind.proportional
      ? exact : alone.map((curve) => capacity(scales, curve, threshold));
    const free = this.touches && !this.collapse ? counted : [];
    this.freeSorted = ascending(free.map(({ scale }) => scale));
    const medians = [this.fit ? this.fit.median : 0, fractile(this.freeSorted, 0.5)];
    const farthest = Math.min(BEYOND[0] * Math.max(...medians.filter(Number.isFinite)), BEYOND[1] * last);
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
    const profiles = profileViews(this);
    const frames = profiles.map(() => document.createElement("div"));
    byId("profiles").replaceChildren(...frames);
    this.fragility = new Panel(byId("fragility"), fragilityView(this), this);
    this.profiles = profiles.map((view, i) => new Panel(frames[i], view, this));
    const curves = new Panel(byId("curves"), curvesView(this), this);
    this.panels = [curves, this.fragility, ...this.profiles];
    byId("motion").hidden = !this.study.history.length;
    const views = this.study.history.length ? [historyView(this)] : [];
    this.histories = views.map((view) => new Panel(byId("history"), view, this));
    this.panels.push(...this.histories);
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
    for (const panel of this.histories) panel.show();
    for (const panel of this.panels) panel.highlight();
    tell(this);
  }

  show() {
    for (const panel of this.panels) panel.show();
    tell(this);
  }

  setResponse(response) {
    this.response = response;
    fillMenu(byId("place"), this.about.groups.map(([name], i) => [i, name]));
    this.places = this.about.groups[0][1];
    this.threshold = 1;
    this.count();
    // at first half of the records reach it in the middle of the stripes, rounded
    const middle = this.fractiles[1][this.scales.length >> 1];
    const start = Number.isFinite(middle) && middle > 0 ? middle : 0.5 * this.largest;
    this.threshold = Number(start.toPrecision(2));
    this.countCapacities();
    writeKeys(this); // they take room
    this.layout();
    this.showThreshold();
    tell(this);
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
    tell(this);
  }

  showThreshold() {
    byId("unit").textContent = this.about.unit;
    byId("slide").value = 1000 * this.threshold / this.largest;
    const field = byId("threshold");
    if (document.activeElement !== field) field.value = +this.threshold.toPrecision(4);
  }

  fillControls() {
    const { study } = this;
    const responses = Object.entries(study.responses);
    fillMenu(byId("response"), responses.map(([id, { label }]) => [id, label]));
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
