// Starts the page when the solver is there.

// For the console and for tests: `solve` is the solver, `state` what is set, `frame_ms` what the last redraw took.
const tsa = {
  solve: (load_n, turns) => solver.solve(load_n, turns),
  torque: (load_n, turns) => solver.torque(load_n, turns),
  get state() {
    return { load_n: rig.load_n, turns: rig.turns, constants: solver.constants.slice(), map_done: !rig.unmeasured && map.next === map.cells.length };
  },
  frame_ms: NaN,
};
window.tsa = tsa;

function redrawAll() {
  if (!solver.wasm) return;
  map.paint();
  playback.draw();
  rig.invalidate();
}

try {
  solver.begin(() => {
    document.getElementById("interactive").hidden = false;
    beginControls();
    map.begin();
    playback.begin();
    rig.setConstants(solver.constants);
    new ResizeObserver(redrawAll).observe(document.body);
  });
} catch (error) {
  unsupported(error);
}
