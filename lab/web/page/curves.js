// Contraction and TR along the turns, for the present load and for loads of the scene.

// Steps of the present load's curve, and of each of the others.
const STEPS = 90;
const FAMILY_STEPS = 45;
const LOAD_COLOURS = ["#d99a2b", "#5fa052", "#2f97ab", "#6c79d0", "#b05fb3"];

const curves = {
  canvases: [document.getElementById("contraction-curve"), document.getElementById("tr-curve")],
  // Curves of the scene's loads; they change with the constants only.
  family: [],
  most: null,

  // The states along the turns as [turns, contraction mm, TR rad/mm], and where the model ends.
  along(load_n, steps) {
    const [low, high] = [0, ranges.turns[1]];
    const points = [];
    for (let k = 0; k <= steps; k += 1) {
      const turns = low + (high - low) * k / steps;
      const s = solver.solve(load_n, turns);
      if (s.error) return { load_n, points, end: points.length ? curves.end(load_n, points.at(-1)[0], turns) : null };
      points.push([turns, s.contraction_m * 1e3, s.tr_rad_per_m * 1e-3]);
    }
    return { load_n, points, end: null };
  },

  // The last state before the limit, by bisection.
  end(load_n, good, bad) {
    let last = null;
    for (let k = 0; k < 12; k += 1) {
      const middle = (good + bad) / 2;
      const s = solver.solve(load_n, middle);
      if (s.error) {
        bad = middle;
      } else {
        good = middle;
        last = [middle, s.contraction_m * 1e3, s.tr_rad_per_m * 1e-3];
      }
    }
    return last;
  },

  measure() {
    const [low, high] = ranges.scene_load;
    curves.family = [0, 1, 2, 3, 4].map((k) => curves.along(low * (high / low) ** (k / 4), FAMILY_STEPS));
    const all = curves.family.flatMap((c) => (c.end ? [...c.points, c.end] : c.points));
    const most = (k) => Math.max(...all.map((p) => p[k]).filter(Number.isFinite), 1e-3);
    curves.most = [1.05 * most(1), 1.05 * most(2)];
    legend("curve-legend", curves.family.map(({ load_n }, k) => [LOAD_COLOURS[k], `${load_n.toPrecision(2)} N`]));
  },

  draw(state) {
    const present = curves.along(state.load_n, STEPS);
    if (present.end) present.points.push(present.end);
    ["contraction_m", "tr_rad_per_m"].forEach((name, k) => {
      const { g, width, height } = begin(curves.canvases[k]);
      const most = Math.max(curves.most[k], ...present.points.map((p) => p[k + 1]).filter(Number.isFinite));
      const { box, sx, sy } = axes(g, width, height,
        { range: [0, ranges.turns[1]], label: "turns past the half-turn pre-twist" },
        { range: [0, most], label: k ? "TR, rad/mm" : "contraction, mm" });
      const px = ([turns, ...values]) => [sx.at(turns), sy.at(values[k])];
      g.save();
      g.beginPath();
      g.rect(box.left, box.top - 4, box.right - box.left + 10, box.bottom - box.top + 8);
      g.clip();
      curves.family.forEach(({ points, end }, n) => {
        g.lineWidth = 1.4;
        g.strokeStyle = LOAD_COLOURS[n];
        line(g, (end ? [...points, end] : points).map(px));
        if (end) cross(g, ...px(end), LOAD_COLOURS[n]);
      });
      g.strokeStyle = ink("accent");
      g.lineWidth = 2.6;
      line(g, present.points.map(px));
      if (present.end) cross(g, ...px(present.end), ink("accent"));
      g.restore();
      if (!state.error && state.turns >= 0 && state[name] !== null) {
        dot(g, ...px([state.turns, state.contraction_m * 1e3, (state.tr_rad_per_m ?? 0) * 1e-3]), 6, ink("now"));
      }
      const value = state.error ? "the state is refused" : `${short((state[name] ?? NaN) * (k ? 1e-3 : 1e3))} ${k ? "rad/mm" : "mm"}`;
      curves.canvases[k].setAttribute("aria-label",
        `${k ? "Transmission ratio" : "Contraction"} over turns at ${short(state.load_n)} N; at ${short(state.turns)} turns: ${value}`);
    });
  },
};
