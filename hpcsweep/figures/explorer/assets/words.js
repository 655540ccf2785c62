// The page in words: what is shown, how it was made, how exact it is.

// Say of an integrated orbit how it was made and how far it is from the stored points.
function portraitNote(study, orbit, frame, run, period) {
  const made =
    "Line and points are integrated in this page (Dormand–Prince 5(4)) from one stored point";
  if (orbit.failed) return `${made}; the integration failed.`;
  if (!period) {
    return `${made}: ${orbit.points.length} periods of the same motion, not the same history ` +
      `(the stored point is rounded to ${shortNumber(study.resolution.points, 2)}${inUnit(study, "length")}).`;
  }
  let off = 0;
  const kept = Math.min(study.data.counts[run], period);
  for (let j = 0; j < kept; j++) {
    for (let i = 0; i < study.nFloors; i++) {
      const stored = study.displacement(frame, i, study.starts[run] + j);
      off = Math.max(off, Math.abs(stored - orbit.points[j][i]));
    }
  }
  const warned = off > 3 * study.resolution.points + 1e-4 * study.structure.units[0];
  const settled = orbit.settling ? ` after ${orbit.settling} periods` : "";
  const judged = warned ? " Beware: this is another orbit than the stored one." : "";
  return `${made}${settled}; it closes to ${shortNumber(orbit.closed, 2)} and is at most ` +
    `${shortNumber(off, 2)}${inUnit(study, "length")} off the stored points ` +
    `(rounded to ${shortNumber(study.resolution.points, 2)}).${judged}`;
}

// Whether a run is chaotic: as long as it was followed, so that it may be a transient.
function isChaotic(study, run) {
  return study.motions[study.data.motion[run]].name === "chaotic";
}

// Notes on the keys, the units and what was left out or rounded, one paragraph each.
function notes(study) {
  const t = study.thinned;
  const words = [
    "Point at the map: orbit diagram of that frame. Click: phase portrait and numbers of that " +
      "run. Click into the orbit diagram: another run. Click the portraits: larger. Drag a box or turn the wheel: zoom; " +
      "double click: whole map. A legend entry shows its class alone.",
    `Keys on the map: arrows move the pointed run (with Shift by 20), Enter selects it, ` +
      `Escape returns to the selected one, + − 0 zoom, D changes the ${study.each}.`,
    ...(study.branches.length
      ? ["Branches of periodic orbits lie beneath the orbit diagrams of those frequencies that the " +
         "file of branches has. Point at one: multipliers, signature and phase portrait of that orbit."] : []),
    ...(study.each === "attractor"
      ? ["An attractor keeps its number and colour along A, at each frequency anew, while it is " +
         "followed; new ones are numbered by falling share of the starts."] : []),
    ...(study.motions.some(({ name }, code) => name === "chaotic" && study.data.motion.includes(code))
      ? ["Chaotic means: as long as the run was followed (periods integrated). It may be a long " +
         "transient, which ends on another motion, and then it is no attractor."] : []),
    (study.unitNames.length === "gaps"
      ? "Lengths are in gaps (the stop is at 1), time in 1/ω₀ of one storey. "
      : "Lengths and times are in the units in which the structure was given. ") +
      "The map shows the run " +
      "nearest to each pixel; colours of numbers span 1 % to 99 % of them.",
    `Numbers are rounded to: ${Object.entries(study.arrays)
      .filter(([, spec]) => "step" in spec)
      .map(([name, spec]) => `${name.replaceAll("_", " ")} ${shortNumber(spec.step, 2)}`)
      .join(", ")}.`,
  ];
  if (study.resolution.points) {
    words.push(
      `Stroboscopic points are rounded to 1/${2 ** study.bits} of their range in the frame, at ` +
        `worst ${shortNumber(study.resolution.points, 2)}${inUnit(study, "length")} and ` +
        `${shortNumber(study.resolution.speed, 2)}${inUnit(study, "velocity")}; ` +
        `at most ${t.points} of the ${t.of_points} of a run are here.`);
  }
  const modes = Object.keys(study.arrays).filter((name) => name.startsWith("modal_norm_")).length;
  if (modes && modes < study.nFloors) {
    words.push(`Modal norms are those of the lowest ${modes} of ${study.nFloors} modes.`);
  }
  if (t.frame_step > 1 || t.amplitude_step > 1) {
    words.push(`Thinned: one frame in ${t.frame_step}, one ${study.axes.x.noun} in ${t.amplitude_step}.`);
  }
  return words;
}

function stopWords(structure) {
  return structure.stops.some((own) => own.length) ? "stop dashed" : "";
}

// The legend of the orbit diagrams, whose points are coloured by motion or by direction.
function describeDiagrams(study, by, labelled) {
  const entries = by === "motion"
    ? [["", "points by motion, colours as on the map of motions"]]
    : study.words.map((name, i) => [study.colours.directions[i], name]);
  if (study.branches.length) entries.push(["", "branches: stable full, unstable thin"]);
  if (study.colours.grazing) entries.push([study.colours.grazing, "grazing", "stroke"]);
  if (!labelled) entries.push(["", `u(jT)${unit(study, "length")}`]);
  byId("diagram-legend").replaceChildren(
    ...entries.map(([colour, name, kind]) => {
      const entry = document.createElement("span");
      if (colour) entry.append(chip(colour));
      if (kind) entry.firstChild.classList.add(kind);
      entry.append(name);
      return entry;
    }),
    study.data.points ? stopWords(study.structure) : "the results hold no stroboscopic points");
}

function describe(study) {
  const s = study.structure;
  byId("title").textContent = study.name;
  byId("structure").textContent =
    `${s.words}; ` +
    [[study.nFrames, "frame"], [study.nAmplitudes, study.axes.x.noun], [study.nDirections, study.each]]
      .map(([count, noun]) => `${count} ${noun}${count === 1 ? "" : "s"}`).join(" × ");
  byId("notes").replaceChildren(
    ...notes(study).map((words) => {
      const p = document.createElement("p");
      p.textContent = words;
      return p;
    }));
}
