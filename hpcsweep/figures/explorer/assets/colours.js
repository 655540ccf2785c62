// What the map can show, the colour of every code, and the legend. The colours are the study's:
// `study.colours` and `study.motionLegend`, the same as in every other figure.

const NAMED_SETS = 10; // contact sets that the legend names: the commonest

function pixel(hex) {
  const v = parseInt(hex.slice(1), 16);
  return (0xff000000 | ((v & 0xff) << 16) | (v & 0xff00) | (v >> 16)) >>> 0;
}

function shortNumber(x, digits = 4) {
  if (!Number.isFinite(x)) return "–";
  if (x === 0) return "0";
  const size = Math.abs(x);
  return size < 1e-4 || size >= 1e6 ? x.toExponential(digits - 1) : String(+x.toPrecision(digits));
}

// Each quantity: label, key(run) -> integer, classes (discrete) or scale (continuous).
function quantities(study) {
  const list = [motionQuantity(study)];
  if (study.data.contact) list.push(contactQuantity(study));
  const labels = {
    drift: ["drift δ [A/Ω²]", "drift δ [A/Ω²]"],
    lyapunov: ["Lyapunov exponent λ", "Lyapunov λ"].map((text) => text + unit(study, "rate")),
    share: ["share of the starts", "share"],
    number: ["number of attractors", "attractors there"],
  };
  for (const name of Object.keys(study.arrays)) {
    const norm = name.match(/^modal_norm_(\d+)$/);
    const [label, short] = norm
      ? [`mean modal norm η, mode ${norm[1]}`, `modal norm η${subscript(norm[1])}`]
      : labels[name] || [study.arrays[name].label, study.arrays[name].label];
    // of a storey, floor or contact
    const measure = study.arrays[name].label ? name.replace(/_\d+$/, "") : null;
    if (label) list.push({ ...valueQuantity(study, name, label), short, measure });
  }
  return list;
}

function motionQuantity(study) {
  const { motion, period } = study.data;
  const { motions, motionLegend, longest } = study;
  const notComputed = motionLegend.length;
  const places = motions.map((m) => (m.place < 0 ? notComputed : m.place));
  const periodic = motions.findIndex((m) => m.periodic);
  const key = (run) =>
    motion[run] === periodic
      ? places[periodic] + Math.min(period[run], longest + 1) - 1
      : places[motion[run]];
  const seen = new Set();
  for (let run = 0; run < motion.length; run++) seen.add(key(run));
  const legend = [...motionLegend, { name: study.missing, colour: study.colours.nothing }];
  const classes = legend
    .map(({ name, colour }, place) => ({ keys: [place], label: name, colour }))
    .filter((_, place) => seen.has(place));
  return {
    id: "motion",
    label: "motion: orbit period P, or kind",
    short: "motion",
    key,
    classes,
    colour: (run) => legend[key(run)].colour,
    name: (run) => (motion[run] === periodic ? `P${period[run]}` : legend[key(run)].name),
  };
}

function contactQuantity(study) {
  const { contact, motion } = study.data;
  const notDone = study.contacts.length;
  const key = (run) => (study.motions[motion[run]].done ? contact[run] : notDone);
  const { contacts, nothing } = study.colours;
  const classes = study.contacts
    .slice(0, NAMED_SETS)
    .map((name, i) => ({ keys: [i], label: name, colour: contacts[i] }));
  const rare = study.contacts.slice(NAMED_SETS);
  if (rare.length) {
    const keys = rare.map((_, i) => NAMED_SETS + i);
    const label = `${rare.length} rarer set${rare.length === 1 ? "" : "s"}`;
    classes.push({ keys, label, colours: contacts.slice(NAMED_SETS) });
  }
  if (motion.some((code) => !study.motions[code].done)) {
    classes.push({ keys: [notDone], label: "no result", colour: nothing });
  }
  return {
    id: "contact",
    label: "contact set C",
    key,
    classes,
    name: (run) => (key(run) === notDone ? "–" : study.contacts[contact[run]]),
  };
}

function valueQuantity(study, name, label) {
  const spec = study.arrays[name];
  const codes = study.data[name];
  let [low, high] = spec.colour;
  const signed = name === "lyapunov";
  if (signed) [low, high] = [Math.min(low, -1e-6), Math.max(high, 1e-6)];
  return {
    id: name,
    label,
    key: (run) => codes[run],
    scale: { low, high, signed, spec },
    name: (run) => shortNumber(study.value(name, run)),
  };
}

// Place of a value in the colours of numbers, 0 to 1; the sign changes in the middle.
function placeOf(value, { low, high, signed }) {
  if (signed) return value < 0 ? 0.5 - (0.5 * value) / low : 0.5 + (0.5 * value) / high;
  return high > low ? (value - low) / (high - low) : 0.5;
}

// Colour of each key as a pixel; with `only`, a class's label, all others are left out.
function colourTable(quantity, only, { numbers, nothing }) {
  if (quantity.scale) {
    const { spec } = quantity.scale;
    const table = new Uint32Array(65536).fill(pixel(nothing));
    for (let code = 1; code < table.length; code++) {
      const value = spec.low + (code - 1) * spec.step;
      const place = Math.min(1, Math.max(0, placeOf(value, quantity.scale)));
      table[code] = pixel(numbers[Math.round(255 * place)]);
    }
    return table;
  }
  const most = Math.max(...quantity.classes.flatMap((c) => c.keys));
  const table = new Uint32Array(most + 1).fill(pixel(nothing));
  for (const c of quantity.classes.filter((own) => !only || only === own.label)) {
    c.keys.forEach((key, i) => (table[key] = pixel(c.colours ? c.colours[i] : c.colour)));
  }
  return table;
}

function drawLegend(element, quantity, only, { numbers, nothing, grazing }, choose) {
  element.replaceChildren();
  if (quantity.scale) {
    const { low, high, signed } = quantity.scale;
    const bar = document.createElement("span");
    bar.className = "bar";
    bar.style.background = `linear-gradient(to right, ${numbers.filter((_, i) => i % 15 === 0)})`;
    element.append(
      text(`${quantity.short}:`), text(`≤ ${shortNumber(low, 3)}`), bar,
      text(`≥ ${shortNumber(high, 3)}${signed ? ", 0 in the middle" : ""}`),
      chip(nothing), text("no value"), ...grazingKey(grazing));
    return;
  }
  element.append(text(`${quantity.short || quantity.label}:`));
  for (const c of quantity.classes) {
    const button = document.createElement("button");
    button.type = "button";
    button.title = "show this class alone";
    button.setAttribute("aria-pressed", String(only === c.label));
    button.append(...(c.colour ? [chip(c.colour)] : []), c.label);
    button.addEventListener("click", () => choose(only === c.label ? null : c.label));
    element.append(button);
  }
  element.append(...grazingKey(grazing));
}

// The key of the grazing line; nothing where no frame has one.
function grazingKey(colour) {
  if (!colour) return [];
  const line = chip(colour);
  line.classList.add("stroke");
  return [line, text("grazing")];
}

function chip(colour) {
  const span = document.createElement("span");
  span.className = "chip";
  span.style.background = colour;
  return span;
}

function text(words) {
  const span = document.createElement("span");
  span.className = "wide";
  span.textContent = words;
  return span;
}
