"use strict";
// A drawing that a hand moves: it draws the numbers of `questions/handling.py` and solves nothing else.
class Handle {
  static SVG = "http://www.w3.org/2000/svg";
  static SHARE = 0.08; // of the drawing: how far the largest possible motion is drawn
  static PULL = 8; // stiffness of the pull of the pointer, per that of the softest direction
  static ROUND_OFF = 1e-5; // relative: numbers in the page have six digits
  static FULL = 0.999; // of the yield strength, from which the motion stays

  constructor(host, data, before = null) { // before : the drawing that this one replaces, whose motion goes on
    this.host = host;
    this.data = data;
    this.ports = data.compliance.length;
    this.loads = new Array(this.ports).fill(0);
    this.strokes = new Array(this.ports - 3).fill(0);
    this.playing = null;
    this.target = null; // of the pull of the output, mm; null without one
    this.allowed = Math.max(1, ...this.ends().flat().map((loads) => this.use(loads)));
    this.build();
    this.show();
    if (before !== null) this.resume(before);
  }

  resume(before) {
    const { playing, target, strokes } = before;
    before.stop();
    if (playing !== null && playing < this.data.modes.length) {
      this.play(playing);
      return;
    }
    this.target = target;
    if (strokes.length === this.strokes.length) this.strokes = [...strokes];
    this.ranges.forEach((range, k) => { if (range !== this.curve) range.value = this.strokes[k]; });
    this.loads = this.within(this.pulled(target));
    this.show();
  }

  // linear algebra

  static times(matrix, vector) {
    return matrix.map((row) => row.reduce((sum, value, k) => sum + value * vector[k], 0));
  }

  static solve(matrix, right) { // Gauss elimination with pivots; equations scaled by their rows
    const n = right.length;
    const rows = matrix.map((row, i) => [...row, right[i]]);
    for (const row of rows) {
      const largest = Math.max(...row.slice(0, n).map(Math.abs)) || 1;
      for (let j = 0; j <= n; j++) row[j] /= largest;
    }
    for (let i = 0; i < n; i++) {
      let pivot = i;
      for (let k = i + 1; k < n; k++) if (Math.abs(rows[k][i]) > Math.abs(rows[pivot][i])) pivot = k;
      [rows[i], rows[pivot]] = [rows[pivot], rows[i]];
      for (let k = i + 1; k < n; k++) {
        const factor = rows[k][i] / rows[i][i];
        for (let j = i; j <= n; j++) rows[k][j] -= factor * rows[i][j];
      }
    }
    const found = new Array(n).fill(0);
    for (let i = n - 1; i >= 0; i--) {
      let rest = rows[i][n];
      for (let j = i + 1; j < n; j++) rest -= rows[i][j] * found[j];
      found[i] = rest / rows[i][i];
    }
    return found;
  }

  // mechanics

  motions() { return Handle.times(this.data.compliance, this.loads); }

  twists(loads = this.loads) { return this.data.twists.map((body) => Handle.times(body, loads)); }

  stresses(loads = this.loads) {
    return this.data.hinges.map((hinge) => {
      const onAxis = Math.hypot(...Handle.times(hinge.axis, loads));
      return Math.max(onAxis, ...Handle.times(hinge.stress, loads).map(Math.abs));
    });
  }

  use(loads) { // highest stress per yield strength
    return Math.max(...this.stresses(loads).map((stress, k) => stress / this.data.hinges[k].strength));
  }

  ends() { // loads at both ends of the range of each direction, the others free
    return this.data.range.map((range, k) => [range.low, range.high].map((motion) => {
      const loads = new Array(this.ports).fill(0);
      loads[k] = motion / this.data.compliance[k][k];
      return loads;
    }));
  }

  // the same loads, less where a hinge would yield or the range of a direction ends; linear theory does not
  // end the motion within a known range, where it may exceed the yield strength by little
  within(loads) {
    let most = this.use(loads) / this.allowed;
    this.limit = this.data.range.length ? "yield of a hinge" : "a hinge yields, by linear theory";
    this.ends().forEach((ends, k) => {
      const below = loads[k] < 0;
      const share = loads[k] / ends[below ? 0 : 1][k];
      if (share > most * Handle.FULL) {
        most = share;
        this.limit = `${below ? this.data.range[k].below : this.data.range[k].above}, at finite displacement`;
      }
    });
    this.most = most;
    this.limited = most > Handle.FULL;
    return this.limited ? loads.map((load) => load / most) : loads;
  }

  // loads for a pull of the output to dx, dy, null without one, and for pressed actuators
  pulled(target) {
    const C = this.data.compliance;
    const softest = Math.max(C[0][0], C[1][1]);
    const pressed = this.strokes.map((stroke, k) => (stroke ? k + 3 : -1)).filter((port) => port > 0);
    const free = target === null ? [] : [0, 1];
    const unknown = [...free, ...pressed];
    if (!unknown.length) return new Array(this.ports).fill(0);
    const matrix = unknown.map((i) => unknown.map((j) => C[i][j] + (i === j && i < 3 ? softest / Handle.PULL : 0)));
    const right = unknown.map((i) => (i < 3 ? target[i] : this.strokes[i - 3]));
    const found = Handle.solve(matrix, right);
    const loads = new Array(this.ports).fill(0);
    unknown.forEach((port, k) => { loads[port] = found[k]; });
    return loads;
  }

  // the largest motion of anything at the limit of the load x, y, theta or of an actuator: how much is drawn
  exaggeration() {
    let largest = 0;
    for (let port = 0; port < this.ports; port++) {
      const unit = new Array(this.ports).fill(0);
      for (const load of [1e9, -1e9]) {
        unit[port] = load;
        const twist = this.twists(this.within(unit))[this.data.output_body];
        largest = Math.max(largest, Math.hypot(...this.moved(twist, this.data.output)));
      }
    }
    const size = Math.max(this.data.box[2], this.data.box[3]);
    const factor = (Handle.SHARE * size) / (largest || 1);
    const power = 10 ** Math.floor(Math.log10(factor));
    return Math.max([1, 2, 5, 10].filter((step) => step * power <= factor).pop() * power, 1);
  }

  moved([u, v, turn], [x, y]) { return [u - turn * y, v + turn * x]; }

  // drawing

  element(name, attributes, parent) {
    const made = document.createElementNS(Handle.SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    parent.append(made);
    return made;
  }

  build() {
    this.host.replaceChildren();
    const { box, output } = this.data;
    this.factor = this.exaggeration();
    this.limited = false;
    const room = (Handle.SHARE + 0.03) * Math.max(box[2], box[3]);
    const view = [box[0] - room, -(box[1] + box[3]) - room, box[2] + 2 * room, box[3] + 2 * room];
    this.svg = this.element("svg", { viewBox: view.join(" "), class: "handled", role: "img", tabindex: "0",
      "aria-label": "Drawing of the mechanism; arrow keys or the pointer move the output" }, this.host);
    const plate = this.element("g", { transform: "scale(1 -1)" }, this.svg);
    for (const d of this.data.ground) this.element("path", { d, class: "ground" }, plate);
    for (const d of this.data.bodies) this.element("path", { d, class: "rest" }, plate);
    this.bodies = this.data.bodies.map((d) => this.element("path", { d, class: "body" }, plate));
    this.hinges = this.data.hinges.map(() => this.element("path", { class: "hinge" }, plate));
    this.actuators = this.data.actuators.map(() => this.element("line", { class: "actuator" }, plate));
    const r = 0.014 * Math.max(view[2], view[3]);
    this.arrow = this.element("line", { class: "force" }, plate);
    this.output = this.element("circle", { r, class: "output", cx: output[0], cy: output[1] }, plate);
    this.plate = plate;
    this.controls();
    this.svg.addEventListener("pointerdown", (event) => this.grab(event));
    this.svg.addEventListener("keydown", (event) => this.key(event));
  }

  controls() {
    const box = document.createElement("div");
    box.className = "controls";
    this.data.actuators.forEach((actuator, k) => {
      const label = document.createElement("label");
      const range = document.createElement("input");
      Object.assign(range, { type: "range", min: 0, max: actuator.stroke, step: "any", value: 0 });
      range.addEventListener("input", () => {
        this.stop();
        this.strokes[k] = Number(range.value);
        this.target = null;
        this.loads = this.within(this.pulled(null));
        this.show();
      });
      label.append(`press ${actuator.name} `, range);
      box.append(label);
    });
    if (this.data.curve) box.append(this.curveSlider());
    this.data.modes.forEach((mode, k) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = `mode ${k + 1}: ${mode.frequency} Hz`;
      button.addEventListener("click", () => (this.playing === k ? this.release() : this.play(k)));
      box.append(button);
    });
    const release = document.createElement("button");
    release.type = "button";
    release.textContent = "release";
    release.addEventListener("click", () => this.release());
    box.append(release);
    this.text = document.createElement("p");
    this.text.className = "handled-text";
    this.text.setAttribute("aria-live", "polite");
    this.host.append(box, this.text);
    this.ranges = box.querySelectorAll("input");
  }

  curveSlider() {
    const label = document.createElement("label");
    this.curve = document.createElement("input");
    const last = this.data.curve.pose.length - 1;
    Object.assign(this.curve, { type: "range", min: 0, max: last, step: 1, value: 0 });
    this.curve.addEventListener("input", () => this.follow(Number(this.curve.value)));
    label.append("along the nonlinear curve ", this.curve);
    return label;
  }

  color(share) { return `hsl(${Math.round(215 * (1 - Math.min(share, 1)))} 80% 45%)`; }

  edges(hinge, twists) { // of a hinge whose mid-line is the cubic between its moved ends
    const length = hinge.edges[hinge.edges.length - 1][0] - hinge.edges[0][0];
    const [c, s] = [Math.cos(hinge.heading), Math.sin(hinge.heading)];
    const ends = hinge.bodies.map((body, k) => {
      const along = (k ? 0.5 : -0.5) * length;
      const at = [hinge.place[0] + along * c, hinge.place[1] + along * s];
      const twist = body < 0 ? [0, 0, 0] : twists[body];
      const [u, v] = this.moved(twist, at);
      return { along: u * c + v * s, across: v * c - u * s, turn: twist[2] };
    });
    const [near, far] = ends;
    const place = (x, y) => [hinge.place[0] + x * c - y * s, hinge.place[1] + x * s + y * c];
    const upper = [];
    const lower = [];
    for (const [x, high, low] of hinge.edges) {
      const t = x / length + 0.5;
      const u = near.along * (1 - t) + far.along * t;
      const w = near.across * (1 - 3 * t ** 2 + 2 * t ** 3) + far.across * (3 * t ** 2 - 2 * t ** 3)
        + length * (near.turn * (t - 2 * t ** 2 + t ** 3) + far.turn * (t ** 3 - t ** 2));
      const slope = (far.across - near.across) * (6 * t - 6 * t ** 2) / length
        + near.turn * (1 - 4 * t + 3 * t ** 2) + far.turn * (3 * t ** 2 - 2 * t);
      upper.push(place(x + u - slope * high, w + high));
      lower.unshift(place(x + u - slope * low, w + low));
    }
    return `M${[...upper, ...lower].map((point) => point.map((value) => value.toFixed(3)).join(",")).join(" ")}Z`;
  }

  draw(twists, shares) {
    const drawn = twists.map((twist) => twist.map((value) => value * this.factor));
    this.bodies.forEach((path, k) => {
      const [u, v, turn] = drawn[k];
      path.setAttribute("transform", `matrix(1 ${turn} ${-turn} 1 ${u} ${v})`);
    });
    this.data.hinges.forEach((hinge, k) => {
      this.hinges[k].setAttribute("d", this.edges(hinge, drawn));
      this.hinges[k].style.fill = this.hinges[k].style.stroke = this.color(shares[k]);
    });
    this.data.actuators.forEach((actuator, k) => {
      const ends = [actuator.ends.slice(0, 2), actuator.ends.slice(2)];
      const at = ends.map((end, side) => {
        const body = actuator.bodies[side];
        const [u, v] = body < 0 ? [0, 0] : this.moved(drawn[body], end);
        return [end[0] + u, end[1] + v];
      });
      const [[x1, y1], [x2, y2]] = at;
      for (const [key, value] of Object.entries({ x1, y1, x2, y2 })) this.actuators[k].setAttribute(key, value);
    });
    const [u, v] = this.moved(drawn[this.data.output_body], this.data.output);
    this.output.setAttribute("cx", this.data.output[0] + u);
    this.output.setAttribute("cy", this.data.output[1] + v);
  }

  static number(value) {
    if (Math.abs(value) < 1e-12) return "0";
    return Number(value.toPrecision(4)).toString();
  }

  static length(value) {
    const size = Math.abs(value);
    if (size < 1e-9) return "0";
    return size < 0.1 ? `${Handle.number(1e3 * value)} \u00b5m` : `${Handle.number(value)} mm`;
  }

  show() {
    if (this.loads.every((load) => load === 0)) {
      this.draw(this.twists(), this.data.hinges.map(() => 0));
      this.text.textContent = "Drag the output, press an actuator or play a mode. Hinges turn from blue, without stress, to red, "
        + "at their yield strength.";
      return;
    }
    const twists = this.twists();
    const stresses = this.stresses();
    const shares = stresses.map((stress, k) => stress / this.data.hinges[k].strength);
    this.draw(twists, shares);
    const motions = this.motions();
    const first = shares.indexOf(Math.max(...shares));
    const small = (value, scale) => (Math.abs(value) < Handle.ROUND_OFF * scale ? 0 : value);
    const size = Math.max(...motions.slice(0, 2).map(Math.abs), 1e-12);
    const turn = Math.max(Math.abs(motions[2]), size / Math.max(this.data.box[2], this.data.box[3]));
    const force = Math.max(...this.loads.map(Math.abs), 1e-12);
    const parts = [
      `output x ${Handle.length(small(motions[0], size))}, y ${Handle.length(small(motions[1], size))}, `
        + `theta ${Handle.number(1e3 * small(motions[2], turn))} mrad`,
      `force x ${Handle.number(small(this.loads[0], force))} N, y ${Handle.number(small(this.loads[1], force))} N`,
      `highest hinge stress ${Handle.number(stresses[first])} MPa in ${this.data.hinges[first].name}, `
        + `${Math.round(100 * shares[first])} % of its yield strength`,
      this.factor > 1 ? `drawn ${Handle.number(this.factor)} times larger` : "drawn to scale",
    ];
    this.data.actuators.forEach((actuator, k) => {
      if (this.strokes[k]) parts.splice(2, 0, `${actuator.name} opened by ${Handle.length(motions[3 + k])}, ${Handle.number(this.loads[3 + k])} N`);
    });
    this.text.textContent = `${parts.join("; ")}.${this.limited ? ` The range ends here: ${this.limit}.` : ""}`;
  }

  // what the hand does

  at(event) { // of a pointer, mm
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.plate.getScreenCTM().inverse());
    return [point.x, point.y];
  }

  grab(event) {
    this.stop();
    event.preventDefault();
    this.svg.focus({ preventScroll: true });
    this.svg.setPointerCapture(event.pointerId);
    const pull = (moved) => {
      const [x, y] = this.at(moved);
      const target = [x - this.data.output[0], y - this.data.output[1]].map((value) => value / this.factor);
      this.loads = this.within(this.pulled(target));
      this.target = target.map((value) => value / Math.max(this.most, 1)); // from where arrow keys go on
      this.show();
    };
    const end = () => {
      this.svg.removeEventListener("pointermove", pull);
      this.svg.removeEventListener("pointerup", end);
      this.svg.removeEventListener("pointercancel", end);
    };
    this.svg.addEventListener("pointermove", pull);
    this.svg.addEventListener("pointerup", end);
    this.svg.addEventListener("pointercancel", end);
    pull(event);
  }

  key(event) {
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const step = steps[event.key];
    if (event.key === "Escape") this.release();
    if (!step) return;
    event.preventDefault();
    this.stop();
    const size = Math.max(this.data.box[2], this.data.box[3]);
    const before = this.target;
    this.target = (this.target || [0, 0]).map((value, k) => value + (step[k] * 0.01 * size) / this.factor);
    this.loads = this.within(this.pulled(this.target));
    if (this.limited && before) this.target = before; // so that the opposite key leaves the end at once
    this.show();
  }

  follow(k) { // to a point of the curve, whose pose the output takes
    this.stop();
    this.curve.value = k;
    const { theory, pose, force } = this.data.curve;
    const C = this.data.compliance.slice(0, 3).map((row) => row.slice(0, 3));
    this.loads = [...Handle.solve(C, pose[k]), ...this.strokes.map(() => 0)];
    this.draw(this.twists(), this.data.hinges.map(() => 0));
    const turn = Handle.number(1e3 * pose[k][2]);
    this.text.textContent = `Large displacement by ${theory}: output x ${Handle.length(pose[k][0])}, y ${Handle.length(pose[k][1])}, `
      + `theta ${turn} mrad; driven by x ${Handle.number(force[k][0])} N, y ${Handle.number(force[k][1])} N, `
      + `theta ${Handle.number(force[k][2])} N mm. Other bodies are drawn as they move with this output by linear theory, `
      + `without stress; ${this.factor > 1 ? `drawn ${Handle.number(this.factor)} times larger` : "drawn to scale"}.`;
  }

  play(k) {
    this.stop();
    this.playing = k;
    const mode = this.data.modes[k];
    const size = Math.max(this.data.box[2], this.data.box[3]);
    const corners = [[this.data.box[0], this.data.box[1]],
      [this.data.box[0] + this.data.box[2], this.data.box[1] + this.data.box[3]]];
    const largest = Math.max(...mode.twists.flatMap((twist) => corners.map((at) => Math.hypot(...this.moved(twist, at)))));
    const scale = (Handle.SHARE * size) / largest / this.factor;
    const began = performance.now();
    const still = this.data.hinges.map(() => 0);
    const frame = (now) => {
      if (this.playing !== k) return;
      const share = Math.sin((now - began) / 320) * scale;
      this.draw(mode.twists.map((twist) => twist.map((value) => value * share)), still);
      requestAnimationFrame(frame);
    };
    this.text.textContent = `Natural mode ${k + 1} at ${mode.frequency} Hz, by the analytic model; its size is not known.`;
    requestAnimationFrame(frame);
  }

  stop() {
    this.playing = null;
    if (this.curve) this.curve.value = 0;
    this.limited = false;
  }

  release() {
    this.stop();
    this.target = null;
    this.strokes.fill(0);
    this.ranges.forEach((range) => { range.value = 0; });
    this.loads = this.loads.map(() => 0);
    this.show();
  }
}

for (const host of document.querySelectorAll(".handle")) {
  const numbers = host.querySelector("script[type='application/json']");
  if (numbers === null) continue;
  host.handle = new Handle(host, JSON.parse(numbers.textContent));
  host.closest("figure").hidden = false;
}
