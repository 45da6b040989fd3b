// Canvases with axes. Lengths on a canvas are CSS pixels.

const css = { values: {} };

// The colour of a variable in page.css.
function ink(name) {
  css.values[name] ??= getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  return css.values[name];
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  css.values = {};
  redrawAll();
});

// A cleared context whose unit is a CSS pixel, with the size.
function begin(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
  }
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, width, height);
  g.font = "12px system-ui, sans-serif";
  g.lineJoin = "round";
  return { g, width, height };
}

// Round numbers between two, about so many.
function ticks(low, high, count) {
  const raw = (high - low) / Math.max(count, 1);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999) ?? power;
  const all = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) all.push(k * step);
  return all;
}

// 1, 2, 5, 10, … between two.
function logTicks(low, high) {
  const all = [];
  for (let p = Math.floor(Math.log10(low)); p <= Math.log10(high); p += 1) {
    for (const m of [1, 2, 5]) {
      const v = m * 10 ** p;
      if (v >= low * 0.999 && v <= high * 1.001) all.push(v);
    }
  }
  return all;
}

const short = (x) => String(Number(x.toPrecision(4)));

// The frame of a plot: `x` and `y` are { range, log, label }; the label of `y` stands above it. Returns the two scales and
// their inverses.
function axes(g, width, height, x, y) {
  const box = { left: 44, top: 26, right: width - 10, bottom: height - 36 };
  const scale = ({ range: [low, high], log }, from, to) => {
    const f = log ? Math.log : (v) => v;
    const back = log ? Math.exp : (v) => v;
    const [a, b] = [f(low), f(high)];
    return {
      at: (v) => from + (to - from) * (f(v) - a) / (b - a),
      of: (p) => back(a + (b - a) * (p - from) / (to - from)),
    };
  };
  const sx = scale(x, box.left, box.right);
  const sy = scale(y, box.bottom, box.top);
  g.lineWidth = 1;
  g.strokeStyle = ink("grid");
  g.fillStyle = ink("soft");
  g.textBaseline = "middle";
  g.textAlign = "right";
  for (const v of y.log ? logTicks(...y.range) : ticks(...y.range, height / 55)) {
    line(g, [[box.left, sy.at(v)], [box.right, sy.at(v)]]);
    g.fillText(short(v), box.left - 6, sy.at(v));
  }
  g.textAlign = "center";
  g.textBaseline = "top";
  for (const v of ticks(...x.range, width / 75)) {
    line(g, [[sx.at(v), box.top], [sx.at(v), box.bottom]]);
    g.fillText(short(v), sx.at(v), box.bottom + 5);
  }
  g.fillText(x.label, (box.left + box.right) / 2, box.bottom + 20);
  g.textAlign = "left";
  g.fillText(y.label, 4, 4);
  return { box, sx, sy };
}

// Fills a list with coloured swatches and what each means.
function legend(id, entries) {
  document.getElementById(id).replaceChildren(...entries.map(([colour, name]) => {
    const item = document.createElement("li");
    const swatch = document.createElement("i");
    swatch.style.background = colour;
    item.append(swatch, name);
    return item;
  }));
}

function line(g, points) {
  g.beginPath();
  points.forEach(([px, py], k) => (k ? g.lineTo(px, py) : g.moveTo(px, py)));
  g.stroke();
}

function dot(g, px, py, radius, colour) {
  g.beginPath();
  g.arc(px, py, radius, 0, 2 * Math.PI);
  g.fillStyle = colour;
  g.fill();
  g.strokeStyle = ink("card");
  g.lineWidth = 2;
  g.stroke();
}

function cross(g, px, py, colour) {
  g.strokeStyle = colour;
  g.lineWidth = 2;
  line(g, [[px - 4, py - 4], [px + 4, py + 4]]);
  line(g, [[px - 4, py + 4], [px + 4, py - 4]]);
}
