// A map over load and turns: the transmission ratio, which model is enough and where each limit lies, or the errors of the
// table.

const CELLS = [72, 44];
// A frame has 16 ms. While the mechanism moves, most of it is for the redraw.
const SLICE_MS = { moving: 5, resting: 11 };
const RESTS_AFTER_MS = 300;
// Slices from one picture of a growing map to the next.
const SLICES_DRAWN = 6;
const TIER_COLOURS = ["#dcebf7", "#abd0ea", "#6eaad6", "#3d82bd", "#22599a", "#143766"];
const LIMITS = {
  overtwist: ["#e8a33d", "overtwist: the strings lie side by side"],
  "no-equilibrium": ["#c9503f", "no equilibrium: the helix angle runs away"],
  fold: ["#c9503f", "the branch of equilibria folds back"],
  "strain-range": ["#8e5bb0", "strain beyond the range of the stress–strain fit"],
  "section-singular": ["#8e5bb0", "the stress–strain curve is flat or falls"],
  slack: ["#9a9a9a", "slack string"],
};
// From a low ratio to a high one; no state.
const RATIO_COLOURS = [[253, 231, 37], [94, 201, 98], [33, 145, 140], [59, 82, 139], [68, 1, 84]];
const NO_STATE = ["#9a9a9a", "no equilibrium, or no TR"];
const OTHER_LIMIT = ["#6f6f6f", "another limit of the model"];

const map = {
  canvas: document.getElementById("map"),
  picture: Object.assign(document.createElement("canvas"), { width: 0, height: 0 }),
  view: "ratio",
  // Of each cell the cheapest tier or the limit, and TR (rad/mm), NaN where there is none.
  cells: [],
  ratios: [],
  next: 0,
  generation: 0,
  // Of TR (rad/mm), see `ratioRange`.
  range: [1, 10],

  wanted() {
    return data.accuracy ?? { contraction_m: 5e-6, tr_relative: 2e-3 };
  },

  axis(k, share) {
    const [low, high] = k ? ranges.load : [0, ranges.turns[1]];
    return k ? low * (high / low) ** share : low + (high - low) * share;
  },

  // Computes all cells again, a slice in each frame, coarse ones first.
  measure() {
    map.cells = new Array(CELLS[0] * CELLS[1]).fill(null);
    map.ratios = new Array(map.cells.length).fill(NaN);
    map.next = 0;
    map.generation += 1;
    map.range = map.ratioRange();
    const generation = map.generation;
    map.explain();
    requestAnimationFrame(() => map.slice(generation, 1));
  },

  slice(generation, number) {
    if (generation !== map.generation) return;
    const now = performance.now();
    const until = now + (now - rig.moved_ms < RESTS_AFTER_MS ? SLICE_MS.moving : SLICE_MS.resting);
    const count = map.cells.length;
    while (map.next < count && performance.now() < until) {
      // 1361 is prime: every cell is reached once, in a scattered order.
      const cell = (map.next * 1361) % count;
      const [column, row] = [cell % CELLS[0], Math.floor(cell / CELLS[0])];
      const turns = map.axis(0, (column + 0.5) / CELLS[0]);
      const load_n = map.axis(1, (row + 0.5) / CELLS[1]);
      map.cells[cell] = solver.cheapest(load_n, turns, map.wanted());
      map.ratios[cell] = (solver.solve(load_n, turns).tr_rad_per_m ?? NaN) * 1e-3;
      map.next += 1;
    }
    const done = map.next === count;
    if (!map.ofTable() && (done || number % SLICES_DRAWN === 0)) map.paint();
    if (done) map.explain();
    else requestAnimationFrame(() => map.slice(generation, number + 1));
  },

  // The picture below the marks; marks change with each state, the picture does not.
  paint() {
    const { g, width, height } = begin(map.canvas);
    map.frame = axes(g, width, height,
      { range: [0, ranges.turns[1]], label: "turns past the half-turn pre-twist" },
      { range: ranges.load, log: true, label: "load, N" });
    const { sx, sy } = map.frame;
    const fill = (x0, x1, y0, y1, colour) => {
      g.fillStyle = colour;
      g.fillRect(sx.at(x0), sy.at(y1), sx.at(x1) - sx.at(x0) + 0.7, sy.at(y0) - sy.at(y1) + 0.7);
    };
    if (!map.ofTable()) {
      map.cells.forEach((cell, k) => {
        if (cell === null) return;
        const [column, row] = [k % CELLS[0], Math.floor(k / CELLS[0])];
        const tier = typeof cell === "number" ? TIER_COLOURS[cell] : (LIMITS[cell] ?? OTHER_LIMIT)[0];
        const colour = map.view === "tier" ? tier : map.ratioColour(map.ratios[k]);
        fill(map.axis(0, column / CELLS[0]), map.axis(0, (column + 1) / CELLS[0]),
          map.axis(1, row / CELLS[1]), map.axis(1, (row + 1) / CELLS[1]), colour);
      });
    } else {
      const { loads_n, turns } = data.table;
      const { values, most } = map.errors();
      const middle = (list, k) => (k <= 0 ? list[0] : k >= list.length ? list.at(-1) : (list[k - 1] + list[k]) / 2);
      values.forEach((value, k) => {
        if (value === null) return;
        const [column, row] = [k % turns.length, Math.floor(k / turns.length)];
        fill(middle(turns, column), middle(turns, column + 1), middle(loads_n, row), middle(loads_n, row + 1),
          map.errorColour(value / most));
      });
    }
    if (map.view === "ratio" && map.next === map.cells.length) map.contours(g);
    if (data.envelope) {
      const { load_n, turns } = data.envelope;
      g.setLineDash([6, 4]);
      g.lineWidth = 1.6;
      g.strokeStyle = "#000";
      const corners = [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]].map(([i, j]) => [sx.at(turns[i]), sy.at(load_n[j])]);
      line(g, corners);
      g.lineDashOffset = 5;
      g.strokeStyle = "#fff";
      line(g, corners);
      g.setLineDash([]);
      g.lineDashOffset = 0;
    }
    if (!map.canvas.width || !map.canvas.height) return;
    map.picture.width = map.canvas.width;
    map.picture.height = map.canvas.height;
    map.picture.getContext("2d").drawImage(map.canvas, 0, 0);
    map.mark();
  },

  mark() {
    if (!map.frame || !map.picture.width || !map.canvas.clientWidth) return;
    const { g, width, height } = begin(map.canvas);
    g.drawImage(map.picture, 0, 0, width, height);
    const { box, sx, sy } = map.frame;
    const [px, py] = [sx.at(rig.turns), sy.at(rig.load_n)];
    if (px < box.left || px > box.right || py < box.top || py > box.bottom) return;
    dot(g, px, py, 6, ink("now"));
  },

  // The table's errors of the view, and the largest.
  errors() {
    const values = map.view === "tr" ? data.table.tr_ppm : data.table.contraction_nm;
    return { values, most: Math.max(...values.map((v) => Math.abs(v ?? 0)), 1) };
  },

  // Blue where the table is below the model, red where it is above.
  errorColour(share) {
    const strength = Math.sqrt(Math.min(Math.abs(share), 1));
    const to = share < 0 ? [33, 102, 172] : [178, 24, 43];
    return `rgb(${to.map((c) => Math.round(247 + (c - 247) * strength)).join(" ")})`;
  },

  ofTable() {
    return map.view === "contraction" || map.view === "tr";
  },

  // The range of TR (rad/mm) that has colours: what the scene's loads have from half a turn on.
  ratioRange() {
    const [low, high] = data.envelope?.load_n ?? ranges.load;
    const most = data.envelope?.turns[1] ?? ranges.turns[1];
    const ends = [[low, most], [low, 0.5], [high, most], [high, 0.5]].map(([f, t]) => solver.solve(f, t).tr_rad_per_m * 1e-3);
    const known = ends.filter(Number.isFinite);
    return known.length > 1 ? [Math.min(...known), Math.max(...known)] : [1, 10];
  },

  ratioColour(ratio) {
    if (!Number.isFinite(ratio)) return NO_STATE[0];
    const [low, high] = map.range;
    const share = Math.min(Math.max(Math.log(ratio / low) / Math.log(high / low), 0), 1) * (RATIO_COLOURS.length - 1);
    const k = Math.min(Math.floor(share), RATIO_COLOURS.length - 2);
    return `rgb(${RATIO_COLOURS[k].map((c, n) => Math.round(c + (share - k) * (RATIO_COLOURS[k + 1][n] - c))).join(" ")})`;
  },

  // Lines of equal TR: between two cells of a column TR grows with the load.
  contours(g) {
    const { box, sx, sy } = map.frame;
    const framed = { x: (data.envelope?.turns ?? []).map(sx.at), y: (data.envelope?.load_n ?? []).map(sy.at) };
    const [columns, rows] = CELLS;
    const log = (column, row) => Math.log(map.ratios[row * columns + column]);
    g.lineWidth = 1.4;
    g.font = "12px system-ui, sans-serif";
    g.textAlign = "center";
    g.textBaseline = "middle";
    for (const level of logTicks(...map.range)) {
      const points = [];
      for (let column = 0; column < columns; column += 1) {
        for (let row = 0; row + 1 < rows; row += 1) {
          const share = (Math.log(level) - log(column, row)) / (log(column, row + 1) - log(column, row));
          if (share >= 0 && share < 1) {
            points.push([sx.at(map.axis(0, (column + 0.5) / columns)), sy.at(map.axis(1, (row + 0.5 + share) / rows))]);
            break;
          }
        }
      }
      if (points.length < 4) continue;
      const text = `${short(level)} rad/mm`;
      const half = g.measureText(text).width / 2 + 4;
      // Near the middle, but not on the dashed frame nor past the edge.
      const clear = ([px, py]) => px - half > box.left && px + half < box.right && py - 12 > box.top && py + 12 < box.bottom
        && !framed.y.some((at) => Math.abs(at - py) < 14) && !framed.x.some((at) => Math.abs(at - px) < half + 4);
      const from_middle = (k) => Math.abs(k - points.length / 2);
      const best = [...points.keys()].sort((a, b) => from_middle(a) - from_middle(b)).find((k) => clear(points[k]));
      if (best === undefined) continue;
      const [x, y] = points[best];
      g.strokeStyle = "#fff";
      // The line leaves room for its label.
      line(g, points.filter(([px]) => px < x - half));
      line(g, points.filter(([px]) => px > x + half));
      g.lineWidth = 3;
      g.strokeStyle = "#000";
      g.strokeText(text, x, y);
      g.lineWidth = 1.4;
      g.fillStyle = "#fff";
      g.fillText(text, x, y);
    }
  },

  // Text and legend of the view.
  explain() {
    const text = document.getElementById("map-text");
    const entries = [];
    if (map.view === "ratio") {
      text.textContent = "How far the strings must turn for a millimetre of travel, by the full model: many turns under a heavy "
        + "load, few under a light one. " + (data.envelope ? "Dashed: the range of the scene's table. " : "")
        + "A click moves the mechanism there.";
      const [low, high] = map.range;
      for (const share of [0, 0.25, 0.5, 0.75, 1]) {
        const ratio = low * (high / low) ** share;
        const bound = { 0: "at most ", 1: "at least " }[share] ?? "";
        entries.push([map.ratioColour(ratio), `${bound}${short(Number(ratio.toPrecision(2)))} rad/mm`]);
      }
      if (map.ratios.some(Number.isNaN)) entries.push(NO_STATE);
    } else if (map.view === "tier") {
      const { contraction_m, tr_relative } = map.wanted();
      text.textContent = `Blue: the cheapest model of the rods whose own estimate of its error is within `
        + `${short(contraction_m * 1e6)} µm and ${short(tr_relative * 100)} % of TR. Other colours: where the model ends. `
        + (data.envelope ? "Dashed: the range of the scene's table. " : "") + "A click moves the mechanism there.";
      TIERS.forEach((name, k) => map.cells.includes(k) && entries.push([TIER_COLOURS[k], name]));
      const kinds = [...new Set(map.cells.filter((cell) => typeof cell === "string"))];
      kinds.forEach((kind) => entries.push(LIMITS[kind] ?? OTHER_LIMIT));
    } else {
      const { most } = map.errors();
      const unit = map.view === "tr" ? (x) => `${(x * 1e-4).toFixed(3)} %` : (x) => `${(x * 1e-3).toFixed(2)} µm`;
      text.textContent = `The table's answer, in single precision as on the board, less the full model's, for the scene's `
        + `own constants. Largest on this grid: ${unit(most)}.` + (rig.changed ? " The constants above differ from them." : "");
      for (const share of [-1, -0.25, 0, 0.25, 1]) entries.push([map.errorColour(share), `${share > 0 ? "+" : ""}${unit(share * most)}`]);
    }
    legend("map-legend", entries);
    map.canvas.setAttribute("aria-label", `Map over turns and load. ${text.textContent}`);
  },

  begin() {
    const choice = document.getElementById("map-choice");
    choice.querySelectorAll(".of-table").forEach((label) => { label.hidden = !data.table; });
    choice.addEventListener("change", (event) => {
      map.view = event.target.value;
      map.paint();
      map.explain();
    });
    const go = (event) => {
      if (!map.frame || (event.type === "pointermove" && !event.buttons)) return;
      const place = map.canvas.getBoundingClientRect();
      rig.set(map.frame.sy.of(event.clientY - place.top), map.frame.sx.of(event.clientX - place.left));
    };
    map.canvas.addEventListener("pointerdown", go);
    map.canvas.addEventListener("pointermove", go);
  },
};
