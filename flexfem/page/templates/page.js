"use strict";
(() => {
  const told = document.getElementById("told");

  // tables: a button in every heading sorts the rows by its column
  const number = /^[^\d+\-\u2212]*([+\-\u2212]?\d[\d,]*\.?\d*)(?:(?:e|\u00d710)([+\-\u2212\u207b]?[\d\u2070\u00b9\u00b2\u00b3\u2074-\u2079]+))?/i;
  const bare = /^\u00b1?[+\-\u2212]?\d/; // what begins as a number
  const raised = "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079";
  const plain = (text) => text.replace(/[\u2212\u207b]/g, "-").replace(/,/g, "")
    .replace(/[\u2070\u00b9\u00b2\u00b3\u2074-\u2079]/g, (letter) => raised.indexOf(letter));
  const keyOf = (cell, numeric) => {
    const text = cell.dataset.key ?? cell.textContent.trim();
    if (!numeric) return text;
    const found = number.exec(text);
    return found ? Number(plain(found[1]) + (found[2] ? "e" + plain(found[2]) : "")) : NaN;
  };
  const order = (a, b) => {
    if (typeof a !== "number") return a.localeCompare(b, "en", { numeric: true });
    return Number.isNaN(a) ? (Number.isNaN(b) ? 0 : 1) : Number.isNaN(b) ? -1 : a - b;
  };
  const sort = (table, column, heading) => {
    const down = heading.getAttribute("aria-sort") === "ascending";
    for (const each of table.tHead.rows[0].cells) each.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", down ? "descending" : "ascending");
    const body = table.tBodies[0];
    const cells = [...body.rows].map((row) => row.cells[column]);
    const numeric = heading.classList.contains("number") || cells.every((cell) => bare.test(keyOf(cell, false)));
    const rows = cells.map((cell) => [keyOf(cell, numeric), cell.parentElement]);
    rows.sort((a, b) => (down ? order(b[0], a[0]) : order(a[0], b[0])));
    body.append(...rows.map((each) => each[1]));
    told.textContent = `sorted by ${heading.textContent}, ${down ? "descending" : "ascending"}`;
  };
  for (const table of document.querySelectorAll("table.sortable")) {
    [...table.tHead.rows[0].cells].forEach((heading, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...heading.childNodes);
      button.addEventListener("click", () => sort(table, column, heading));
      heading.append(button);
    });
  }

  // figures: what a spot says is shown beside the pointer; with the keyboard, arrow keys go from spot to spot
  const tip = document.createElement("div");
  tip.id = "tip";
  tip.hidden = true;
  document.body.append(tip);
  const show = (spot) => {
    tip.textContent = spot.dataset.text;
    tip.hidden = false;
    const box = spot.getBoundingClientRect();
    const room = document.documentElement.clientWidth - tip.offsetWidth - 4;
    const above = box.top - tip.offsetHeight - 6;
    tip.style.left = `${Math.max(4, Math.min(box.left + box.width / 2 - tip.offsetWidth / 2, room)) + scrollX}px`;
    tip.style.top = `${(above > 4 ? above : box.bottom + 6) + scrollY}px`;
  };
  const hide = () => {
    tip.hidden = true;
    for (const each of document.querySelectorAll(".spots .at")) each.classList.remove("at");
  };
  for (const group of document.querySelectorAll(".spots")) {
    const spots = [...group.children];
    for (const spot of spots) {
      const title = spot.querySelector("title");
      spot.dataset.text = title.textContent;
      title.remove(); // else the browser shows it too
      spot.addEventListener("pointerenter", () => show(spot));
      spot.addEventListener("pointerleave", hide);
    }
    const plate = group.closest(".plate");
    let at = -1;
    plate.tabIndex = 0;
    const hint = document.createElement("span");
    hint.className = "hint";
    hint.textContent = " Point at it, or tab to it and use the arrow keys, to read values.";
    plate.closest("figure").querySelector("figcaption").append(hint);
    plate.addEventListener("blur", hide);
    plate.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      if (event.key === "Escape") hide();
      if (!step) return;
      event.preventDefault();
      hide();
      at = at < 0 ? (step > 0 ? 0 : spots.length - 1) : (at + step + spots.length) % spots.length;
      spots[at].classList.add("at");
      show(spots[at]);
      told.textContent = spots[at].dataset.text;
    });
  }
  addEventListener("keydown", (event) => { if (event.key === "Escape") hide(); });
})();
