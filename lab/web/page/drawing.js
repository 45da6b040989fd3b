// The mechanism to scale: motor above, load below on its rail. Heights and widths are true; depth is drawn obliquely, so
// that one sees the upper rod turn and the strings wind around each other.

const DEPTH = [0.3, 0.17];
const POINTS_PER_TURN = 20;

const drawing = {
  canvas: document.getElementById("drawing"),
  // Length (m) that the drawing must hold; set with the constants, so that the scale does not change while one drags.
  longest_m: 0.12,
  rise_m: 0,

  // Takes the longest gap of the constants.
  measure() {
    const reached = ranges.load.map((load_n) => solver.solve(load_n, 0)).filter((s) => !s.error);
    const [length_m, span_m] = solver.constants;
    drawing.longest_m = Math.max(...reached.map((s) => s.gap_m), length_m > 0 ? 0.8 * length_m : 0.1);
    drawing.span_m = Math.max(span_m, 0.2 * drawing.longest_m);
  },

  // Draws a state; `path` is the bent half rod, `start_m` the gap at the pre-twist, `measured_m` a recorded position.
  draw(state, path, measured_m) {
    const { g, width, height } = begin(drawing.canvas);
    const [top, bottom] = [62, 84];
    const scale = Math.min((height - top - bottom) / drawing.longest_m, 0.62 * width / (1.3 * drawing.span_m));
    const centre = 0.45 * width;
    const at = ([x, y, z]) => [centre + scale * (y + DEPTH[0] * z), top + scale * (x + DEPTH[1] * z)];
    const start_m = state.gap_m + state.contraction_m;
    drawing.rail(g, at, scale, state, start_m, width);
    drawing.load(g, at, scale, state);
    drawing.motor(g, at, scale, state);
    drawing.segments(state, path).forEach(({ from, to, colour, thick }) => {
      g.lineCap = "butt";
      g.strokeStyle = ink("card");
      g.lineWidth = Math.max(1.2, thick * scale) + 2;
      line(g, [at(from), at(to)]);
      g.lineCap = "round";
      g.strokeStyle = ink(colour);
      g.lineWidth = Math.max(1.2, thick * scale);
      line(g, [at(from), at(to)]);
    });
    if (measured_m !== null) drawing.measured(g, at, start_m - measured_m);
  },

  // Rods and strings in short pieces, the hindmost first.
  segments(state, path) {
    const [, , clamp_m, rod_radius_m] = solver.constants;
    const theta = Math.PI + 2 * Math.PI * state.turns;
    const pieces = [];
    const chain = (points, colour, thick) => {
      for (let k = 1; k < points.length; k += 1) {
        const [from, to] = [points[k - 1], points[k]];
        const back = colour === "steel" && from[2] + to[2] < -1e-6;
        pieces.push({ from, to, colour: back ? "steel-back" : colour, thick, z: from[2] + to[2] });
      }
    };
    // The upper rod turns with the motor, the lower one stays in the plane of the drawing.
    for (const side of [-1, 1]) {
      const along = path.map(([x, w]) => [side * (clamp_m / 2 + x), w]);
      const [c, s] = [Math.cos(theta), Math.sin(theta)];
      chain([[0, 0, 0], ...along.map(([y, w]) => [w, y * c, y * s])], "steel", 2 * rod_radius_m);
      chain([[state.gap_m, 0, 0], ...along.map(([y, w]) => [state.gap_m - w, y, 0])], "steel", 2 * rod_radius_m);
    }
    // Eq. 25 unrolled: at the helix angle the strings run from the tips to the axis, and there around each other.
    const tan = Math.tan(state.alpha_rad);
    const lead = Math.min(0.5 * state.D_m / Math.max(tan, 1e-9), 0.5 * state.X_m);
    const steps = Math.max(4, Math.ceil(Math.abs(theta) / (2 * Math.PI) * POINTS_PER_TURN));
    const thick = Math.min(1.7 * state.r_m, solver.constants[4]);
    for (const [side, colour] of [[1, "string-a"], [-1, "string-b"]]) {
      const place = (x, radius, angle) => [x, side * radius * Math.cos(angle), side * radius * Math.sin(angle)];
      const lead_in = (from, to, radii, angle) => [0, 0.25, 0.5, 0.75, 1].map((t) =>
        place(from + t * (to - from), radii[0] + t * (radii[1] - radii[0]), angle));
      const tips = [state.w_m, state.w_m + state.X_m];
      const points = [
        ...lead_in(tips[0], tips[0] + lead, [0.5 * state.D_m, state.r_m], theta),
        ...Array.from({ length: steps - 1 }, (_, k) => {
          const share = (k + 1) / steps;
          return place(tips[0] + lead + share * (state.X_m - 2 * lead), state.r_m, theta * (1 - share));
        }),
        ...lead_in(tips[1] - lead, tips[1], [state.r_m, 0.5 * state.D_m], 0),
      ];
      chain(points, colour, thick);
    }
    return pieces.sort((a, b) => a.z - b.z);
  },

  motor(g, at, scale, state) {
    const [x, y] = at([0, 0, 0]);
    const theta = Math.PI + 2 * Math.PI * state.turns;
    g.fillStyle = ink("load");
    g.fillRect(x - 26, y - 56, 52, 30);
    g.strokeStyle = ink("steel");
    g.lineWidth = 4;
    line(g, [[x, y - 26], [x, y]]);
    // A disc on the shaft, whose mark shows the angle.
    g.fillStyle = ink("steel-back");
    g.beginPath();
    g.ellipse(x, y - 14, 18, 6, 0, 0, 2 * Math.PI);
    g.fill();
    dot(g, x + 13 * Math.cos(theta), y - 14 + 4 * Math.sin(theta), 4, ink("now"));
    g.fillStyle = ink("card");
    g.textAlign = "center";
    g.textBaseline = "middle";
    g.fillText("motor", x, y - 41);
    g.fillStyle = ink("steel");
    const half = Math.max(3, scale * solver.constants[2] / 2);
    g.fillRect(x - half * Math.abs(Math.cos(theta)) - 2, y - 3, 2 * half * Math.abs(Math.cos(theta)) + 4, 6);
  },

  // Rail with millimetres, and where the load hung at the pre-twist.
  rail(g, at, scale, state, start_m, width) {
    const rail = Math.min(width - 62, at([0, 0.5 * drawing.span_m, 0])[0] + 62);
    drawing.rail_px = rail;
    g.strokeStyle = ink("ghost");
    g.lineWidth = 2;
    line(g, [at([0, 0, 0]), at([drawing.longest_m, 0, 0])].map(([, y], k) => [rail, k ? y + 20 : y]));
    g.fillStyle = ink("soft");
    g.textAlign = "left";
    g.textBaseline = "middle";
    g.lineWidth = 1;
    const step = scale > 2500 ? 1 : 5;
    for (let mm = 0; mm <= drawing.longest_m * 1e3; mm += step) {
      const y = at([mm * 1e-3, 0, 0])[1];
      line(g, [[rail, y], [rail + (mm % 10 ? 4 : 8), y]]);
      if (mm % 20 === 0) g.fillText(`${mm} mm`, rail + 11, y);
    }
    const [start, now] = [start_m, state.gap_m].map((x) => at([x, 0, 0])[1]);
    g.setLineDash([4, 4]);
    g.strokeStyle = ink("accent");
    line(g, [[at([0, 0.1 * drawing.span_m, 0])[0], start], [rail, start]]);
    g.setLineDash([]);
    if (Math.abs(start - now) > 3) {
      const x = rail - 14;
      const tip = Math.sign(now - start);
      g.lineWidth = 1.5;
      line(g, [[x, start], [x, now]]);
      line(g, [[x - 4, now - 6 * tip], [x, now], [x + 4, now - 6 * tip]]);
      g.fillStyle = ink("accent");
      g.textAlign = "right";
      g.fillText(`${(state.contraction_m * 1e3).toFixed(2)} mm`, x + 4, start + 11 * -tip);
    }
  },

  // The carriage and the weight, whose volume is in proportion to the load.
  load(g, at, scale, state) {
    const [x, y] = at([state.gap_m, 0, 0]);
    const half = Math.max(3, scale * solver.constants[2] / 2);
    g.fillStyle = ink("steel");
    g.fillRect(x - half - 2, y - 3, 2 * half + 4, 6);
    // A bracket, bent around the rod.
    g.strokeStyle = ink("ghost");
    g.lineWidth = 4;
    line(g, [[x, y + 9], [drawing.rail_px - 10, y + 9], [drawing.rail_px - 5, y], [drawing.rail_px, y]]);
    dot(g, drawing.rail_px, y, 5, ink("ghost"));
    const size = 17 * Math.cbrt(Math.max(state.load_n, 0.05));
    g.strokeStyle = ink("steel");
    g.lineWidth = 2;
    line(g, [[x, y], [x, y + 16]]);
    g.fillStyle = ink("load");
    g.beginPath();
    g.roundRect(x - size / 2 - 6, y + 14, size + 12, Math.min(size + 4, 54), 4);
    g.fill();
    g.fillStyle = ink("ink");
    g.textAlign = "right";
    g.textBaseline = "middle";
    g.strokeStyle = ink("card");
    g.lineWidth = 4;
    const place = [x - size / 2 - 12, y + 14 + Math.min(size + 4, 54) / 2];
    g.strokeText(`${state.load_n.toPrecision(3)} N`, ...place);
    g.fillText(`${state.load_n.toPrecision(3)} N`, ...place);
  },

  measured(g, at, gap_m) {
    const y = at([gap_m, 0, 0])[1];
    const x = drawing.rail_px;
    g.fillStyle = ink("now");
    g.beginPath();
    g.moveTo(x - 1, y);
    g.lineTo(x - 13, y - 6);
    g.lineTo(x - 13, y + 6);
    g.fill();
  },
};
