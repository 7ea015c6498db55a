// Rotates the pad of the report in three dimensions: mold, block, parts, deformed top, tip, and sample paths of light.
// The view is orthographic, from above or from the side; far things are drawn first, so that near ones cover them. The
// inside of the cavity is visible past the walls that are cut away, or through the mold's mouth.
(() => {
"use strict";
const box = document.getElementById("rays-view");
if (!box) return;
const data = JSON.parse(document.getElementById("rays-data").textContent);
const canvas = box.querySelector("canvas");
const pen = canvas.getContext("2d");
if (!pen) return;
const moldData = document.getElementById("mold-data");
const mold = moldData ? JSON.parse(moldData.textContent) : null;
const solid = mold ? optopadSolid(mold) : null, closed = mold && mold.lid ? optopadSolid(mold, mold.lid) : null;
const START = {yaw: -32, pitch: 24, zoom: 1};
const TURN = 6, ZOOM = 1.15, MARK = 2.2;
// number of lines of a pair and kind when all pairs are shown
const FEW = Math.max(4, Math.round(36 / data.pairs.length));
const [LENGTH, WIDTH, TOP, BLACK] = data.box;
const CENTRE = [LENGTH / 2, WIDTH / 2, TOP / 2];
const HEAD = Math.max(0.9 * data.tip[data.tip.length - 1][0], 1);
// walls are not cut away in views so steep that they hide nothing
const STEEP = 76, SHARP_AFTER_MS = 160;
// a mold with round walls is cut through its middle, in directions at this spacing
const CUT_TURN = Math.PI / 12;
const {walls: WALLS, edge: EDGE, axes: AXES, meshes, tip: TIP, hull} = optopadPad(data);
let show = mold ? "cut" : "none", resting = null;
let view = {...START}, state = 0, pair = 0, hidden = new Set(), printing = false, waiting = false;
let look = {}, size = [1, 1], scale = 1, turn = {};

function colours() {
  const style = getComputedStyle(box);
  const value = (name) => style.getPropertyValue(name).trim();
  const night = optopadTheme.isDark() && !printing;
  look = {ink: value("--ink"), muted: value("--muted"), sheet: value("--sheet"), line: value("--line"), night};
  look.black = night ? "#06080a" : "#33383f";
  look.floor = night ? "#12161b" : "#d9dde2";
  look.clear = night ? "#9cc9e6" : "#4a90c0";
  look.tip = night ? "#c3cad2" : "#5b6672";
  look.solid = night
    ? {body: [[98, 108, 121], [214, 111, 44], [58, 128, 184], [120, 134, 112]], section: [[52, 59, 68], [122, 58, 18], [26, 66, 100], [64, 76, 58]], edge: [[24, 28, 33], [60, 28, 8], [12, 32, 50], [28, 34, 26]]}
    : {body: [[176, 187, 201], [230, 126, 60], [88, 158, 214], [196, 206, 184]], section: [[128, 138, 152], [178, 84, 26], [42, 104, 156], [150, 162, 136]], edge: [[74, 83, 95], [110, 50, 12], [22, 62, 96], [86, 96, 76]]};
}

// point in millimetres to [x, y] in pixels and the distance from the viewer
function seen(x, y, z) {
  const across = turn.c * (x - CENTRE[0]) - turn.s * (y - CENTRE[1]);
  const away = turn.s * (x - CENTRE[0]) + turn.c * (y - CENTRE[1]);
  const up = (z - CENTRE[2]) * turn.level + away * turn.tilt;
  return [size[0] / 2 + scale * across, size[1] / 2 - scale * (up - turn.lift), away * turn.level - (z - CENTRE[2]) * turn.tilt];
}

const hasLid = () => show === "lid";

function frame() {
  const degree = Math.PI / 180;
  turn = {c: Math.cos(view.yaw * degree), s: Math.sin(view.yaw * degree),
    level: Math.cos(view.pitch * degree), tilt: Math.sin(view.pitch * degree)};
  const [low, high] = show === "none" ? [[0, 0, -BLACK], [LENGTH, WIDTH, TOP]] : mold.outer;
  const flat = Math.hypot(high[0] - low[0], high[1] - low[1]) * (show === "none" ? 1.12 : 1.02);
  const above = Math.max(TOP + HEAD, high[2], hasLid() ? mold.lid.outer[1][2] : -Infinity);
  turn.lift = (0.5 * (above + low[2]) - CENTRE[2]) * turn.level;
  const tall = flat * turn.tilt + (above - low[2]) * turn.level + 1;
  scale = view.zoom * Math.min(size[0] / flat, size[1] / tall);
}

function polygon(corners, fill, stroke, width) {
  pen.beginPath();
  corners.forEach(([x, y], k) => k ? pen.lineTo(x, y) : pen.moveTo(x, y));
  pen.closePath();
  if (fill) { pen.fillStyle = fill; pen.fill(); }
  if (stroke) { pen.strokeStyle = stroke; pen.lineWidth = width || 1; pen.stroke(); }
}

const facing = ([x, y]) => -(turn.s * x + turn.c * y) > 0;

// the walls that face the viewer, or the others, in runs of neighbours
function runs(front) {
  const chosen = WALLS.map(({outward}) => facing(outward) === front), found = [];
  const start = chosen.findIndex((is, k) => is && !chosen[(k + chosen.length - 1) % chosen.length]);
  if (start < 0) return chosen[0] ? [WALLS] : [];
  for (let n = 0; n < WALLS.length; n += 1) {
    const k = (start + n) % WALLS.length;
    if (!chosen[k]) continue;
    if (!chosen[(k + WALLS.length - 1) % WALLS.length]) found.push([]);
    found[found.length - 1].push(WALLS[k]);
  }
  return found;
}

// the planes of the cut, beyond which the mold is drawn: normal x and y, and limit
function planes() {
  if (!hasLid() && (show !== "cut" || view.pitch > STEEP)) return [];
  if (data.round) {
    const yaw = CUT_TURN * Math.round(view.yaw * Math.PI / 180 / CUT_TURN), x = Math.sin(yaw), y = Math.cos(yaw);
    return [[x, y, x * CENTRE[0] + y * CENTRE[1]]];
  }
  const sides = [[0, 1, 0], [-1, 0, -LENGTH], [0, -1, -WIDTH], [1, 0, 0]];
  return sides.filter(([x, y]) => facing([-x, -y]));
}

// draw the mold at screen resolution during a rotation, and smoothly at rest
function drawSolid() {
  const ratio = window.devicePixelRatio || 1, sharp = Math.min(3, 2 * ratio);
  const told = {seen, turn, planes: planes(), floor: -BLACK, looks: look.solid, width: size[0], height: size[1]};
  const picture = (hasLid() ? closed : solid)({...told, ratio: resting === "rest" ? sharp : Math.min(ratio, 1.5)});
  pen.imageSmoothingQuality = "high";
  pen.drawImage(picture, 0, 0, ...size);
}

// the inside of the cavity is visible only through the mouth of a whole mold; the tip above the rim is in front of it
function throughMouth(paint) {
  if (show === "none" || planes().length) { paint(-Infinity, Infinity); return; }
  const z = Math.max(mold.mouth.z, TOP), rim = mold.mouth.ring.map(([x, y]) => [x, y, mold.mouth.z]);
  pen.save();
  pen.beginPath();
  hull([...rim, ...crown(mold.mouth.z)].map((place) => seen(...place))).forEach(([x, y], k) => k ? pen.lineTo(x, y) : pen.moveTo(x, y));
  pen.clip();
  paint(-Infinity, z);
  pen.restore();
  drawTip(z, Infinity);
}

// points of the untouched top above a level: a crown rises above its mold
const crown = (level) => data.press.crown ? meshes[0].flatMap(({corners}) => corners.filter((place) => place[2] > level)) : [];

function drawTip(low, high) {
  const {depth} = data.states[state];
  if (depth <= 0 || hasLid()) return;
  const lift = AXES[2].map((value) => -depth * value);
  drawMesh(TIP.filter(({corners}) => { const middle = lift[2] + corners.reduce((sum, place) => sum + place[2], 0) / 4; return low <= middle && middle < high; }), lift, look.tip, 0.42, 0.4);
}

const level = (run, z) => [run[0].a, ...run.map(({b}) => b)].map(([x, y]) => seen(x, y, z));
const topOf = (run) => [run[0].a, ...run.map(({b}) => b)].map((place) => seen(...place));
function stroke(places, colour, width) {
  pen.beginPath();
  places.forEach(([x, y], k) => k ? pen.lineTo(x, y) : pen.moveTo(x, y));
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.stroke();
}
// upright lines of a run of walls: at its ends and at the outline's edges
function uprights(run, low, high) {
  const last = run[run.length - 1].b, places = [...run.filter(({isEdge}, k) => isEdge || k === 0).map(({a}) => a), last];
  for (const [x, y, z] of places) stroke([seen(x, y, low), seen(x, y, high === null ? z : high)], look.muted, 0.75);
}

function drawFloor() {
  polygon(EDGE.map(([x, y]) => seen(x, y, 0)), look.floor, look.muted, 0.75);
  for (const run of runs(true)) {
    polygon([...level(run, 0), ...level(run, -BLACK).reverse()], look.black, look.muted, 0.75);
    uprights(run, -BLACK, 0);
  }
}

function drawWalls(front) {
  for (const run of runs(front)) {
    const low = level(run, 0), high = topOf(run);
    pen.globalAlpha = front ? 0.05 : 0.12;
    polygon([...low, ...high.slice().reverse()], look.clear);
    pen.globalAlpha = front ? 0.5 : 0.8;
    stroke(low, look.muted, 0.75);
    stroke(high, look.muted, 0.75);
    uprights(run, 0, null);
    pen.globalAlpha = 1;
  }
  for (const part of data.parts) if ((part.outward !== null && facing(part.outward)) === front) drawPart(part, front);
}

function drawPart({name, kind, face, body}, front) {
  const corners = face.map((place) => seen(...place));
  const active = pair === 0 ? data.pairs.some((text) => text.split("-").includes(name)) : data.pairs[pair - 1].split("-").includes(name);
  pen.globalAlpha = (front ? 0.55 : 0.9) * (active ? 1 : 0.45);
  if (body) polygon(hull(body.map((place) => seen(...place))), look.muted, look.ink, 0.75);
  polygon(corners, kind === "emitter" ? look.ink : look.sheet, look.ink, 1);
  pen.globalAlpha = 1;
}

function drawNames() {
  const busy = data.parts.length > 40;
  const active = new Set((pair === 0 ? data.pairs : [data.pairs[pair - 1]]).flatMap((text) => text.split("-")));
  pen.font = `600 ${size[0] < 500 ? 9 : 12}px system-ui, sans-serif`;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.lineJoin = "round";
  for (const {name, at: [x, y, z], label: [ox, oy]} of data.parts) {
    if ((busy || size[0] < 600) && !active.has(name)) continue;
    const reach = 0.045 * Math.max(LENGTH, WIDTH);
    const [left, up] = seen(x + ox * reach, y + oy * reach, z);
    pen.globalAlpha = active.has(name) ? 1 : 0.55;
    pen.strokeStyle = look.sheet;
    pen.lineWidth = size[0] < 500 ? 2.5 : 3.5;
    pen.strokeText(name, left, up);
    pen.fillStyle = active.has(name) ? look.ink : look.muted;
    pen.fillText(name, left, up);
  }
  pen.globalAlpha = 1;
}

function drawRays() {
  const shown = data.states[state].rays;
  const drawn = Object.fromEntries(data.kinds.map((kind) => [kind.key, 0]));
  const order = data.kinds.map((kind, k) => k).sort((a, b) => (data.kinds[a].key === "lost" ? -1 : a) - (data.kinds[b].key === "lost" ? -1 : b));
  for (const number of order) {
    const kind = data.kinds[number];
    if (hidden.has(kind.key)) continue;
    pen.strokeStyle = pen.fillStyle = look.night ? kind.night : kind.day;
    pen.lineWidth = kind.key === "lost" ? 1.3 : 1;
    pen.setLineDash(kind.dash);
    const ranks = data.pairs.map(() => 0);
    for (const [which, whose, numbers] of shown) {
      if (which !== number || (pair > 0 && whose !== pair - 1)) continue;
      ranks[whose] += 1;
      if (pair === 0 && ranks[whose] > FEW) continue;
      drawn[kind.key] += 1;
      const places = [];
      for (let k = 0; k < numbers.length; k += 3) places.push(seen(numbers[k] / 100, numbers[k + 1] / 100, numbers[k + 2] / 100));
      pen.globalAlpha = 0.85;
      pen.beginPath();
      places.forEach(([x, y], k) => k ? pen.lineTo(x, y) : pen.moveTo(x, y));
      pen.stroke();
      drawMarks(kind.mark, places);
    }
    pen.setLineDash([]);
  }
  pen.globalAlpha = 1;
  box.dataset.drawn = JSON.stringify(drawn);
}

function drawMarks(mark, places) {
  if (mark === "none") return;
  const dash = pen.getLineDash();
  pen.setLineDash([]);
  const chosen = mark === "end" ? places.slice(-1) : places.slice(1, -1);
  for (const [x, y] of chosen) {
    pen.beginPath();
    if (mark === "mirror") { pen.moveTo(x, y - MARK); pen.lineTo(x + MARK, y + MARK); pen.lineTo(x - MARK, y + MARK); pen.fill(); }
    else if (mark === "scatter") { pen.arc(x, y, 0.7 * MARK, 0, 2 * Math.PI); pen.fill(); }
    else { pen.moveTo(x - MARK, y - MARK); pen.lineTo(x + MARK, y + MARK); pen.moveTo(x - MARK, y + MARK); pen.lineTo(x + MARK, y - MARK); pen.stroke(); }
  }
  pen.setLineDash(dash);
}

function drawMesh(mesh, lift, colour, alpha, edge) {
  const seenPieces = mesh.map(({corners, normal}) => {
    const flat = corners.map(([x, y, z]) => seen(x + lift[0], y + lift[1], z + lift[2]));
    return {flat, normal, far: flat.reduce((sum, place) => sum + place[2], 0)};
  }).sort((a, b) => b.far - a.far);
  for (const {flat, normal} of seenPieces) {
    const light = Math.abs(0.35 * normal[0] - 0.25 * normal[1] + 0.9 * normal[2]);
    pen.globalAlpha = alpha * (1.5 - light);
    polygon(flat, colour);
    pen.globalAlpha = edge;
    polygon(flat, null, colour, 0.5);
  }
  pen.globalAlpha = 1;
}

function draw() {
  waiting = false;
  const ratio = window.devicePixelRatio || 1;
  size = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = Math.max(1, Math.round(size[0] * ratio));
  canvas.height = Math.max(1, Math.round(size[1] * ratio));
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, ...size);
  colours();
  frame();
  if (show !== "none") drawSolid();
  throughMouth((low, high) => {
    drawFloor();
    drawWalls(false);
    drawTip(low, high);
    if (!hasLid()) drawRays();
    drawMesh(meshes[hasLid() ? 0 : state], [0, 0, 0], look.clear, 0.16, 0.3);
    drawWalls(true);
  });
  drawNames();
  box.dataset.mold = show;
  box.dataset.sharp = resting === "rest" ? "yes" : "no";
  Object.assign(box.dataset, {yaw: view.yaw.toFixed(1), pitch: view.pitch.toFixed(1), zoom: view.zoom.toFixed(2), state, pair});
}

function later() {
  clearTimeout(resting);
  resting = solid ? setTimeout(() => { resting = "rest"; draw(); }, SHARP_AFTER_MS) : null;
  if (!waiting) { waiting = true; requestAnimationFrame(draw); }
}

function turnBy(yaw, pitch) {
  view.yaw = ((view.yaw + yaw + 540) % 360) - 180;
  view.pitch = Math.min(90, Math.max(0, view.pitch + pitch));
  later();
}
function zoomBy(factor) {
  view.zoom = Math.min(6, Math.max(0.6, view.zoom * factor));
  later();
}
const ACTIONS = {
  left: () => turnBy(-TURN, 0), right: () => turnBy(TURN, 0), up: () => turnBy(0, TURN), down: () => turnBy(0, -TURN),
  in: () => zoomBy(ZOOM), out: () => zoomBy(1 / ZOOM), reset: () => { view = {...START}; later(); },
  side: () => { view = {...START, yaw: 0, pitch: 0}; later(); }, plan: () => { view = {...START, yaw: 0, pitch: 90}; later(); },
};
const KEYS = {ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down", "+": "in", "=": "in", "-": "out", "0": "reset", Home: "reset"};

const percent = (share) => share === null ? "" : share > 0 && share < 0.0005 ? "under 0.05 %" : `${(100 * share).toFixed(1)} %`;
function tell() {
  const shares = data.states[state].shares[pair], total = shares[data.kinds.length];
  data.kinds.forEach((kind, k) => {
    box.querySelector(`[data-share="${kind.key}"]`).textContent = percent(shares[k]);
  });
  box.querySelector("[data-total]").textContent = `${percent(total)} of ${pair ? "its" : "their"} untouched light arrives`;
}

const fingers = new Map();
canvas.addEventListener("pointerdown", (event) => {
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
  try { canvas.setPointerCapture(event.pointerId); } catch (error) { /* a pointer that is gone already */ }
});
canvas.addEventListener("pointermove", (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const now = [event.clientX, event.clientY];
  if (fingers.size === 1) {
    turnBy(0.4 * (now[0] - before[0]), 0.4 * (now[1] - before[1]));
  } else {
    const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
    const apart = (place) => Math.max(10, Math.hypot(place[0] - other[0], place[1] - other[1]));
    zoomBy(apart(now) / apart(before));
  }
  fingers.set(event.pointerId, now);
});
for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
  canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
}
canvas.addEventListener("wheel", (event) => {
  if (!event.ctrlKey) return;
  event.preventDefault();
  zoomBy(event.deltaY < 0 ? ZOOM : 1 / ZOOM);
}, {passive: false});
canvas.addEventListener("keydown", (event) => {
  const action = KEYS[event.key];
  if (!action || event.altKey || event.ctrlKey || event.metaKey) return;
  event.preventDefault();
  ACTIONS[action]();
});
box.addEventListener("click", (event) => {
  const button = event.target.closest("button[data-do]");
  if (button) ACTIONS[button.dataset.do]();
});
box.addEventListener("change", (event) => {
  const {name, value, checked} = event.target;
  if (name === "rays-press") state = Number(value);
  if (name === "rays-pair") pair = Number(value);
  if (name === "rays-mold") show = value;
  if (name === "rays-kind") { if (checked) hidden.delete(value); else hidden.add(value); }
  tell();
  later();
});
// a browser keeps choices over a reload: apply them
for (const input of box.querySelectorAll("input[name=rays-kind]")) if (!input.checked) hidden.add(input.value);
state = Number((box.querySelector("input[name=rays-press]:checked") || {value: 0}).value);
const chosen = box.querySelector("select[name=rays-pair]");
if (chosen) pair = Number(chosen.value);
const moldChoice = box.querySelector("input[name=rays-mold]:checked");
if (moldChoice) show = moldChoice.value;

optopadTheme.onChange(later);
window.addEventListener("beforeprint", () => { printing = true; draw(); });
window.addEventListener("afterprint", () => { printing = false; draw(); });
if (window.ResizeObserver) new ResizeObserver(later).observe(canvas); else window.addEventListener("resize", later);
box.hidden = false;
document.getElementById("rays-still").classList.add("replaced");
tell();
resting = "rest";
draw();
box.dataset.ready = "yes";
})();
