// What the map can show, the colour of every code, and the legend.

const NO_VALUE = "#d9d9d9";
const DIMMED = "#ffffff";

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
    lyapunov: ["Lyapunov exponent λ [ω₀]", "Lyapunov λ [ω₀]"],
  };
  for (const name of Object.keys(study.arrays)) {
    const norm = name.match(/^modal_norm_(\d+)$/);
    const [label, short] = norm
      ? [`mean modal norm η, mode ${norm[1]}`, `modal norm η${subscript(norm[1])}`]
      : labels[name] || [];
    if (label) list.push({ ...valueQuantity(study, name, label), short });
  }
  return list;
}

function motionQuantity(study) {
  const { motion, period } = study.data;
  const kinds = study.motions.length;
  const periodic = study.motions.findIndex((m) => m.periodic);
  const own = study.palette.length;
  const key = (run) => (motion[run] === periodic ? kinds + period[run] : motion[run]);
  const seen = new Map();
  for (let run = 0; run < motion.length; run++) {
    const k = key(run);
    seen.set(k, (seen.get(k) || 0) + 1);
  }
  const periods = [...seen.keys()].filter((k) => k > kinds).map((k) => k - kinds);
  const classes = [];
  for (const p of periods.filter((q) => q <= own).sort((a, b) => a - b)) {
    classes.push({ keys: [kinds + p], label: `P${p}`, colour: study.palette[p - 1] });
  }
  const long = periods.filter((q) => q > own).sort((a, b) => a - b);
  if (long.length) {
    const label = long.length > 1 ? `P${long[0]}–P${long[long.length - 1]}` : `P${long[0]}`;
    classes.push({ keys: long.map((p) => kinds + p), label, colour: study.longPeriod });
  }
  study.motions.forEach((m, code) => {
    if (!m.periodic && seen.has(code)) {
      classes.push({ keys: [code], label: m.name, colour: m.colour });
    }
  });
  return {
    id: "motion",
    label: "motion: orbit period P, or kind",
    short: "motion",
    key,
    classes,
    name: (run) => (motion[run] === periodic ? `P${period[run]}` : study.motions[motion[run]].name),
  };
}

function contactQuantity(study) {
  const { contact, motion } = study.data;
  const notDone = study.contacts.length;
  const key = (run) => (study.motions[motion[run]].done ? contact[run] : notDone);
  const own = study.palette.length;
  const label = (name) => (name === "none" ? "no contact" : name);
  const classes = study.contacts
    .slice(0, own)
    .map((name, i) => ({ keys: [i], label: label(name), colour: study.palette[i] }));
  const rare = study.contacts.slice(own);
  if (rare.length) {
    const keys = rare.map((_, i) => own + i);
    classes.push({ keys, label: `${rare.length} rarer sets`, colour: study.rareContact });
  }
  if (motion.some((code) => !study.motions[code].done)) {
    classes.push({ keys: [notDone], label: "no result", colour: "#ffffff" });
  }
  return {
    id: "contact",
    label: "contact set C",
    key,
    classes,
    name: (run) => (key(run) === notDone ? "–" : label(study.contacts[contact[run]])),
  };
}

function valueQuantity(study, name, label) {
  const spec = study.arrays[name];
  const codes = study.data[name];
  let [low, high] = spec.colour;
  const diverging = name === "lyapunov";
  if (diverging) {
    high = Math.max(-low, high);
    low = -high;
  }
  return {
    id: name,
    label,
    key: (run) => codes[run],
    scale: { low, high, colours: study.maps[diverging ? "diverging" : "sequential"], spec },
    name: (run) => shortNumber(study.value(name, run)),
  };
}

// Colour of each key as a pixel; with `only`, a class's label, all others are dimmed.
function colourTable(quantity, only) {
  if (quantity.scale) {
    const { low, high, colours, spec } = quantity.scale;
    const table = new Uint32Array(65536).fill(pixel(NO_VALUE));
    for (let code = 1; code < table.length; code++) {
      const value = spec.low + (code - 1) * spec.step;
      const place = high > low ? (value - low) / (high - low) : 0.5;
      table[code] = pixel(colours[Math.round(255 * Math.min(1, Math.max(0, place)))]);
    }
    return table;
  }
  const most = Math.max(...quantity.classes.flatMap((c) => c.keys));
  const table = new Uint32Array(most + 1).fill(pixel("#ffffff"));
  for (const c of quantity.classes) {
    const colour = pixel(only && only !== c.label ? DIMMED : c.colour);
    for (const key of c.keys) table[key] = colour;
  }
  return table;
}

function drawLegend(element, quantity, only, choose) {
  element.replaceChildren();
  if (quantity.scale) {
    const { low, high, colours } = quantity.scale;
    const bar = document.createElement("span");
    bar.className = "bar";
    bar.style.background = `linear-gradient(to right, ${colours.filter((_, i) => i % 15 === 0)})`;
    const none = chip(NO_VALUE);
    element.append(
      text(`${quantity.label}:`), text(`≤ ${shortNumber(low, 3)}`), bar,
      text(`≥ ${shortNumber(high, 3)}`), none, text("no value"));
    return;
  }
  element.append(text(`${quantity.short || quantity.label}:`));
  for (const c of quantity.classes) {
    const button = document.createElement("button");
    button.type = "button";
    button.title = "show this class alone";
    button.setAttribute("aria-pressed", String(only === c.label));
    button.append(chip(c.colour), c.label);
    button.addEventListener("click", () => choose(only === c.label ? null : c.label));
    element.append(button);
  }
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
