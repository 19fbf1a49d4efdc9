"use strict";
(() => {
  const announcement = document.getElementById("announcement");

  // a click stops and starts a motion; readers who want less motion start it
  for (const svg of document.querySelectorAll("svg.moving")) {
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) svg.pauseAnimations();
    svg.addEventListener("click", () => (svg.animationsPaused() ? svg.unpauseAnimations() : svg.pauseAnimations()));
  }
  // on paper everything is open, and what moves is at the end of its motion, after half of two seconds
  addEventListener("beforeprint", () => {
    document.querySelectorAll("details").forEach((part) => { part.open = true; });
    for (const svg of document.querySelectorAll("svg.moving")) {
      svg.pauseAnimations();
      svg.setCurrentTime(1);
    }
  });

  // a button in every heading sorts the rows of its table by its column
  const number = /^[^\d+\-\u2212]*([+\-\u2212]?\d[\d,]*\.?\d*)(?:(?:e|\u00d710)([+\-\u2212\u207b]?[\d\u2070\u00b9\u00b2\u00b3\u2074-\u2079]+))?/i;
  const bare = /^\u00b1?[+\-\u2212]?\d/; // text that begins as a number
  const superscripts = "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079";
  const plain = (text) => text.replace(/[\u2212\u207b]/g, "-").replace(/,/g, "")
    .replace(/[\u2070\u00b9\u00b2\u00b3\u2074-\u2079]/g, (letter) => superscripts.indexOf(letter));
  const keyOf = (cell, numeric) => {
    const text = cell.textContent.trim();
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
    for (const cell of table.tHead.rows[0].cells) cell.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", down ? "descending" : "ascending");
    const body = table.tBodies[0];
    const cells = [...body.rows].map((row) => row.cells[column]);
    const numeric = heading.classList.contains("number") || cells.every((cell) => bare.test(keyOf(cell, false)));
    const rows = cells.map((cell) => [keyOf(cell, numeric), cell.parentElement]);
    rows.sort((a, b) => (down ? order(b[0], a[0]) : order(a[0], b[0])));
    body.append(...rows.map(([, row]) => row));
    announcement.textContent = `sorted by ${heading.textContent}, ${down ? "descending" : "ascending"}`;
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
})();
