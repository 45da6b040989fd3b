// The state of the mechanism, and everything that changes it: sliders, pointer, keys.

const scene_load = data.envelope?.load_n ?? [1, 15];
const ranges = {
  scene_load,
  load: [Math.max(0.06, 0.2 * scene_load[0]), 1.5 * scene_load[1]],
  turns: [-0.5, 1.35 * (data.envelope?.turns[1] ?? 7.5)],
};

// Constants with a slider: place in the solver's order, name, unit and what a unit is in SI.
const SLIDERS = [
  [0, "String length L0", "mm", 1e-3], [1, "Rod span D0", "mm", 1e-3], [2, "Clamp width c", "mm", 1e-3],
  [3, "Rod radius R", "mm", 1e-3], [11, "Young's modulus of the rods a1", "GPa", 1e9], [4, "String diameter r0", "mm", 1e-3],
  [5, "String stiffness K", "N/m", 1], [6, "k1 of the string's radius", "1/N", 1], [7, "k2", "", 1], [8, "k3", "", 1],
  [9, "k4", "", 1], [10, "Exponent p of the twist", "", 1],
];

const WARNINGS = {
  "light-load": "the load is below 0.5 N, where the radius law has no support",
  "strain-range": "a fibre strain is above 8 %, the range of the stress–strain fit",
  "not-unique": "more than one equilibrium may exist; this one is connected to zero load",
  "open-strings": "the strings do not touch yet, where the paper says nothing",
  "tr-infinite": "at zero twist a small turn moves nothing",
};

// The turns that the table covers, or what is usual.
const TURNS_MAX = data.envelope?.turns[1] ?? 7.5;
// A state is written into the address when it has stood this long; browsers refuse to write more often.
const ADDRESS_MS = 300;
// How long the strings turn from 0 to their maximum (s).
const TURN_S = 6;

const rig = {
  load_n: Math.min(Math.max(4.9, scene_load[0]), scene_load[1]),
  turns: Math.min(3, TURNS_MAX),
  // Why the constants are refused, or null.
  refused: null,
  changed: false,
  // Whether what depends on the constants alone has to be computed again.
  unmeasured: false,
  // Measured position of the recorded move, while it is played back (m).
  measured_m: null,
  drawn: null,
  pending: false,
  // The address as it was last read or written.
  address: null,
  // When the last change was.
  moved_ms: 0,

  set(load_n, turns, measured_m = null) {
    const within = (v, [low, high]) => Math.min(Math.max(v, low), high);
    rig.load_n = within(load_n, ranges.load);
    rig.turns = within(turns, ranges.turns);
    rig.measured_m = measured_m;
    rig.invalidate();
    clearTimeout(rig.writing);
    rig.writing = setTimeout(rig.writeAddress, ADDRESS_MS);
  },

  // The state in the address, `#load=4.9&turns=3` in N and turns, as far as it is there.
  readAddress() {
    rig.address = location.hash;
    const address = new URLSearchParams(location.hash.slice(1));
    const number = (name, otherwise) => (/\d/.test(address.get(name)) && Number.isFinite(Number(address.get(name)))
      ? Number(address.get(name)) : otherwise);
    const [load_n, turns] = [number("load", rig.load_n), number("turns", rig.turns)];
    if (load_n !== rig.load_n || turns !== rig.turns) rig.set(load_n, turns);
  },

  writeAddress() {
    // The browser reports an address that somebody entered only later. It must not be overwritten before it is read.
    if (location.hash !== rig.address) return;
    const digits = (x) => Number(x.toPrecision(6));
    history.replaceState(null, "", `#load=${digits(rig.load_n)}&turns=${digits(rig.turns)}`);
    rig.address = location.hash;
  },

  // Draws in the next frame, once.
  invalidate() {
    rig.moved_ms = performance.now();
    if (rig.pending) return;
    rig.pending = true;
    requestAnimationFrame(() => {
      rig.pending = false;
      rig.render();
    });
  },

  setConstants(constants) {
    rig.refused = solver.setConstants(constants);
    rig.changed = constants.some((v, k) => !Object.is(v, data.constants[k] ?? NaN));
    rig.unmeasured = !rig.refused;
    rig.invalidate();
  },

  render() {
    const begun = performance.now();
    if (rig.unmeasured) {
      drawing.measure();
      curves.measure();
      map.measure();
      rig.unmeasured = false;
    }
    const state = { load_n: rig.load_n, turns: rig.turns, ...solver.solve(rig.load_n, rig.turns) };
    if (!state.error) rig.drawn = { state, path: solver.rodPath() };
    drawing.canvas.style.opacity = state.error ? 0.35 : 1;
    if (rig.drawn) drawing.draw(rig.drawn.state, rig.drawn.path, rig.measured_m);
    rig.show(state);
    if (curves.most) curves.draw(state);
    map.mark();
    tsa.frame_ms = performance.now() - begun;
  },

  show(state) {
    loadSlider.show(rig.load_n);
    turnsSlider.show(rig.turns);
    const box = document.getElementById("state");
    box.classList.toggle("refused", Boolean(state.error));
    if (state.error) {
      box.textContent = `No such state: ${rig.refused ?? state.error}`;
    } else if (state.warnings.length) {
      box.textContent = `Take this with care: ${state.warnings.map((w) => WARNINGS[w] ?? w).join("; ")}.`;
    } else {
      box.textContent = `${state.turns.toFixed(2)} turns under ${state.load_n.toPrecision(3)} N shorten the gap by `
        + `${(state.contraction_m * 1e3).toFixed(2)} mm; one more millimetre takes ${(state.tr_rad_per_m * 1e-3).toFixed(2)} rad.`;
    }
    const value = (x, factor, digits, unit) => (state.error || x === null ? "–" : `${(x * factor).toFixed(digits)} ${unit}`);
    const rows = [
      ["Contraction", value(state.contraction_m, 1e3, 3, "mm")],
      ["Transmission ratio", value(state.tr_rad_per_m, 1e-3, 3, "rad/mm")],
      ["Gap", value(state.gap_m, 1e3, 2, "mm")],
      ["String tension", value(state.tension_n, 1, 2, "N")],
      ["Torque on the strings", value(solver.torque(rig.load_n, rig.turns), 1e3, 2, "mN m")],
      ["Strain in the rods", value(state.bending_strain, 100, 2, "%")],
      ["Rod deflection", value(state.w_m, 1e3, 2, "mm")],
      ["Helix angle", value(state.alpha_rad, 180 / Math.PI, 1, "°")],
    ];
    const list = document.getElementById("readout");
    if (!list.children.length) {
      list.append(...rows.map(([name]) => {
        const row = document.createElement("div");
        row.append(Object.assign(document.createElement("dt"), { textContent: name }), document.createElement("dd"));
        return row;
      }));
    }
    rows.forEach(([, text], k) => { list.children[k].lastChild.textContent = text; });
    drawing.canvas.setAttribute("aria-label",
      `The mechanism at ${short(rig.load_n)} N and ${short(rig.turns)} turns. ${box.textContent}`);
    rig.showTiers(state);
  },

  showTiers(full) {
    const table = document.getElementById("tiers");
    if (!table.closest("details").open) return;
    const { contraction_m, tr_relative } = map.wanted();
    const rows = TIERS.map((name, k) => {
      const s = k === FULL ? full : solver.solve(rig.load_n, rig.turns, k);
      const row = document.createElement("tr");
      const enough = !s.error && s.tier_error.contraction_m <= contraction_m && s.tier_error.tr_relative <= tr_relative;
      const cells = s.error ? [name, s.error.split(":")[0], "", "no"] : [
        name,
        `${(s.contraction_m * 1e3).toFixed(4)} ± ${(s.tier_error.contraction_m * 1e3).toFixed(4)} mm`,
        s.tr_rad_per_m === null ? "–" : `${(s.tr_rad_per_m * 1e-3).toFixed(3)} rad/mm ± ${(s.tier_error.tr_relative * 100).toFixed(2)} %`,
        enough ? "yes" : "no",
      ];
      row.append(...cells.map((text) => Object.assign(document.createElement("td"), { textContent: text })));
      return row;
    });
    table.tBodies[0].replaceChildren(...rows);
  },
};

// A button that plays: `start` is called at its first press, then `step` in each frame with the seconds since the one
// before, until it returns false. Another press, or whatever else moves the mechanism, stops it.
const players = [];

function player(button, step, start) {
  const me = { playing: false, before_ms: null };
  me.stop = () => {
    me.playing = false;
    button.textContent = "Play";
  };
  const frame = (now_ms) => {
    if (!me.playing) return;
    const passed_s = (now_ms - (me.before_ms ?? now_ms)) * 1e-3;
    me.before_ms = now_ms;
    if (step(passed_s)) requestAnimationFrame(frame);
    else me.stop();
  };
  button.addEventListener("click", () => {
    const begins = !me.playing;
    stopPlaying();
    if (!begins) return;
    start();
    Object.assign(me, { playing: true, before_ms: null });
    button.textContent = "Pause";
    requestAnimationFrame(frame);
  });
  players.push(me);
}

function stopPlaying() {
  players.forEach((one) => one.stop());
}

// A labelled slider. `scale` maps its 0…1000 to the value and back; `text` shows the value.
function slider(parent, id, label, scale, text, changed) {
  const box = document.createElement("div");
  box.className = "slider";
  const input = Object.assign(document.createElement("input"), { type: "range", id, min: 0, max: 1000, step: "any" });
  const output = document.createElement("output");
  output.htmlFor = id;
  box.append(Object.assign(document.createElement("label"), { htmlFor: id, textContent: label }), output, input);
  parent.append(box);
  const show = (value) => {
    if (document.activeElement !== input || Math.abs(scale.value(Number(input.value)) - value) > 1e-9 * Math.abs(value)) {
      input.value = scale.place(value);
    }
    output.textContent = text(value);
    input.setAttribute("aria-valuetext", text(value));
  };
  input.addEventListener("input", () => changed(scale.value(Number(input.value))));
  // A slider whose step is "any" has no keys of its own everywhere.
  input.addEventListener("keydown", (event) => {
    const steps = { ArrowRight: 5, ArrowUp: 5, ArrowLeft: -5, ArrowDown: -5, PageUp: 50, PageDown: -50 }[event.key];
    if (steps === undefined) return;
    event.preventDefault();
    input.value = Number(input.value) + steps;
    changed(scale.value(Number(input.value)));
  });
  return { show, input };
}

const linear = ([low, high]) => ({
  value: (p) => low + (high - low) * p / 1000,
  place: (v) => 1000 * (v - low) / (high - low),
});
const logarithmic = ([low, high]) => ({
  value: (p) => low * (high / low) ** (p / 1000),
  place: (v) => 1000 * Math.log(v / low) / Math.log(high / low),
});

const stateSliders = document.getElementById("state-sliders");
const loadSlider = slider(stateSliders, "load", "Load", logarithmic(ranges.load),
  (v) => `${v.toPrecision(3)} N (${(v / 9.80665).toPrecision(3)} kg)`, (v) => stopPlaying() || rig.set(v, rig.turns));
const turnsSlider = slider(stateSliders, "turns", "Turns of the strings past the half-turn pre-twist",
  linear(ranges.turns), (v) => `${v.toFixed(3)} turns`, (v) => stopPlaying() || rig.set(rig.load_n, v));

// Sliders of the constants that the scene has, each from half to twice its value.
const constantSliders = SLIDERS.filter(([k]) => data.constants[k]).map(([k, label, unit, factor]) => {
  const value = data.constants[k];
  const control = slider(document.getElementById("constant-sliders"), `constant-${k}`, label,
    logarithmic([value / 2, value * 2]), (v) => `${(v / factor).toPrecision(4)} ${unit}`.trim(), (v) => {
      const constants = solver.constants.slice();
      constants[k] = v;
      control.show(v);
      rig.setConstants(constants);
    });
  control.show(value);
  return { k, control };
});

function beginControls() {
  // On a phone the constants would push the curves far down.
  if (matchMedia("(max-width: 760px)").matches) document.getElementById("constants-panel").open = false;
  document.getElementById("reset").addEventListener("click", () => {
    constantSliders.forEach(({ k, control }) => control.show(data.constants[k]));
    rig.setConstants(data.constants.map((x) => x ?? NaN));
  });
  document.getElementById("tiers").closest("details").addEventListener("toggle", () => rig.invalidate());

  rig.readAddress();
  window.addEventListener("hashchange", () => stopPlaying() || rig.readAddress());
  player(document.getElementById("turn"), (passed_s) => {
    rig.set(rig.load_n, rig.turns + passed_s * TURNS_MAX / TURN_S);
    return rig.turns < TURNS_MAX && !solver.solve(rig.load_n, rig.turns).error;
  }, () => rig.set(rig.load_n, 0));

  const start = { load_n: rig.load_n, turns: rig.turns };
  drawing.canvas.addEventListener("keydown", (event) => {
    const much = event.shiftKey ? 10 : 1;
    const step = { ArrowRight: [0, 0.05], ArrowLeft: [0, -0.05], ArrowDown: [0.02, 0], ArrowUp: [-0.02, 0] }[event.key];
    if (event.key === "Home") rig.set(start.load_n, start.turns);
    else if (step) rig.set(rig.load_n * (1 + step[0]) ** much, rig.turns + much * step[1]);
    else return;
    event.preventDefault();
    stopPlaying();
  });

  let grip = null;
  drawing.canvas.addEventListener("pointerdown", (event) => {
    grip = { x: event.clientX, y: event.clientY, load_n: rig.load_n, turns: rig.turns };
    drawing.canvas.setPointerCapture(event.pointerId);
    stopPlaying();
  });
  drawing.canvas.addEventListener("pointermove", (event) => {
    if (!grip) return;
    // The height of the drawing is the whole range of loads, its width five turns.
    const [low, high] = ranges.load;
    const down = (event.clientY - grip.y) / drawing.canvas.clientHeight;
    const right = (event.clientX - grip.x) / drawing.canvas.clientWidth;
    rig.set(grip.load_n * (high / low) ** down, grip.turns + 5 * right);
  });
  for (const end of ["pointerup", "pointercancel"]) drawing.canvas.addEventListener(end, () => { grip = null; });
}
