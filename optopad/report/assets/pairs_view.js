// The signal of one pair at a time: curves by path of light, modes and deadbands shaded, and the press in the pad.
(() => {
"use strict";
const box = document.getElementById("pairs-view"), source = document.getElementById("pairs-data");
if (!box || !source) return;
const data = JSON.parse(source.textContent), STEP = 10000;
const choice = box.querySelector("select"), slider = box.querySelector("input[type=range]");
const plot = box.querySelector("[data-plot]"), plan = box.querySelector("[data-plan]");
const told = box.querySelector("[data-reading]"), at = box.querySelector("[data-at]"), shown = box.querySelector("output");
const drawn = optopadDrawn;
const CURVES = ["total", "direct", "top", "other"];
let number = 0, frame = null;

const round = (value) => Math.round(10 * value) / 10;
const mm = (value) => value.toFixed(2);

function ticks(low, high, most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((value) => value >= rough - 1e-12);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9; k += 1) found.push(k * step);
  return found;
}

function curvesOf(pair) {
  const {total, direct, top} = pair;
  return {total, direct, top, other: total.map((value, k) => value - direct[k] - top[k])};
}

function interpolated(values, depth) {
  const k = Math.min(values.length - 2, Math.max(0, data.depth.findIndex((at) => at >= depth) - 1));
  const share = (depth - data.depth[k]) / (data.depth[k + 1] - data.depth[k]);
  return (values[k] + share * (values[k + 1] - values[k])) / STEP;
}

function band(frame, [from, to], kind, label, row) {
  if (to <= from) return;
  const x0 = frame.x(from), x1 = frame.x(to);
  drawn(plot, "rect", {class: `band ${kind}`, x: round(x0), y: frame.top, width: round(Math.max(1, x1 - x0)), height: frame.bottom - frame.top});
  const middle = Math.min(frame.right - 3.4 * label.length, Math.max(frame.left + 3.4 * label.length, (x0 + x1) / 2));
  drawn(plot, "text", {class: `name ${kind}`, x: round(middle), y: 13 + 15 * row, "text-anchor": "middle"}, label);
  drawn(plot, "line", {class: `edge ${kind}`, x1: round(x0), x2: round(x1), y1: 17 + 15 * row, y2: 17 + 15 * row});
}

function drawPlot(pair) {
  plot.replaceChildren();
  const width = Math.max(240, plot.clientWidth), height = Math.max(260, Math.min(400, 0.62 * width));
  plot.setAttribute("viewBox", `0 0 ${width} ${height}`);
  plot.style.height = `${height}px`;
  const deepest = data.depth[data.depth.length - 1];
  const highest = 1.05 * Math.max(STEP, ...pair.total) / STEP;
  frame = {left: 46, right: width - 10, top: 52, bottom: height - 40};
  frame.x = (depth) => frame.left + (frame.right - frame.left) * depth / deepest;
  frame.y = (share) => frame.bottom - (frame.bottom - frame.top) * share / highest;
  drawn(plot, "title", {}, `Signal of ${pair.name} against depth by path of light. ${pair.reading}`);
  optopadHatch(plot, "pairs-hatch", 7);
  band(frame, pair.mode1, "mode1", "mode 1", 0);
  if (pair.mode2) band(frame, [pair.mode2[0], pair.mode2[1] ?? deepest], "mode2", pair.mode2[1] === null ? "mode 2, open" : "mode 2", 1);
  for (const interval of pair.dead) band(frame, interval, "dead", "deadband", 2);
  if (pair.flat) band(frame, pair.flat, "flat", "flat", 2);
  for (const share of ticks(0, highest, height > 320 ? 6 : 4)) {
    drawn(plot, "line", {class: "grid-line", x1: frame.left, x2: frame.right, y1: round(frame.y(share)), y2: round(frame.y(share))});
    drawn(plot, "text", {class: "tick", x: frame.left - 6, y: round(frame.y(share)) + 4, "text-anchor": "end"}, `${Math.round(100 * share)}`);
  }
  for (const depth of ticks(0, deepest, width > 500 ? 10 : 6)) {
    drawn(plot, "text", {class: "tick", x: round(frame.x(depth)), y: frame.bottom + 16, "text-anchor": "middle"}, `${Number(depth.toFixed(3))}`);
  }
  drawn(plot, "line", {class: "axis", x1: frame.left, x2: frame.right, y1: frame.bottom, y2: frame.bottom});
  drawn(plot, "text", {class: "tick", x: (frame.left + frame.right) / 2, y: height - 6, "text-anchor": "middle"}, "depth of the press [mm]");
  drawn(plot, "text", {class: "tick", x: -(frame.top + frame.bottom) / 2, y: 12, "text-anchor": "middle", transform: "rotate(-90)"}, "light / untouched total [%]");
  if (pair.full && pair.full < highest) {
    drawn(plot, "line", {class: "full", x1: frame.left, x2: frame.right, y1: round(frame.y(pair.full)), y2: round(frame.y(pair.full))});
    drawn(plot, "text", {class: "tick", x: frame.right, y: round(frame.y(pair.full)) + 13, "text-anchor": "end"}, "full scale of the converter");
  }
  const curves = curvesOf(pair);
  for (const name of CURVES.slice().reverse()) {
    const points = curves[name].map((value, k) => `${round(frame.x(data.depth[k]))},${round(frame.y(value / STEP))}`);
    drawn(plot, "polyline", {class: `curve ${name}`, points: points.join(" ")});
  }
  drawn(plot, "line", {class: "cursor", y1: frame.top, y2: frame.bottom});
  for (const name of CURVES) drawn(plot, "circle", {class: `dot ${name}`, r: 3.5});
}

function moveCursor(pair) {
  const depth = Number(slider.value), curves = curvesOf(pair), x = round(frame.x(depth));
  const line = plot.querySelector(".cursor");
  line.setAttribute("x1", x);
  line.setAttribute("x2", x);
  const values = CURVES.map((name) => interpolated(curves[name], depth));
  CURVES.forEach((name, k) => {
    const dot = plot.querySelector(`.dot.${name}`);
    dot.setAttribute("cx", x);
    dot.setAttribute("cy", round(frame.y(values[k])));
    box.querySelector(`[data-value=${name}]`).textContent = `${(100 * values[k]).toFixed(1)} %`;
  });
  const within = (spans) => spans.some(([from, to]) => from <= depth && depth <= to);
  const places = [];
  if (within([pair.mode1])) places.push("mode 1");
  if (pair.mode2 && within([[pair.mode2[0], pair.mode2[1] ?? Infinity]])) places.push("mode 2");
  if (within(pair.dead)) places.push("deadband");
  if (pair.flat && within([pair.flat])) places.push("flat beyond mode 2");
  shown.textContent = `${mm(depth)} mm`;
  at.textContent = `${mm(depth)} mm: ${(values[0] * pair.counts).toFixed(0)} counts${places.length ? `, in ${places.join(" and ")}` : ""}`;
  box.dataset.depth = mm(depth);
}

function drawPlan(pair) {
  const {length, width, parts} = data.plan, size = Math.max(length, width), up = (y) => width - y;
  const where = `${pair.name} in the pad, seen from above; the press is at x ${pair.press[0]}, y ${pair.press[1]} mm`;
  optopadSheet(plan, data.plan, 0.1 * size, where);
  const pad = optopadPlan(data.plan, plan).outline({class: "pad"}).workspace({class: "space"});
  const ends = pair.name.split("-"), place = Object.fromEntries(parts.map(([name, , x, y]) => [name, [x, y]]));
  const [from, to] = ends.map((name) => place[name]);
  drawn(plan, "line", {class: "chord", x1: from[0], y1: up(from[1]), x2: to[0], y2: up(to[1])});
  drawn(plan, "circle", {class: "tip", cx: pair.press[0], cy: up(pair.press[1]), r: data.plan.tip});
  for (const part of parts) {
    const [name, , x, y, ox, oy] = part, active = ends.includes(name);
    pad.part(part, (active ? 0.024 : 0.014) * size, active ? "" : " idle");
    if (active) {
      const out = 0.055 * size;
      drawn(plan, "text", {x: x + ox * out, y: up(y) - oy * out, "text-anchor": "middle", "dominant-baseline": "central", "font-size": 0.05 * size}, name);
    }
  }
}

function show() {
  const pair = data.pairs[number];
  choice.value = String(number);
  told.textContent = pair.reading;
  box.querySelector("[data-loads]").textContent = pair.loads;
  box.dataset.pair = pair.name;
  drawPlot(pair);
  drawPlan(pair);
  moveCursor(pair);
}
function choose(next) {
  number = (next + data.pairs.length) % data.pairs.length;
  show();
}

choice.addEventListener("change", () => choose(Number(choice.value)));
slider.addEventListener("input", () => moveCursor(data.pairs[number]));
box.addEventListener("click", (event) => {
  const button = event.target.closest("button[data-step]");
  if (button) choose(number + Number(button.dataset.step));
});
plot.addEventListener("pointermove", (event) => {
  if (event.pointerType === "touch" && !event.isPrimary) return;
  const x = event.clientX - plot.getBoundingClientRect().left;
  slider.value = String(Number(slider.max) * (x - frame.left) / (frame.right - frame.left));
  moveCursor(data.pairs[number]);
});
document.addEventListener("click", (event) => {
  const link = event.target.closest("a[data-pair]");
  const wanted = link ? data.pairs.findIndex((pair) => pair.name === link.dataset.pair) : -1;
  if (wanted >= 0) choose(wanted);
});
box.hidden = false;
document.getElementById("pairs-still").classList.add("replaced");
number = data.first;
show();
if (window.ResizeObserver) {
  let width = plot.clientWidth;
  new ResizeObserver(() => { if (plot.clientWidth !== width) { width = plot.clientWidth; show(); } }).observe(box);
}
box.dataset.ready = "yes";
})();
