// Arrays out of the page's text: the inverse of encode.py.

const ARRAY_OF = { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array };

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function decodeArray(name, spec) {
  const element = document.getElementById("data-" + name);
  const planes = await inflate(fromBase64(element.textContent));
  element.remove();
  if (planes.length !== spec.length * spec.bytes) {
    throw new Error(`array ${name}: ${planes.length} bytes, expected ${spec.length * spec.bytes}`);
  }
  if (spec.bytes === 1) return undoRows(planes, spec.row);
  const values = new ARRAY_OF[spec.bytes](spec.length);
  for (let b = 0, at = 0; b < spec.bytes; b++) {
    for (let i = 0; i < spec.length; i++) values[i] |= planes[at++] << (8 * b);
  }
  return undoRows(values, spec.row);
}

function undoRows(values, row) {
  if (row > 1) {
    for (let start = 0; start < values.length; start += row) {
      for (let i = start + 1; i < start + row; i++) values[i] += values[i - 1];
    }
  }
  return values;
}

// Undo predict_points; returns where each run's points start.
function undoPoints(points, counts, nAmplitudes, nFloors) {
  const starts = new Uint32Array(counts.length + 1);
  for (let run = 0; run < counts.length; run++) starts[run + 1] = starts[run] + counts[run];
  const total = starts[counts.length];
  for (let floor = 0; floor < nFloors; floor++) {
    const offset = floor * total;
    for (let run = 1; run < counts.length; run++) {
      const count = counts[run];
      if (run % nAmplitudes === 0 || count !== counts[run - 1]) continue;
      const end = offset + starts[run + 1];
      for (let i = offset + starts[run]; i < end; i++) points[i] += points[i - count];
    }
  }
  return starts;
}

// All arrays of the page, by their names.
async function decodeArrays(meta) {
  const data = {};
  for (const [name, spec] of Object.entries(meta.arrays)) {
    const numbers = await decodeArray(name, spec);
    data[name] = spec.float32 ? new Float32Array(numbers.buffer) : numbers;
  }
  return data;
}

// The arrays of the page, and the study's sizes.
async function decodeStudy(meta) {
  const study = {
    ...meta,
    nFrames: meta.omega.length,
    nAmplitudes: meta.amplitude.length,
    nDirections: meta.directions.length,
    nFloors: meta.structure.floors,
    data: await decodeArrays(meta),
  };
  if (study.data.points) {
    study.starts = undoPoints(
      study.data.points, study.data.counts, study.nAmplitudes, study.nFloors);
    study.nPoints = study.starts[study.starts.length - 1];
  }
  study.run = (frame, direction, amplitude) =>
    (frame * study.nDirections + direction) * study.nAmplitudes + amplitude;
  study.value = (name, run) => {
    const spec = meta.arrays[name];
    const code = study.data[name][run];
    return code ? spec.low + (code - 1) * spec.step : NaN;
  };
  const levels = 2 ** meta.bits - 2;
  study.displacement = (frame, floor, point) => {
    const [low, high] = meta.arrays.points.ranges[frame][floor];
    return low + ((study.data.points[floor * study.nPoints + point] - 1) * (high - low)) / levels;
  };
  study.velocity = (frame, floor, run) => {
    const [low, high] = meta.arrays.speed.ranges[frame][floor];
    const code = study.data.speed[floor * study.data.counts.length + run];
    return code ? low + ((code - 1) * (high - low)) / levels : NaN;
  };
  return study;
}
