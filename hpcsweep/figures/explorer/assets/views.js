// What the panels of records draw: curves of incremental dynamic analysis, fragility, profiles.
// A view is the `spec` of a Panel; all read the state of the page whenever they draw.

const FEW = 100; // records up to which their curves cover each other
const FINE = 240; // points of a fitted curve
const HISTORY = 170; // height of histories
const MOST_LEVELS = 12; // names beside a profile
const DASHED = [6, 4];
const DOTTED = [2, 3];

const inBrackets = (name) => (name ? `  [${name}]` : "");

// Colour of the records that are not pointed at, so that many show where they are dense.
const grey = (page) => theme("grey") + (page.n > FEW ? "50" : "");

// Height of a panel: its share of what controls, and histories below, leave of the window.
const heightOf = (page, share, below) => () => Math.max(180, share * (window.innerHeight
  - byId("curves").getBoundingClientRect().top - window.scrollY
  - (page.study.history.length ? HISTORY + 22 : 0)) - below);

// Response of each record across, intensity up.
function curvesView(page) {
  const { scales, study } = page;
  const last = scales.at(-1);
  return {
    x: () => ({ label: page.about.label + inBrackets(page.about.unit), range: [0, page.edge] }),
    y: () => ({ label: page.kind.measure, range: [0, 1.02 * last] }),
    height: heightOf(page, 1, 72),
    stripe: (value) => scales.reduce((best, scale, k) =>
      Math.abs(scale - value) < Math.abs(scales[best] - value) ? k : best, 0),
    base: (pen) => {
      for (const curve of page.curves) pen.line(page.upwards(curve), grey(page), 0.7);
      const [low, middle, high] = page.fractiles.map((values) => page.upwards(values));
      for (const outer of [low, high]) pen.line(outer, page.own, 1.8, DASHED);
      pen.line(middle, page.own, 2.4);
      const free = scales.map((_, k) =>
        responseFractile(ascending(page.alone.map((curve) => curve[k])), 0.5));
      if (page.touches) pen.line(page.upwards(free), study.stop, 2, DOTTED);
    },
    over: (pen) => {
      const at = scales[page.stripe()];
      const across = page.collapse ? NaN : page.threshold;
      pen.line([[across, 0], [across, 2 * last]], theme("ink"), 1, [1, 2]);
      pen.line([[0, at], [page.edge, at]], theme("ink"), 0.6, [1, 4]);
    },
    curve: (i) => page.upwards(page.curves[i]),
    mark: (pen, i, colour) => {
      const at = page.stripe();
      pen.line(page.upwards(page.curves[i]), colour, 2.4);
      pen.dots([[page.curves[i][at], scales[at]]], colour, 4.5);
    },
  };
}

// Share of records that reach the threshold: at the stripes, by their capacities, fitted.
function fragilityView(page) {
  const { scales, study } = page;
  const steps = (sorted) => {
    const points = [[0, 0]];
    sorted.forEach((scale, i) => {
      const share = (k) => [scale, k / sorted.length];
      if (scale <= page.highest) points.push(share(i), share(i + 1));
    });
    return [...points, [page.highest, points.at(-1)[1]]];
  };
  const own = (i) => [page.capacity[i].scale, page.rank[i] / page.sorted.length];
  return {
    x: () => ({ label: page.kind.measure, range: [0, page.highest] }),
    y: () => ({ label: "share of records", range: [0, 1.02] }),
    height: heightOf(page, 0.5, 48),
    stripe: () => page.stripe(),
    base: (pen) => {
      if (page.fit) {
        const fine = Array.from({ length: FINE }, (_, i) => ((i + 1) / FINE) * page.highest);
        const shares = fine.map(page.fit.at);
        const line = (which) => fine.map((x, i) => [x, shares[i][which]]);
        pen.area([...line(1), ...line(2).reverse()], page.own, 0.2);
        const last = page.kind.exact ? Infinity : scales.at(-1);
        pen.line(line(0).filter(([x]) => x <= last), page.own, 2.2);
        pen.line(line(0).filter(([x]) => x > last), page.own, 2.2, DASHED);
      }
      pen.line(steps(page.sorted), page.own, 0.8);
      if (page.freeSorted.length) pen.line(steps(page.freeSorted), study.stop, 1.4, DOTTED);
      pen.dots(scales.map((scale, k) => [scale, page.share(k)]), page.own, 2.6);
    },
    curve: (i) => [own(i)],
    mark: (pen, i, colour) => {
      if (!Number.isFinite(own(i)[0])) return;
      pen.line([[own(i)[0], 0], own(i)], colour, 1.6);
      pen.dots([own(i)], colour, 4.5);
    },
  };
}

// Displacements of the top floor of each building, over the time, of the records that are marked.
function historyView(page) {
  const { study, data } = page;
  const { history: time, bits } = study;
  const { places, panels, size, unit } = study.responses.displacement;
  const tops = panels.map(([, own]) => own.at(-1));
  const rowOf = (record, top) =>
    ((page.part * page.n + record) * page.scales.length + page.stripe()) * places.length + top;
  const largest = (record, top) => data.history_size[rowOf(record, top)] / size;
  const step = 1 / (2 ** (bits - 1) - 1);
  const range = () => {
    const sizes = page.marked().flatMap(([record]) => tops.map((top) => largest(record, top)));
    const most = 1.07 * Math.max(0, ...sizes) || 1;
    return [-most, most];
  };
  return {
    x: () => ({ label: `time${study.time}`, range: [time[0], time.at(-1)] }),
    y: () => ({ label: `displacement${inBrackets(unit)}`, range: range() }),
    height: () => HISTORY,
    stripe: () => page.stripe(),
    base: () => {},
    curve: () => [],
    mark: (pen, record, colour) => tops.forEach((top, k) => {
      const first = rowOf(record, top) * time.length;
      pen.line(time.map((own, j) => {
        const code = data.history[first + j]; // 0 where the motion has ended
        return [own, code ? largest(record, top) * ((code - 1) * step - 1) : NaN];
      }), colour, 1.1, k ? DASHED : []);
    }),
  };
}

// Responses over the height of each building, or over all places of one kind, at one intensity.
function profileViews(page) {
  const { about } = page;
  const levels = about.panels.flatMap(([, , own]) => own);
  const every = about.places.map((_, place) => place);
  const records = Array.from({ length: page.n }, (_, i) => i);
  const widest = () => {
    const sizes = records.map((i) => page.value(i, page.stripe(), every)).filter(Number.isFinite);
    const largest = Math.max(0, ...sizes) || page.edge;
    return 1.05 * (page.outliers ? Math.min(largest, page.edge) : largest);
  };
  return about.panels.map(([title, places, level]) => {
    const up = (values) => values.map((value, j) => [value, level[j]]);
    const of = (i) => places.map((place) => page.value(i, page.stripe(), [place]));
    const counted = (of, count) =>
      up(places.map((_, j) => count(ascending(records.map((i) => of(i)[j])))));
    const free = (i) => places.map((place) => page.free(i, page.stripe(), [place]));
    const step = Math.ceil(level.length / MOST_LEVELS);
    const named = level.flatMap((_, j) => (j % step ? [] : [j]));
    return {
      x: () => ({
        label: (title ? `building ${title}` : about.label) + inBrackets(about.unit),
        range: [0, widest()],
      }),
      y: () => ({
        label: "",
        range: [Math.min(...levels) - 0.5, Math.max(...levels) + 0.5],
        splits: named.map((j) => level[j]),
        values: named.map((j) => about.places[places[j]]),
      }),
      height: heightOf(page, 0.5, 48),
      stripe: () => page.stripe(),
      base: (pen) => {
        for (const i of records) pen.line(up(of(i)), grey(page), 0.7);
        for (const part of [0.16, 0.84]) {
          pen.line(counted(of, (own) => fractile(own, part)), page.own, 1.6, DASHED);
        }
        pen.line(counted(of, median), page.own, 2.4);
        pen.dots(counted(of, median), page.own, 2.4);
        if (page.touches) pen.line(counted(free, median), page.study.stop, 2, DOTTED);
      },
      curve: (i) => up(of(i)),
      mark: (pen, i, colour) => {
        pen.line(up(of(i)), colour, 2.4);
        pen.dots(up(of(i)), colour, 3.5);
      },
    };
  });
}
