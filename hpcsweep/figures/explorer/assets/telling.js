// The page of records in words and numbers.

const withUnit = (value, name, digits = 4) => shortNumber(value, digits) + (name ? ` ${name}` : "");
const withCollapse = (value, name, digits) =>
  (value === Infinity ? "collapse" : withUnit(value, name, digits));

// The measure of the scales and its unit.
function measureOf(page) {
  const [, measure, unit] = page.kind.measure.match(/^(.*?)(?: +\[(.*)\])?$/);
  return { measure, unit: unit || "" };
}

// Say what is shown.
function tell(page) {
  const { study, about, kind, scales } = page;
  const { measure, unit } = measureOf(page);
  const at = page.stripe();
  const stripe = `${measure} = ${withUnit(scales[at], unit)}`;
  const outliers = `${page.outliers} outlier${page.outliers > 1 ? "s" : ""} beyond the edge`;
  byId("structure").textContent = [
    `${page.n} records × ${scales.length} scales of ${measure}`,
    study.parts.length > 1 ? `structure ${page.part + 1} of ${study.parts.length}` : "",
    page.outliers ? `${outliers}, up to ${shortNumber(page.largest, 3)}` : "",
    kind.note].filter(Boolean).join("; ");
  writeKeys(page);
  byId("profile-title").textContent = `${about.label} at ${stripe}`;
  byId("fit").textContent = fitWords(page, unit);
  const { panels, places } = study.responses.displacement;
  const tops = panels.map(([, own]) => places[own.at(-1)]).join(", dashed ");
  byId("history-title").textContent = `Displacement of ${tops} at ${stripe}`;
  const record = page.here ? page.here.record : page.pin;
  const { caption } = byId("numbers");
  if (record === null) {
    byId("readout").textContent = "";
    fillNumbers("Medians at this intensity", medians(page, at));
    caption.style.color = "";
    return;
  }
  const name = study.records[record];
  const limit = page.collapse ? "collapse" : withUnit(page.threshold, about.unit);
  byId("readout").textContent = `${name} at ${stripe}: ${about.label} ` +
    `${withCollapse(page.curves[record][at], about.unit)}, reaches ${limit} ` +
    capacityWords(page.capacity[record], unit);
  fillNumbers(name, numbersOf(page, record, at, unit));
  caption.style.color = page.here ? study.colours.pointed : study.colours.kept;
}

function capacityWords({ scale, later }, unit) {
  if (Number.isNaN(scale)) return "at an intensity that is not known";
  if (scale === Infinity) return "at no stripe";
  return `at ${withUnit(scale, unit)}` + (later ? `, and crosses it ${later} times more` : "");
}

function fitWords(page, unit) {
  const { fit, kind, scales, capacity } = page;
  const what = page.collapse ? "collapse" : `reach ${withUnit(page.threshold, page.about.unit)}`;
  const own = capacity.filter(({ scale }) => Number.isFinite(scale)).length;
  const known = page.sorted.length;
  const words = [`${own} of ${known} records ${what}${kind.exact ? "" : " within the stripes"}`];
  if (known < page.n) words.push(`${page.n - known} not known`);
  if (fit) {
    words.push(`median ${withUnit(fit.median, unit)}, β = ${shortNumber(fit.dispersion, 3)}`);
    const above = fit.median > scales.at(-1) || own < 0.5 * known;
    const beyond = above ? "beyond the last" : fit.median < scales[0] ? "below the first" : "";
    if (!kind.exact && beyond) words.push(`an extrapolation ${beyond} stripe`);
  } else words.push("no curve: two different capacities are needed");
  if (page.freeSorted.length) {
    words.push(`${kind.alone}: 50 % at ${withUnit(fractile(page.freeSorted, 0.5), unit)}`);
  }
  const again = capacity.filter(({ later }) => later).length;
  if (again) words.push(`${again} curve${again > 1 ? "s cross" : " crosses"} it again`);
  return words.join("; ");
}

// Rows of all responses: the shown one at its place, the largest of the others.
function responseRows(page, valueOf) {
  return Object.entries(page.study.responses).flatMap(([name, { label, places, unit }]) => {
    const shown = name === page.response ? page.places : places.map((_, place) => place);
    const value = valueOf(shown, name);
    const words = withCollapse(value, unit, 3);
    return Number.isNaN(value) ? [] : [[label.replace(/^peak /, ""), words]];
  });
}

function medians(page, at) {
  return responseRows(page, (places, name) =>
    median(ascending(page.curves.map((_, i) => page.value(i, at, places, name)))));
}

function numbersOf(page, record, at, unit) {
  const { kind, study } = page;
  const factor = page.data.factor[page.part * page.n + record] * page.upTo(at);
  const { scale } = page.capacity[record];
  const free = withUnit(page.free(record, at), page.about.unit, 3);
  return [
    ["times the record", shortNumber(factor, 4)],
    ...responseRows(page, (places, name) => page.value(record, at, places, name)),
    ...(page.touches ? [[kind.alone, free]] : []),
    ["capacity", Number.isFinite(scale) ? withUnit(scale, unit) : "–"],
    ...study.facts.map(({ label, unit: own, values }) => [label, withUnit(values[record], own, 3)])];
}

// The legends.
function writeKeys(page) {
  const { own, kind } = page;
  const write = (id, entries) => byId(id).replaceChildren(
    ...entries.map(([style, colour, name]) => {
      const entry = document.createElement("span");
      const line = document.createElement("i");
      line.className = style;
      line.style.borderColor = colour;
      entry.append(line, name);
      return entry;
    }));
  const alone = (words) => ["dotted", page.study.stop, kind.alone + words];
  write("curves-key", [["solid", theme("grey"), "records"], ["solid", own, "50 %"],
    ["dashed", own, "16, 84 %"], ...(page.touches ? [alone(", 50 %")] : [])]);
  write("fragility-key", [["solid", own, "lognormal, 95 % band"], ["dots", own, "counted"],
    ...(page.freeSorted.length ? [alone(", counted")] : [])]);
}

// Notes on the keys, on what is counted and what is not in the page, one paragraph each.
function writeNotes(study) {
  const notes = [
    "Keys on the analysis: left and right arrows point at the record of the next smaller or larger " +
      "response, up and down at the next intensity, Enter keeps the record, Escape leaves it.",
    "Fractiles are counted: the 84 % fractile is the smallest value that 84 % of the records do not " +
      "exceed. The capacity of a record is the smallest intensity whose response reaches the " +
      "threshold, on the line between two stripes; a lognormal distribution of largest likelihood " +
      "is fitted to capacities, records above the last stripe as such. The band is one of 95 %. " +
      "Without contacts and yielding capacities are exact, and go on beyond the stripes. " +
      "Curves are flat to the edge where a structure collapses.",
    "All responses are those of the file, rounded to 7 digits. " + (study.history.length
      ? `Displacements over the time are those that the file stores, to 1/${2 ** (study.bits - 1)} ` +
        "of the largest of each. "
      : `Motions are not in this page: the file ${study.leftOut ? "has too many" : "stores none"}. `) +
      `hpcsweep plot ${study.file} --kind history --record NAME --scale X draws all of one.`,
  ];
  byId("notes").replaceChildren(...notes.map((words) => {
    const p = document.createElement("p");
    p.textContent = words;
    return p;
  }));
}
