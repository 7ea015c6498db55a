// Maps over the pad, depth by depth: one quantity at a time, a slider of depth, and a location's values against depth.
(() => {
"use strict";
const box = document.getElementById("maps-view"), source = document.getElementById("maps-data");
if (!box || !source) return;
const data = JSON.parse(source.textContent);
const slider = box.querySelector("input[type=range]"), map = box.querySelector("[data-map]"), scale = box.querySelector("[data-scale]");
const profile = box.querySelector("[data-profile]"), reading = box.querySelector("[data-reading]"), shown = box.querySelector("output");
const about = box.querySelector("[data-about]"), summary = box.querySelector("[data-summary]");
const drawn = optopadDrawn;
const xOf = (p) => data.x[data.cells[p][1]], yOf = (p) => data.y[data.cells[p][0]];
let which = 0, depth = 0, place = data.first;
let current = data.maps[0];

const round = (value) => Math.round(100 * value) / 100;
const isDead = (d, p) => Boolean(current.dead[d][p]);
const valueAt = (d, p) => current.values[d][p];
const isFlat = () => current.depth.length < 2;
const atDepth = () => isFlat() ? "" : ` at ${current.depth[depth].toFixed(2)} mm depth`;

function parsed(colour) { return [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16)); }
function shareOf(value) {
  const {low, high, log} = current, flat = log ? Math.log : Number;
  const share = (flat(value) - flat(low)) / ((flat(high) - flat(low)) || 1);
  return Math.min(1, Math.max(0, share));
}
function colourOf(share) {
  const stops = current.colours.map(parsed), at = share * (stops.length - 1), k = Math.min(stops.length - 2, Math.floor(at));
  return stops[k].map((value, n) => Math.round(value + (at - k) * (stops[k + 1][n] - value)));
}
// whether white contrasts more with a colour than black does: relative luminance below 0.179
const isDeep = (colour) => colour.map((value) => value / 255).map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
  .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0) < 0.179;

function words(value) {
  const {unit, digits} = current;
  if (value === null) return current.absent;
  if (current.names) return current.names[value];
  return `${numberOf(value, digits)} ${unit}`;
}
// the limits of a value, if they are known
function endsOf(d, p) {
  if (!current.ends || valueAt(d, p) === null) return "";
  const [low, high] = current.ends[d][p];
  return ` (${low === null ? "open" : numberOf(low, current.digits)} to ${high === null ? "open" : numberOf(high, current.digits)} ${current.endsOf})`;
}
// three significant digits, and no more decimals than the quantity has
function numberOf(value, digits) {
  if (value === 0) return "0";
  return value.toFixed(Math.max(0, Math.min(digits, 2 - Math.floor(Math.log10(Math.abs(value))))));
}

const edges = (lines, limit) => {
  const step = lines.length > 1 ? lines[1] - lines[0] : data.pitch;
  return [...lines.map((value) => value - step / 2), lines[lines.length - 1] + step / 2].map((value) => Math.min(limit, Math.max(0, value)));
};
const EX = edges(data.x, data.plan.length), EY = edges(data.y, data.plan.width);
const up = (y) => data.plan.width - y;
function areaOf(p) {
  const [row, column] = data.cells[p];
  return {x: round(EX[column]), y: round(up(EY[row + 1])), width: round(EX[column + 1] - EX[column]), height: round(EY[row + 1] - EY[row])};
}

function drawMap() {
  const {length, width, parts} = data.plan, size = Math.max(length, width);
  optopadSheet(map, data.plan, 0.09 * size, `${current.title} over the pad${atDepth()}`);
  optopadHatch(map, "maps-hatch", 0.03 * size, `stroke-width:${0.012 * size}px`);
  const plan = optopadPlan(data.plan, map).outline({class: "pad"});
  optopadPlan(data.plan, drawn(map, "clipPath", {id: "maps-pad"})).outline({});
  const cells = drawn(map, "g", {"clip-path": "url(#maps-pad)"});
  const tall = Math.min(...EY.slice(1).map((value, k) => value - EY[k])), wide = Math.min(...EX.slice(1).map((value, k) => value - EX[k]));
  const font = Math.min(0.34 * tall, 0.25 * wide);
  data.cells.forEach((_, p) => {
    const value = valueAt(depth, p), colour = value === null ? null : colourOf(shareOf(value));
    drawn(cells, "rect", {class: value === null ? "cell absent" : "cell", "data-place": p, ...areaOf(p), ...(colour ? {fill: `rgb(${colour})`} : {})});
    if (value === null || isDead(depth, p)) drawn(cells, "rect", {class: "dead-cell", fill: "url(#maps-hatch)", ...areaOf(p)});
  });
  plan.workspace({class: "space"});
  if (!current.names && data.cells.length <= 130) {
    current.values[depth].forEach((value, p) => {
      if (value === null) return;
      const place = {x: xOf(p), y: up(yOf(p))};
      const tone = isDeep(colourOf(shareOf(value))) ? "on-deep" : "on-pale";
      drawn(map, "text", {class: tone, ...place, "font-size": round(font), "text-anchor": "middle", "dominant-baseline": "central"}, value >= 10 ? value.toFixed(0) : value.toPrecision(2));
    });
  }
  for (const part of parts) plan.part(part, 0.014 * size, "");
  drawn(map, "rect", {class: "chosen", ...areaOf(place)});
}

function drawScale() {
  const {low, high, unit, names, colours, limit} = current;
  scale.replaceChildren();
  if (names) {
    names.forEach((name, k) => {
      const item = document.createElement("span"), swatch = document.createElement("i");
      swatch.style.background = colours[Math.round(k * (colours.length - 1) / (names.length - 1))];
      item.append(swatch, name);
      scale.append(item);
    });
    return;
  }
  const bar = document.createElement("i"), digits = current.digits;
  bar.className = "ramp";
  bar.style.background = `linear-gradient(90deg, ${Array.from({length: 12}, (_, k) => `rgb(${colourOf(k / 11)})`).join(",")})`;
  scale.append(`${numberOf(low, digits)} ${unit}`, bar, `${numberOf(high, digits)} ${unit}${current.more ? " or more" : ""}`);
  if (limit) {
    const note = document.createElement("span");
    note.textContent = limit;
    scale.append(note);
  }
}

function drawProfile() {
  profile.replaceChildren();
  profile.style.display = isFlat() ? "none" : "";
  if (isFlat()) return;
  const width = Math.max(220, profile.clientWidth), height = 210, left = 52, right = width - 10, top = 12, bottom = height - 38;
  profile.setAttribute("viewBox", `0 0 ${width} ${height}`);
  profile.style.height = `${height}px`;
  const {log, names, unit, title} = current, deepest = data.deepest;
  const found = current.depth.map((_, d) => valueAt(d, place)).filter((value) => value !== null);
  const high = Math.max(current.high, ...found), low = Math.min(current.low, ...found);
  const flat = log ? Math.log : Number;
  const x = (mm) => left + (right - left) * mm / deepest;
  const y = (value) => bottom - (bottom - top) * (flat(value) - flat(low)) / ((flat(high) - flat(low)) || 1);
  drawn(profile, "title", {}, `${title} against depth at x ${xOf(place)}, y ${yOf(place)} mm`);
  for (const [from, to] of data.bands[place]) drawn(profile, "rect", {class: "band dead-band", x: round(x(from)), y: top, width: round(Math.max(1, x(to) - x(from))), height: bottom - top});
  const levels = names ? names.map((_, k) => k) : log
    ? Array.from({length: 13}, (_, k) => 10 ** (k - 6)).filter((value) => value >= low * 0.999 && value <= high * 1.001)
    : [low, (low + high) / 2, high];
  if (log && levels.length < 2) levels.push(low, high);
  for (const value of levels) {
    drawn(profile, "line", {class: "grid-line", x1: left, x2: right, y1: round(y(value)), y2: round(y(value))});
    drawn(profile, "text", {class: "tick", x: left - 5, y: round(y(value)) + 4, "text-anchor": "end"}, names ? String(value) : log ? String(Number(value.toPrecision(1))) : numberOf(value, current.digits));
  }
  for (let mm = 0; mm <= deepest + 1e-9; mm += deepest > 6 ? 2 : 1) drawn(profile, "text", {class: "tick", x: round(x(mm)), y: bottom + 16, "text-anchor": "middle"}, String(mm));
  drawn(profile, "line", {class: "axis", x1: left, x2: right, y1: bottom, y2: bottom});
  drawn(profile, "text", {class: "tick", x: (left + right) / 2, y: height - 5, "text-anchor": "middle"}, `depth [mm]${names ? "" : `; upward: ${unit}`}`);
  let run = [];
  const flush = () => { if (run.length > 1) drawn(profile, "polyline", {class: "curve total", points: run.join(" ")}); run = []; };
  const few = current.depth.length < 12;
  current.depth.forEach((mm, d) => {
    const value = valueAt(d, place);
    if (value === null) { flush(); return; }
    run.push(`${round(x(mm))},${round(y(value))}`);
    if (few) drawn(profile, "circle", {class: "dot total", cx: round(x(mm)), cy: round(y(value)), r: 3});
  });
  flush();
  drawn(profile, "line", {class: "cursor", x1: round(x(current.depth[depth])), x2: round(x(current.depth[depth])), y1: top, y2: bottom});
}

function tell() {
  const x = xOf(place), y = yOf(place), {title, tells} = current;
  const mm = isFlat() ? "" : current.depth[depth].toFixed(2);
  shown.textContent = isFlat() ? "any depth" : `${mm} mm`;
  slider.setAttribute("aria-valuetext", shown.textContent);
  about.textContent = tells;
  const mark = isDead(depth, place) && valueAt(depth, place) !== null && !current.names ? `; ${current.hatched}` : "";
  reading.textContent = `x ${Number(x.toFixed(2))}, y ${Number(y.toFixed(2))} mm${atDepth()}. ${title}: ${words(valueAt(depth, place))}${endsOf(depth, place)}${mark}.`;
  const values = current.values[depth], blind = values.filter((value, p) => value === null || isDead(depth, p)).length;
  const rest = values.filter((value) => value !== null).sort((a, b) => a - b);
  const middle = rest.length && !current.names ? ` Median over the locations that have a value: ${words(rest[Math.floor((rest.length - 1) / 2)])}.` : "";
  summary.textContent = `${blind} of ${values.length} locations are hatched: ${current.hatched}.${middle}`;
  Object.assign(box.dataset, {quantity: current.key, depth: mm, place});
}

// another quantity, at the depth nearest to the one that was shown
function take(number, mm) {
  which = number;
  current = data.maps[which];
  depth = 0;
  current.depth.forEach((value, d) => { if (value !== null && Math.abs(value - mm) < Math.abs(current.depth[depth] - mm)) depth = d; });
  slider.max = String(Math.max(1, current.depth.length - 1));
  slider.disabled = isFlat();
  slider.value = String(depth);
  for (const button of box.querySelectorAll("button[data-play]")) button.disabled = isFlat();
}

function show() {
  drawMap();
  drawScale();
  drawProfile();
  tell();
}
slider.addEventListener("input", () => { depth = Number(slider.value); show(); });
box.addEventListener("change", (event) => {
  if (event.target.name !== "maps-which") return;
  take(Number(event.target.value), isFlat() ? data.at : current.depth[depth]);
  show();
});
map.addEventListener("click", (event) => {
  const cell = event.target.closest("[data-place]");
  if (cell) { place = Number(cell.dataset.place); show(); }
});
const MOVES = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};
map.addEventListener("keydown", (event) => {
  const move = MOVES[event.key];
  if (!move || event.altKey || event.ctrlKey || event.metaKey) return;
  event.preventDefault();
  place = nextPlace(...move);
  show();
});
// the nearest location ahead, no more aside than ahead; the same location if there is none
function nextPlace(right, upward) {
  const [row, column] = data.cells[place];
  let found = place, nearest = Infinity;
  data.cells.forEach(([r, c], p) => {
    const ahead = (c - column) * right + (r - row) * upward, aside = Math.abs((c - column) * upward) + Math.abs((r - row) * right);
    if (ahead <= 0 || aside > ahead || Math.hypot(ahead, aside) >= nearest) return;
    found = p;
    nearest = Math.hypot(ahead, aside);
  });
  return found;
}
let playing = null;
box.addEventListener("click", (event) => {
  const button = event.target.closest("button[data-play]");
  if (!button) return;
  if (playing) { clearInterval(playing); playing = null; button.setAttribute("aria-pressed", "false"); return; }
  button.setAttribute("aria-pressed", "true");
  playing = setInterval(() => { depth = (depth + 1) % current.depth.length; slider.value = String(depth); show(); }, 180);
});
if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) box.querySelector("button[data-play]").hidden = true;

const marked = box.querySelector("input[name=maps-which]:checked");
take(marked ? Number(marked.value) : 0, data.at);
box.hidden = false;
document.getElementById("maps-still").classList.add("replaced");
show();
if (window.ResizeObserver) {
  let width = profile.clientWidth;
  new ResizeObserver(() => { if (profile.clientWidth !== width) { width = profile.clientWidth; drawProfile(); } }).observe(box);
}
box.dataset.ready = "yes";
})();
