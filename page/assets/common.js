"use strict";
// What all parts of the page share: where data come from, how numbers read, and colours.
const Grainspan = {};

// An error of a script is shown, not hidden.
window.addEventListener("error", (event) => { document.body.dataset.error = event.message; });
window.addEventListener("unhandledrejection", (event) => { document.body.dataset.error = String(event.reason); });

// Embedded data of a report; null for a page that a server gives.
Grainspan.embedded = JSON.parse(document.getElementById("data").textContent);
Grainspan.isLive = Grainspan.embedded === null;

Grainspan.element = (id) => document.getElementById(id);

// A new element with text and attributes; text never becomes markup.
Grainspan.make = (tag, text, attributes = {}) => {
  const made = document.createElement(tag);
  if (text !== undefined && text !== null) made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
};

// Data by name and query: `state`, `history`, `log`, `mesh`, `frame`, `cell`. Null where there is none.
Grainspan.get = async (name, query = {}) => {
  const embedded = Grainspan.embedded;
  if (embedded === null) {
    const answer = await fetch(`api/${name}?${new URLSearchParams(query)}`);
    if (!answer.ok) throw new Error(`${name}: ${answer.status}`);
    return answer.json();
  }
  if (name === "frame") return embedded.frames[query.step] ?? null;
  if (name === "cell") {
    const steps = embedded.cells[query.point];
    if (!steps) return null;
    const known = Object.keys(steps).map(Number).sort((a, b) => a - b);
    const before = known.filter((step) => step <= query.step);
    return steps[before.length ? before[before.length - 1] : known[0]];
  }
  return embedded[name] ?? null;
};

// Asks the run for something; returns an error text or null.
Grainspan.post = async (name, query) => {
  const answer = await fetch(`api/${name}?${new URLSearchParams(query)}`, { method: "POST" });
  return answer.ok ? null : (await answer.text()).trim();
};

const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "\u00b5"], [1e-9, "n"]];
const WITH_PREFIX = new Set(["Pa", "N", "N/m", "J", "J/m", "J/m3", "m", "m/s"]);

// A unit in which values up to `largest` read well: `factor` turns a value into it.
Grainspan.scaled = (unit, largest) => {
  if (!unit || unit === "-") return { factor: 1, unit: "" };
  const shown = unit.replace("m3", "m\u00b3").replace("s2", "s\u00b2");
  if (!WITH_PREFIX.has(unit) || !(largest > 0)) return { factor: 1, unit: shown };
  const [size, letter] = PREFIXES.find(([size]) => largest >= size) ?? PREFIXES[PREFIXES.length - 1];
  return { factor: 1 / size, unit: letter + shown };
};

// A number in at most `digits` digits.
Grainspan.number = (value, digits = 4) => {
  if (value === null || value === undefined || !Number.isFinite(value)) return "\u2013";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (Number.isInteger(value) && size < 1e7) return String(value);
  const text = size >= 1e5 || size < 1e-3 ? value.toExponential(digits - 1) : value.toPrecision(digits);
  return text.includes("e") ? text.replace(/\.?0+e/, "e").replace("e+", "e") : text.replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, "");
};

Grainspan.withUnit = (value, unit) => {
  const scale = Grainspan.scaled(unit, Math.abs(value));
  return `${Grainspan.number(value * scale.factor)}${scale.unit ? ` ${scale.unit}` : ""}`;
};

Grainspan.words = (name) => name.replaceAll("_", " ");

Grainspan.seconds = (value) => {
  if (!Number.isFinite(value)) return "\u2013";
  if (value < 60) return `${Grainspan.number(value, 3)} s`;
  const pad = (part) => String(Math.floor(part)).padStart(2, "0");
  return value < 3600 ? `${Math.floor(value / 60)}:${pad(value % 60)} min` : `${Math.floor(value / 3600)}:${pad((value / 60) % 60)} h`;
};

Grainspan.extent = (values) => {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value === null || !Number.isFinite(value)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low <= high ? [low, high] : null;
};

// The largest size of a value, 0 of none; an array may be too long for the arguments of Math.max.
Grainspan.largest = (values) => values.reduce((largest, value) => (Math.abs(value) > largest ? Math.abs(value) : largest), 0);

// Perceptually even colours from dark blue to yellow.
const STOPS = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37]];
Grainspan.colour = (share) => {
  if (!Number.isFinite(share)) return "#bbbbbb";
  const place = Math.min(Math.max(share, 0), 1) * (STOPS.length - 1);
  const index = Math.min(Math.floor(place), STOPS.length - 2), part = place - index;
  return `rgb(${[0, 1, 2].map((channel) => Math.round(STOPS[index][channel] * (1 - part) + STOPS[index + 1][channel] * part)).join(",")})`;
};
Grainspan.gradient = `linear-gradient(to right, ${STOPS.map((stop) => `rgb(${stop.join(",")})`).join(", ")})`;

// A canvas whose picture follows its width; `height` in CSS pixels. Returns the context in CSS pixels.
Grainspan.prepare = (canvas, height) => {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth || 300;
  canvas.style.height = `${height}px`;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
};

// Keeps the choice of a select while its options change; `options`: `[value, text]` pairs. `wished` comes back with its option, `preferred`
// is taken without a choice. Returns the value chosen.
Grainspan.fill = (select, options, preferred, wished = null) => {
  const before = select.value;
  const same = select.options.length === options.length && options.every(([value], place) => select.options[place].value === String(value));
  if (!same) {
    select.replaceChildren(...options.map(([value, text]) => Grainspan.make("option", text, { value })));
    const values = options.map(([value]) => String(value));
    select.value = [wished, before, preferred].map(String).find((one) => values.includes(one)) ?? values[0] ?? "";
  }
  return select.value;
};

// Turns a solid about two axes; `turn`: yaw and pitch in radians. Third coordinate: depth towards the viewer.
Grainspan.turned = ([x, y, z], turn) => {
  const [cy, sy, cp, sp] = [Math.cos(turn.yaw), Math.sin(turn.yaw), Math.cos(turn.pitch), Math.sin(turn.pitch)];
  const across = cy * x + sy * y, back = -sy * x + cy * y;
  return [across, cp * z + sp * back, sp * z - cp * back];
};

// The three axes at the lower left of a canvas.
Grainspan.drawAxes = (context, turn, height) => {
  const [x0, y0, length] = [26, height - 22, 18];
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.lineWidth = 1.2;
  // Readable also in front of a body.
  context.fillStyle = "rgba(255,255,255,.8)";
  context.beginPath();
  context.arc(x0 + 4, y0 - 8, 26, 0, 2 * Math.PI);
  context.fill();
  context.strokeStyle = context.fillStyle = "#59636e";
  [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((axis, number) => {
    const [across, up] = Grainspan.turned(axis, turn);
    context.beginPath();
    context.moveTo(x0, y0);
    context.lineTo(x0 + length * across, y0 - length * up);
    context.stroke();
    context.fillText("xyz"[number], x0 + 1.45 * length * across, y0 - 1.45 * length * up);
  });
};

// Lets a canvas turn its picture by dragging.
Grainspan.turnable = (canvas, turn, isSolid, draw) => {
  let last = null;
  canvas.addEventListener("pointerdown", (event) => { if (isSolid()) { last = [event.clientX, event.clientY]; turn.moved = 0; } });
  canvas.addEventListener("pointermove", (event) => {
    if (!last) return;
    turn.yaw += (event.clientX - last[0]) * 0.01;
    turn.pitch = Math.min(1.5, Math.max(-1.5, turn.pitch + (event.clientY - last[1]) * 0.01));
    turn.moved += Math.abs(event.clientX - last[0]) + Math.abs(event.clientY - last[1]);
    last = [event.clientX, event.clientY];
    draw();
  });
  for (const name of ["pointerup", "pointerleave"]) canvas.addEventListener(name, () => { last = null; });
};
