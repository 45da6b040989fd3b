// The recorded move, played back on the drawing.

const playback = {
  canvas: document.getElementById("moved-curve"),
  slider: document.getElementById("time"),
  time_s: 0,

  begin() {
    const moved = data.moved;
    if (!moved || moved.t_s.length < 2) return;
    document.getElementById("playback").hidden = false;
    document.getElementById("moved-what").textContent = moved.what;
    playback.slider.max = moved.t_s.at(-1);
    // The load of a row without one is the last that was known.
    let known = moved.load_n.find((load) => load !== null) ?? rig.load_n;
    playback.loads = moved.load_n.map((load) => { known = load ?? known; return known; });
    const last = moved.t_s.at(-1);
    player(document.getElementById("play"), (passed_s) => {
      playback.show(playback.time_s + passed_s);
      return playback.time_s < last;
    }, () => {
      // The slider rounds to its step.
      if (playback.time_s >= last - Number(playback.slider.step)) playback.time_s = 0;
    });
    playback.slider.addEventListener("input", () => {
      stopPlaying();
      playback.show(Number(playback.slider.value));
    });
    playback.draw();
  },

  // The row at or before a time.
  row(time_s) {
    const times = data.moved.t_s;
    let [low, high] = [0, times.length - 1];
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (times[middle] <= time_s) low = middle;
      else high = middle - 1;
    }
    return low;
  },

  show(time_s) {
    const moved = data.moved;
    playback.time_s = Math.min(time_s, moved.t_s.at(-1));
    const row = playback.row(playback.time_s);
    playback.slider.value = playback.time_s;
    document.getElementById("time-text").textContent = `${playback.time_s.toFixed(1)} s`;
    // A board that has not homed yet knows no twist.
    if (moved.turns[row] !== null) rig.set(playback.loads[row], moved.turns[row], moved.position_m[row]);
    playback.draw();
  },

  draw() {
    const moved = data.moved;
    if (!moved || moved.t_s.length < 2) return;
    const { g, width, height } = begin(playback.canvas);
    const all = [...moved.position_m, ...moved.setpoint_m].filter((x) => x !== null).map((x) => x * 1e3);
    const range = all.length ? [Math.min(...all, 0), Math.max(...all, 0.1)] : [0, 1];
    const pad = 0.05 * (range[1] - range[0]);
    const { box, sx, sy } = axes(g, width, height, { range: [0, moved.t_s.at(-1)], label: "time, s" },
      { range: [range[0] - pad, range[1] + pad], label: "position, mm: measured (line), set-point (dashed)" });
    for (const [column, colour, wide, dash] of [[moved.setpoint_m, "soft", 1.5, [5, 4]], [moved.position_m, "accent", 2.2, []]]) {
      g.strokeStyle = ink(colour);
      g.lineWidth = wide;
      g.setLineDash(dash);
      line(g, moved.t_s.map((t, k) => [t, column[k]]).filter(([, v]) => v !== null).map(([t, v]) => [sx.at(t), sy.at(v * 1e3)]));
    }
    g.setLineDash([]);
    g.strokeStyle = ink("now");
    g.lineWidth = 1.5;
    line(g, [[sx.at(playback.time_s), box.top], [sx.at(playback.time_s), box.bottom]]);
    const position = moved.position_m[playback.row(playback.time_s)];
    playback.canvas.setAttribute("aria-label", `Position over time; at ${playback.time_s.toFixed(1)} s `
      + (position === null ? "unknown" : `${(position * 1e3).toFixed(2)} mm`));
  },
};
