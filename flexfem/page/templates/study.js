(() => {
"use strict";
const element = document.getElementById("study-designs");
if (!element) return;
const study = JSON.parse(element.textContent);
const NEAR = 40;  // units of a chart: farther from every design nothing is pointed at
const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

function filledTable(body) {
  const cells = [];
  study.columns.forEach((column, index) => {
    if (index === 0 || index === study.factors) {
      const head = body.insertRow().appendChild(document.createElement("th"));
      head.colSpan = 2;
      head.scope = "colgroup";
      head.textContent = index < study.factors ? "Factors" : "Outputs";
    }
    const row = body.insertRow(), name = document.createElement("th");
    name.scope = "row";
    name.textContent = column.name;
    row.append(name);
    cells.push(row.insertCell());
  });
  return cells;
}

function start(box) {
  const chart = box.querySelector(".targets"), panel = box.querySelector(".panel");
  const spots = [...chart.querySelectorAll("circle")];
  if (!spots.length) return;
  const places = spots.map((spot) => [spot.cx.baseVal.value, spot.cy.baseVal.value]);
  const part = (name) => panel.querySelector(name);
  const cells = filledTable(part("tbody"));
  const rings = ["ring halo", "ring"].map((name) => {
    const ring = document.createElementNS("http://www.w3.org/2000/svg", "circle");
    ring.setAttribute("class", name);
    ring.setAttribute("r", "7");
    ring.setAttribute("aria-hidden", "true");
    return chart.appendChild(ring);
  });
  let chosen = 0;

  chart.setAttribute("role", "listbox");
  spots.forEach((spot, index) => {
    spot.setAttribute("role", "option");
    spot.setAttribute("aria-label", spot.textContent);
    spot.setAttribute("tabindex", index ? "-1" : "0");
    spot.replaceChildren();
  });

  function show(index) {
    const spot = spots[index], design = study.designs[spot.dataset.design];
    for (const ring of rings) {
      ring.setAttribute("cx", places[index][0]);
      ring.setAttribute("cy", places[index][1]);
    }
    part("h3").textContent = `Design ${spot.dataset.design} (${index + 1} of ${spots.length})`;
    part(".metal").setAttribute("d", design.m);
    part(".grounds").setAttribute("d", design.g);
    part(".hub").setAttribute("r", design.h);
    part(".design").toggleAttribute("hidden", !design.m);
    part(".undrawn").toggleAttribute("hidden", Boolean(design.m));
    part(".about").textContent = spot.getAttribute("aria-label").replace(/^Design \d+: /, "");
    design.v.forEach((value, column) => { cells[column].textContent = `${value} ${study.columns[column].unit}`.trim(); });
  }

  function choose(index) {
    spots[chosen].setAttribute("tabindex", "-1");
    spots[chosen].setAttribute("aria-selected", "false");
    chosen = index;
    spots[chosen].setAttribute("tabindex", "0");
    spots[chosen].setAttribute("aria-selected", "true");
    show(chosen);
  }

  function say() {
    const values = study.designs[spots[chosen].dataset.design].v;
    const told = study.columns.slice(0, study.factors).map((one, k) => `${one.name} ${values[k]} ${one.unit}`.trim());
    part(".said").textContent = [spots[chosen].getAttribute("aria-label"), ...told].join(", ");
  }

  function pointedAt(event) {
    const matrix = chart.getScreenCTM();
    if (!matrix) return -1;
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
    let nearest = -1, least = NEAR * NEAR;
    places.forEach(([x, y], index) => {
      const distance = (x - at.x) ** 2 + (y - at.y) ** 2;
      if (distance < least) [nearest, least] = [index, distance];
    });
    return nearest;
  }

  function beside([across, down]) {
    const [x, y] = places[chosen];
    let nearest = chosen, least = Infinity;
    places.forEach(([u, v], index) => {
      const ahead = (u - x) * across + (v - y) * down;
      const aside = Math.abs((u - x) * down) + Math.abs((v - y) * across);
      const far = ahead + 3 * aside;
      if (ahead > 1e-6 && far < least) [nearest, least] = [index, far];
    });
    return nearest;
  }

  function stepped(by) {
    return Math.min(Math.max(chosen + by, 0), spots.length - 1);
  }

  function target(key) {
    if (key in WAYS) return beside(WAYS[key]);
    return { Home: 0, End: spots.length - 1, PageUp: stepped(-1), PageDown: stepped(1) }[key];
  }

  chart.addEventListener("pointermove", (event) => {
    const index = pointedAt(event);
    show(index < 0 ? chosen : index);
  });
  chart.addEventListener("pointerleave", () => show(chosen));
  chart.addEventListener("click", (event) => {
    const index = pointedAt(event);
    if (index < 0) return;
    choose(index);
    spots[index].focus({ preventScroll: true });
    say();
  });
  chart.addEventListener("keydown", (event) => {
    const index = target(event.key);
    if (index === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    choose(index);
    spots[index].focus({ preventScroll: true });
    say();
  });
  for (const button of panel.querySelectorAll("[data-step]")) {
    button.addEventListener("click", () => {
      choose(stepped(Number(button.dataset.step)));
      say();
    });
  }
  panel.hidden = false;
  choose(Number(box.dataset.first || 0));
}

document.querySelectorAll(".pointed").forEach(start);
})();
