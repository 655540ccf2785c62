// The page: what is pointed at, what is selected, and everything that follows from them.

const FLOORS_AT_ONCE = 3;
const BIG_STEP = 20;
const ROOM_BELOW = 79; // for the words and the margins under the legend of the map

class Explorer {
  constructor(study) {
    this.study = study;
    this.quantities = quantities(study);
    this.quantity = this.quantities[0];
    this.only = null;
    this.hold = false;
    this.direction = 0;
    this.floors = [];
    this.here = null; // pointed at
    this.pin = null; // selected
    this.pending = false;
    this.portraitCount = 0;
    this.refit = false;
    this.diagrams = new OrbitDiagrams(byId("diagrams"), study, {
      choose: (amplitude) => this.choose(this.shown().frame, amplitude),
      branch: (point) => this.pointBranch(point),
      zoom: (a) => this.map.setView({ ...this.map.view, a: a || this.map.whole().a }),
    });
    this.portraits = new Portraits(byId("portraits"), study);
    describe(study);
    this.map = new RunMap(byId("map"), study, {
      point: (frame, amplitude) => this.point(frame, amplitude),
      leave: () => this.leave(),
      choose: (frame, amplitude) => this.choose(frame, amplitude),
      view: (view) => this.showView(view),
    });
    this.diagrams.range = this.map.view.a;
    this.fillControls();
    this.listen();
    this.setFloors(0);
    this.colourPoints("motion");
    this.recolour();
    this.choose(...this.firstRun());
  }

  shown() {
    return this.here || this.pin;
  }

  // A run worth a look at first: of the longest period, in the middle of these at its frequency.
  firstRun() {
    const { motion, period } = this.study.data;
    const { nFrames, nAmplitudes } = this.study;
    const periodic = this.study.motions.findIndex((m) => m.periodic);
    let best = [];
    let most = 0;
    for (let frame = 0; frame < nFrames; frame++) {
      for (let a = 0; a < nAmplitudes; a++) {
        const run = this.study.run(frame, 0, a);
        if (motion[run] !== periodic || period[run] < most || period[run] > 6) continue;
        if (period[run] > most) best = [];
        most = period[run];
        if (!best.length || best[0][0] === frame) best.push([frame, a]);
      }
    }
    return best[best.length >> 1] || [nFrames >> 1, nAmplitudes >> 1];
  }

  point(frame, amplitude) {
    if (this.here && this.here.frame === frame && this.here.amplitude === amplitude) return;
    this.here = { frame, amplitude };
    this.later();
  }

  leave() {
    this.here = null;
    this.later();
  }

  choose(frame, amplitude) {
    this.pin = { frame, amplitude };
    this.later();
    this.showNumbers();
    this.showPortrait();
  }

  // Draw at the browser's next frame, once for all events until then.
  later() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      this.showFrame();
    });
  }

  showFrame() {
    const { frame, amplitude } = this.shown();
    this.diagrams.show(frame, this.direction, amplitude, this.hold);
    this.map.mark(this.here, this.pin);
    const { study } = this;
    byId("diagram-title").textContent =
      `Orbit diagram${frameWords(study, frame)} ` +
      `(frame ${frame + 1} of ${study.nFrames})`;
    const there = study.directions.map((name, d) => [name, study.run(frame, d, amplitude)])
      .filter(([, run], d) => d === 0 || study.each === "direction" || study.data.motion[run]);
    const words = there.map(([name, run]) => {
      const about = this.quantities
        .filter((q) => ["motion", "contact", "share"].includes(q.id) || q === this.quantity)
        .map((q) => (q.id === "motion" || q.id === "contact" ? "" : `${q.short} `) + q.name(run));
      return `${name}: ${about.join(", ")}`;
    });
    byId("readout").textContent =
      `${placeWords(study, frame, amplitude)}; ${words.join("; ")}`;
    if (this.refit) this.portraits.resize(); // into the room that all above leaves
    this.refit = false;
  }

  // Show a point of a branch while it is pointed at, else the selected run.
  pointBranch(point) {
    const { pointed } = this.diagrams;
    if (pointed === point || (pointed && point && pointed.branch === point.branch && pointed.k === point.k)) return;
    this.diagrams.pointed = point;
    this.later();
    this.showNumbers();
    this.showPortrait();
  }

  showBranch(point) {
    const { branches } = this.diagrams;
    const { amplitude, omega } = branches.forcing(point);
    byId("portrait-title").textContent =
      `Phase portrait of branch ${point.branch.number} at A = ` +
      `${amplitudeWords(this.study, amplitude)}, Ω = ${omegaWords(this.study, omega)}`;
    const orbit = branches.orbit(point);
    this.portraits.show(orbit);
    this.orbit = orbit;
    byId("portrait-note").textContent =
      orbit.failed ? "The integration failed." : branches.words(orbit);
  }

  showView(view) {
    this.diagrams.range = view.a;
    this.later();
  }

  recolour() {
    const { colours } = this.study;
    const table = colourTable(this.quantity, this.only, colours);
    this.map.colour(this.direction, this.quantity.key, table);
    drawLegend(byId("legend"), this.quantity, this.only, colours, (only) => {
      this.only = only;
      this.recolour();
    });
    this.map.leaveBelow(byId("legend").offsetHeight + ROOM_BELOW);
  }

  // Groups of floors to be shown at once; of many the first, the middle and the top come first.
  // The last group has all.
  floorGroups() {
    const { nFloors } = this.study;
    const groups = nFloors > FLOORS_AT_ONCE ? [[0, (nFloors - 1) >> 1, nFloors - 1]] : [];
    for (let first = 0; first < nFloors; first += FLOORS_AT_ONCE) {
      const last = Math.min(first + FLOORS_AT_ONCE, nFloors);
      groups.push(Array.from({ length: last - first }, (_, i) => first + i));
    }
    if (groups.length > 1) groups.push(Array.from({ length: nFloors }, (_, i) => i));
    return groups;
  }

  setFloors(group) {
    this.floors = this.floorGroups()[group];
    this.diagrams.layout(this.floors);
    this.describeDiagrams();
    this.portraits.layout(this.floors);
  }

  describeDiagrams() {
    const by = this.diagrams.motion ? "motion" : "direction";
    describeDiagrams(this.study, by, this.diagrams.labelled());
    this.refit = true;
  }

  // Colour the points of the orbit diagrams by motion, as the figures do, or by direction.
  colourPoints(by) {
    this.diagrams.motion = by === "motion" ? this.quantities[0] : null;
    this.describeDiagrams();
    this.later();
  }

  setDirection(direction) {
    this.direction = direction;
    byId("direction").value = direction;
    this.recolour();
    this.choose(this.pin.frame, this.pin.amplitude);
  }

  numbers(run) {
    const { study } = this;
    const { frame, amplitude } = this.pin;
    const { pointed, branches } = this.diagrams;
    const driven = pointed ? branches.forcing(pointed) : drive(study, frame, amplitude);
    if (pointed) {
      return [
        [`A${unit(study, "acceleration")}`, shortNumber(driven.amplitude, 7)],
        [`Ω${unit(study, "frequency")}`, shortNumber(driven.omega, 7)],
        ...branches.numbers(pointed)];
    }
    const { key, quantity } = study.axes.x;
    const rows = [
      ...(key ? [[key + unit(study, quantity), shortNumber(study.amplitude[amplitude], 7)]] : []),
      [`A${unit(study, "acceleration")}`, shortNumber(driven.amplitude, 7)],
      [`Ω${unit(study, "frequency")}`, shortNumber(driven.omega, 7)],
      [study.each === "attractor" && isChaotic(study, run) ? "attractor or transient" : study.each,
        study.directions[this.direction]],
    ];
    // of the measures the one that the map shows, at all its places
    const shown = this.quantities.filter((q) => !q.measure || q.measure === this.quantity.measure);
    for (const q of shown) {
      rows.push([q.short || q.label, q.name(run)]);
    }
    rows.push(["outcome", study.outcomes[study.data.outcome[run]]]);
    rows.push(["periods integrated", String(study.data.cycles[run])]);
    return rows;
  }

  showNumbers() {
    const run = this.study.run(this.pin.frame, this.direction, this.pin.amplitude);
    fillNumbers(this.diagrams.pointed ? "Point of a branch" : "Selected run", this.numbers(run));
  }

  async showPortrait() {
    const { study, direction } = this;
    const { frame, amplitude } = this.pin;
    const ticket = ++this.portraitCount;
    if (this.diagrams.pointed) {
      this.showBranch(this.diagrams.pointed);
      return;
    }
    const run = study.run(frame, direction, amplitude);
    const note = byId("portrait-note");
    byId("portrait-title").textContent =
      `Phase portrait at ${placeWords(study, frame, amplitude)}, ${study.words[direction]}`;
    if (!study.data.points || !study.data.counts[run]) {
      this.portraits.show(null);
      note.textContent = "No stroboscopic points of this run are in the page.";
      return;
    }
    const start = this.storedState(frame, run);
    const period = study.data.period[run];
    note.textContent = "Integrating …";
    const driven = drive(study, frame, amplitude);
    const orbit = await orbitFrom(
      driven.structure, driven.amplitude, driven.omega, start, period,
      () => ticket !== this.portraitCount);
    if (!orbit) return;
    orbit.periodic = period > 0;
    orbit.colour = this.quantities[0].colour(run);
    this.portraits.show(orbit);
    this.orbit = orbit;
    note.textContent = portraitNote(study, orbit, frame, run, period);
  }

  storedState(frame, run) {
    const { study } = this;
    const n = study.nFloors;
    return Float64Array.from({ length: 2 * n }, (_, i) =>
      i < n ? study.displacement(frame, i, study.starts[run]) : study.velocity(frame, i - n, run));
  }

  fillControls() {
    const { study } = this;
    const fill = (id, entries) => fillMenu(byId(id), entries);
    fill("quantity", this.quantities.map((q) => [q.id, q.label]));
    fill("direction", study.directions.map((d, i) => [i, d]));
    const groups = this.floorGroups();
    const own = (floor) => study.structure.names[floor] ?? String(floor + 1);
    const groupName = (floors) => {
      if (floors.length === study.nFloors) return "all";
      const [first, last] = [floors[0], floors[floors.length - 1]];
      if (last - first >= floors.length) return floors.map(own).join(", ");
      return last > first ? `${own(first)}–${own(last)}` : own(last);
    };
    fill("floors", groups.map((floors, i) => [i, groupName(floors)]));
    fill("points", [["motion", "motion"], ["direction", study.each]]);
    byId("floors").disabled = groups.length < 2;
    byId("direction").previousSibling.data = study.each === "direction" ? "Direction " : "Attractor ";
    byId("direction").disabled = study.nDirections < 2;
  }

  listen() {
    byId("quantity").addEventListener("change", (event) => {
      this.quantity = this.quantities.find((q) => q.id === event.target.value);
      this.only = null;
      this.recolour();
      this.showNumbers();
      this.later();
    });
    byId("direction").addEventListener("change", (e) => this.setDirection(Number(e.target.value)));
    byId("floors").addEventListener("change", (event) => {
      this.setFloors(Number(event.target.value));
      this.later();
      this.portraits.show(this.orbit || null);
    });
    byId("points").addEventListener("change", (event) => this.colourPoints(event.target.value));
    byId("hold").addEventListener("change", (event) => {
      this.hold = event.target.checked;
      this.later();
    });
    byId("zoom-in").addEventListener("click", () => this.map.zoom(0.6));
    byId("zoom-out").addEventListener("click", () => this.map.zoom(1 / 0.6));
    byId("zoom-reset").addEventListener("click", () => this.map.setView(this.map.whole()));
    byId("map").addEventListener("keydown", (event) => this.key(event));
    window.addEventListener("resize", () => {
      this.map.resize();
      this.diagrams.resize();
      this.portraits.resize();
      this.later();
    });
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { nFrames, nAmplitudes, nDirections } = this.study;
    const step = event.shiftKey ? BIG_STEP : 1;
    const moves = {
      ArrowLeft: [0, -step], ArrowRight: [0, step], ArrowUp: [step, 0], ArrowDown: [-step, 0],
    };
    const within = (i, n) => Math.min(n - 1, Math.max(0, i));
    if (moves[event.key]) {
      const { frame, amplitude } = this.shown();
      const [df, da] = moves[event.key];
      this.point(within(frame + df, nFrames), within(amplitude + da, nAmplitudes));
    } else if (event.key === "Enter" || event.key === " ") {
      const { frame, amplitude } = this.shown();
      this.choose(frame, amplitude);
    } else if (event.key === "Escape") this.leave();
    else if (event.key === "+" || event.key === "=") this.map.zoom(0.6);
    else if (event.key === "-") this.map.zoom(1 / 0.6);
    else if (event.key === "0") this.map.setView(this.map.whole());
    else if (event.key.toLowerCase() === "d") {
      this.setDirection((this.direction + 1) % nDirections);
    } else return;
    event.preventDefault();
  }
}

start(async (meta) => new Explorer(await decodeStudy(meta)));
