// What every page has: axes, a table of numbers, and how it starts.

const byId = (id) => document.getElementById(id);

const AXIS = {
  stroke: "#1a1a1a",
  grid: { show: false },
  ticks: { size: 4, stroke: "#999", width: 1 },
  border: { show: true, stroke: "#999", width: 1 },
  font: "12px sans-serif",
  values: (u, splits, axis, space, step) => {
    const digits = Math.min(12, Math.max(0, Math.ceil(1 - Math.log10(step))));
    return splits.map((value) => String(+value.toFixed(digits) || 0).replace("-", "−"));
  },
};

const LEAST_AXIS = 36; // width of the numbers beside a diagram, at least
const DIGIT = 7; // width of one digit in pixels

// Width of the numbers of a vertical axis.
function axisSize(values) {
  const longest = Math.max(0, ...(values || []).map((words) => words.length));
  return Math.max(LEAST_AXIS, DIGIT * longest + 12);
}

function fillNumbers(caption, rows) {
  byId("numbers").caption.textContent = caption;
  byId("numbers").tBodies[0].replaceChildren(
    ...rows.map(([name, value]) => {
      const row = document.createElement("tr");
      const head = document.createElement("th");
      head.scope = "row";
      head.textContent = name;
      const cell = document.createElement("td");
      cell.textContent = value;
      row.append(head, cell);
      return row;
    }));
}

// Fill a menu with pairs of a value and its text.
function fillMenu(menu, entries) {
  menu.replaceChildren(...entries.map(([value, label]) => new Option(label, value)));
}

// Show the page that `open` makes of the description in it.
async function start(open) {
  const loading = byId("loading");
  try {
    window.explorer = await open(JSON.parse(byId("meta").textContent));
    loading.hidden = true;
    document.body.dataset.ready = "true";
  } catch (error) {
    loading.textContent = `This page cannot be shown: ${error.message}`;
    throw error;
  }
}
