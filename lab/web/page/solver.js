// The solver: WebAssembly of tsa-model. The order of numbers is that of web/src/page.rs.

const data = JSON.parse(document.getElementById("tsa-data").textContent);

const TIERS = ["rigid", "beam-column", "pseudo-rigid", "elastica", "inextensible", "full"];
const FULL = TIERS.length - 1;
const RESULTS = ["contraction_m", "gap_m", "tr_rad_per_m", "alpha_rad", "X_m", "D_m", "w_m", "r_m", "tension_n",
  "bending_strain", "load_sag_m", "dgap_dload_m_per_n"];

const solver = {
  module: null, wasm: null, numbers: null, constants: data.constants.map((x) => x ?? NaN),

  // Compiles the solver, at once where the browser allows it; `done` is called when it is there.
  begin(done) {
    const text = atob(document.getElementById("tsa-solver").textContent.trim());
    const bytes = Uint8Array.from(text, (c) => c.charCodeAt(0));
    const finish = (module) => {
      solver.module = module;
      solver.instantiate();
      done();
    };
    try {
      finish(new WebAssembly.Module(bytes));
    } catch (error) {
      if (solver.module) throw error;
      WebAssembly.compile(bytes).then(finish).catch((why) => unsupported(why));
    }
  },

  instantiate() {
    solver.wasm = new WebAssembly.Instance(solver.module, {}).exports;
    solver.numbers = new Float64Array(solver.wasm.memory.buffer, solver.wasm.numbers(), 128);
    solver.setConstants(solver.constants);
  },

  text() {
    const bytes = new Uint8Array(solver.wasm.memory.buffer, solver.wasm.text(), solver.wasm.text_length());
    return new TextDecoder().decode(bytes);
  },

  // Calls an export. A trap leaves the instance in an unknown state, so that another takes its place.
  call(name, ...values) {
    try {
      return solver.wasm[name](...values);
    } catch (error) {
      solver.wasm = new WebAssembly.Instance(solver.module, {}).exports;
      solver.numbers = new Float64Array(solver.wasm.memory.buffer, solver.wasm.numbers(), 128);
      solver.numbers.set(solver.constants);
      solver.wasm.set_constants();
      throw error;
    }
  },

  // Why the constants are refused, or null.
  setConstants(constants) {
    solver.constants = constants.slice();
    solver.numbers.set(constants);
    return solver.call("set_constants") ? null : solver.text();
  },

  solve(load_n, turns, tier = FULL) {
    for (const [name, value] of [["load_n", load_n], ["turns", turns]]) {
      if (typeof value !== "number") {
        return { error: `wrong-type: ${name} must be a number, not ${value === null ? "null" : typeof value}` };
      }
    }
    if (!solver.wasm) return { error: "not-ready: the solver is still being compiled" };
    try {
      if (!solver.call("solve", load_n, turns, tier)) return { error: solver.text() };
    } catch (error) {
      return { error: `internal: ${error.message}` };
    }
    const result = { load_n, turns, tier: TIERS[tier] };
    RESULTS.forEach((name, k) => { result[name] = Number.isNaN(solver.numbers[k]) ? null : solver.numbers[k]; });
    result.tier_error = { contraction_m: solver.numbers[RESULTS.length], tr_relative: solver.numbers[RESULTS.length + 1] };
    result.warnings = solver.text().split(",").filter((name) => name);
    return result;
  },

  // The conservative torque on the strings (N m), or null. It takes dozens of solves.
  torque(load_n, turns) {
    const torque_nm = solver.call("torque", load_n, turns);
    return Number.isNaN(torque_nm) ? null : torque_nm;
  },

  // Points of a bent half rod of the last state, as [along, sideways] in metres.
  rodPath() {
    const count = solver.call("rod_path");
    return Array.from({ length: count }, (_, k) => [solver.numbers[2 * k], solver.numbers[2 * k + 1]]);
  },

  // Number of the cheapest sufficient tier, or the kind of the limit.
  cheapest(load_n, turns, wanted) {
    try {
      const tier = solver.call("cheapest", load_n, turns, wanted.contraction_m, wanted.tr_relative);
      return tier >= 0 ? tier : solver.text().split(":")[0];
    } catch (error) {
      return "internal";
    }
  },
};

// Says in a sentence why nothing moves; the rest of the page needs no solver.
function unsupported(why) {
  const notice = document.getElementById("unsupported");
  notice.textContent = "This browser has no WebAssembly, or does not allow it here, so the mechanism cannot be computed "
    + `and moved (${why?.message ?? why}). Error bounds, figures and constants are below.`;
  notice.hidden = false;
  document.getElementById("interactive").hidden = true;
}
