"use strict";

const SVG = "http://www.w3.org/2000/svg";
const OUTPUT_SIZE = 0.012; // of the drawing
let state = null; // the last one that was sent
let values = {}; // of the sliders, by key path
let drawnText = ""; // what is drawn
let waiting = false; // for the answer to a change
let pending = false; // whether sliders moved since then
let answered = 0; // version of the last answer to a change of this page
let held = null; // the drawing that a hand moves
const setters = new Map(); // of the sliders, by key path

const at = (id) => document.getElementById(id);

function element(name, attributes, parent) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent.append(made);
  return made;
}

function draw(drawing, handled) {
  const svg = at("drawing");
  svg.toggleAttribute("hidden", handled !== null);
  at("handle").hidden = handled === null;
  if (handled !== null) {
    held = new Handle(at("handle"), handled, held);
    return;
  }
  svg.replaceChildren();
  const [left, low, width, height] = drawing.box;
  svg.setAttribute("viewBox", `${left} ${-(low + height)} ${width} ${height}`);
  const turned = element("g", { transform: "scale(1 -1)" }, svg); // y upwards
  for (const d of drawing.ground) element("path", { d, class: "ground" }, turned);
  for (const d of drawing.bodies) element("path", { d, class: "body" }, turned);
  for (const d of drawing.hinges) element("path", { d, class: "hinge" }, turned);
  for (const [x1, y1, x2, y2] of drawing.actuators) {
    element("line", { x1, y1, x2, y2, class: "actuator" }, turned);
  }
  const [cx, cy] = drawing.output;
  element("circle", { cx, cy, r: OUTPUT_SIZE * Math.max(width, height), class: "output" }, turned);
}

function showRows(rows, elements) {
  const byName = new Map(elements.map((row) => [row.name, row.cells]));
  const body = at("rows");
  body.replaceChildren();
  for (const row of rows.length ? rows : elements) {
    const line = body.insertRow();
    const head = document.createElement("th");
    head.scope = "row";
    head.textContent = row.name;
    line.append(head);
    const banded = rows.length ? byName.get(row.name) || [] : [];
    row.cells.forEach((text, k) => {
      const cell = line.insertCell();
      cell.textContent = text;
      if (row.cells.length === 1) cell.colSpan = 3;
      if (banded[k]) {
        const by = document.createElement("span");
        by.className = "elements";
        by.textContent = banded[k];
        cell.append(by);
      }
    });
  }
}

function showFault(fault) {
  const box = at("fault");
  box.hidden = fault === null;
  box.replaceChildren();
  for (const part of [at("rows"), at("drawing"), at("handle")]) part.classList.toggle("stale", fault !== null);
  if (fault === null) return;
  box.append(fault.text);
  if (!fault.lines.length) return;
  const text = document.createElement("pre");
  for (const [number, line] of fault.lines) {
    const shown = document.createElement("span");
    shown.textContent = `${String(number).padStart(4)}  ${line}`;
    if (number === fault.line) shown.className = "at";
    text.append(shown);
  }
  box.append(text);
}

function showElements(elements) {
  const texts = {
    waiting: "",
    progress: `finite elements: ${elements.text} ...`,
    rows: "second values: finite elements ± half-width of their numerical uncertainty",
    failed: `finite elements: ${elements.text}`,
  };
  at("elements").textContent = texts[elements.state];
}

function slider(of) {
  const box = document.createElement("div");
  box.className = "slider";
  const label = document.createElement("label");
  label.textContent = of.name;
  const exact = document.createElement("input");
  exact.type = "number";
  exact.step = "any";
  exact.id = `number ${of.path}`;
  label.htmlFor = exact.id;
  const unit = document.createElement("span");
  unit.textContent = of.unit;
  const range = document.createElement("input");
  Object.assign(range, { type: "range", min: of.low, max: of.high, step: "any" });
  range.setAttribute("aria-label", `${of.name}, ${of.unit}`);
  range.dataset.path = of.path;
  const rounded = (value) => Number(Number(value).toPrecision(4));
  const set = (value) => {
    exact.value = value;
    range.value = value;
    box.classList.toggle("moved", value !== of.value);
  };
  range.addEventListener("input", () => move(of.path, rounded(range.value), set));
  exact.addEventListener("change", () => move(of.path, Number(exact.value), set));
  setters.set(of.path, set);
  set(values[of.path]);
  box.append(label, exact, unit, range);
  return box;
}

function showSliders() {
  setters.clear();
  at("sliders").replaceChildren(...state.sliders.map(slider));
  showButtons();
}

function showButtons() {
  const moved = state.sliders.some((of) => values[of.path] !== of.value);
  at("save").disabled = !(moved && state.can_save && state.fault === null);
  at("reset").disabled = !moved;
}

function move(path, value, set) {
  if (!Number.isFinite(value)) return;
  values[path] = value;
  set(value);
  at("saved").textContent = "";
  showButtons();
  ask();
}

async function post(where, content) {
  try {
    const answer = await fetch(where, { method: "POST", body: JSON.stringify(content) });
    return await answer.json();
  } catch {
    return { error: "no answer from the server" };
  }
}

async function ask() {
  pending = true;
  if (waiting) return;
  waiting = true;
  try {
    while (pending) {
      pending = false;
      const answer = await post("change", values);
      if (answer.error) at("saved").textContent = answer.error;
      else answered = answer.version;
    }
  } finally {
    waiting = false;
  }
}

function show(sent) {
  if (sent.sliders === undefined) { // of finite elements alone
    if (state === null || sent.version !== state.version) return;
    state.elements = sent.elements;
    showRows(state.rows, state.elements.rows || []);
    showElements(state.elements);
    return;
  }
  const before = state && JSON.stringify(state.sliders);
  state = sent;
  at("title").textContent = sent.title;
  if (before !== JSON.stringify(sent.sliders)) {
    values = { ...sent.values };
    showSliders();
  } else if (!waiting && !pending && sent.version >= answered) { // moved in another window, or by the file
    for (const [path, value] of Object.entries(sent.values)) {
      if (values[path] === value) continue;
      values[path] = value;
      setters.get(path)(value);
    }
  }
  const text = JSON.stringify([sent.drawing, sent.handled]);
  if (text !== drawnText) { // else a drag would end where finite elements answer
    draw(sent.drawing, sent.handled);
    drawnText = text;
  }
  showRows(sent.rows, sent.elements.rows || []);
  showFault(sent.fault);
  showElements(sent.elements);
  showButtons();
  at("seconds").textContent = `analytic model: ${Math.round(1000 * sent.seconds)} ms`;
  at("doubts").replaceChildren(...sent.doubts.map((text) => {
    const item = document.createElement("li");
    item.textContent = text;
    return item;
  }));
  document.body.dataset.version = sent.version;
}

at("save").addEventListener("click", async () => {
  const answer = await post("save", {});
  at("saved").textContent = answer.error || (answer.written.length ? `saved: ${answer.written.join(", ")}` : "nothing to save");
});

at("reset").addEventListener("click", () => {
  for (const of of state.sliders) move(of.path, of.value, setters.get(of.path));
});

const events = new EventSource("events");
events.onmessage = (event) => show(JSON.parse(event.data));
events.onerror = () => {
  at("elements").textContent = "the server has stopped: the numbers are the last ones";
};
