// Turns the pad of the report in three dimensions: mold, block, parts, deformed top, tip, and sample paths of light.
// Orthographic, seen from above or from the side; far things first, so that near ones cover them. What lies in the
// cavity is seen past the walls that are cut away, or through the mold's mouth.
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
const solid = mold ? optopadSolid(mold) : null;
const START = {yaw: -32, pitch: 24, zoom: 1};
const TURN = 6, ZOOM = 1.15, SECTORS = 40, MARK = 2.2;
// lines of a pair and kind when all pairs are shown
const FEW = Math.max(4, Math.round(36 / data.pairs.length));
const [LENGTH, WIDTH, TOP, BLACK] = data.box;
const CENTRE = [LENGTH / 2, WIDTH / 2, TOP / 2];
const TIP_TOP = data.tip[data.tip.length - 1][1];
const HEAD = Math.max(0.9 * data.tip[data.tip.length - 1][0], 1);
// walls stay where they are seen from so steep that they hide nothing
const STEEP = 76, SHARP_AFTER_MS = 160;
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
    ? {body: [[98, 108, 121], [214, 111, 44], [58, 128, 184]], section: [[52, 59, 68], [122, 58, 18], [26, 66, 100]], edge: [[24, 28, 33], [60, 28, 8], [12, 32, 50]]}
    : {body: [[176, 187, 201], [230, 126, 60], [88, 158, 214]], section: [[128, 138, 152], [178, 84, 26], [42, 104, 156]], edge: [[74, 83, 95], [110, 50, 12], [22, 62, 96]]};
}

// place in millimetres to [x, y] in pixels and the distance away from the onlooker
function seen(x, y, z) {
  const across = turn.c * (x - CENTRE[0]) - turn.s * (y - CENTRE[1]);
  const away = turn.s * (x - CENTRE[0]) + turn.c * (y - CENTRE[1]);
  const up = (z - CENTRE[2]) * turn.level + away * turn.tilt;
  return [size[0] / 2 + scale * across, size[1] / 2 - scale * (up - turn.lift), away * turn.level - (z - CENTRE[2]) * turn.tilt];
}

function frame() {
  const degree = Math.PI / 180;
  turn = {c: Math.cos(view.yaw * degree), s: Math.sin(view.yaw * degree),
    level: Math.cos(view.pitch * degree), tilt: Math.sin(view.pitch * degree)};
  const [low, high] = show === "none" ? [[0, 0, -BLACK], [LENGTH, WIDTH, TOP]] : mold.outer;
  const flat = Math.hypot(high[0] - low[0], high[1] - low[1]) * (show === "none" ? 1.12 : 1.02);
  const above = Math.max(TOP + HEAD, high[2]);
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

// walls by name: the two ends of each, and how far its outward normal points at the onlooker
const WALLS = {south: [[0, 0], [LENGTH, 0]], east: [[LENGTH, 0], [LENGTH, WIDTH]],
  north: [[0, WIDTH], [LENGTH, WIDTH]], west: [[0, 0], [0, WIDTH]]};
const OUTWARD = {south: [0, -1], east: [1, 0], north: [0, 1], west: [-1, 0]};
const faces = (wall) => -(turn.s * OUTWARD[wall][0] + turn.c * OUTWARD[wall][1]) > 0;

// the planes that the cut leaves the far side of: axis, place, and the sign of the side that stays
function planes() {
  if (show !== "cut" || view.pitch > STEEP) return [];
  return Object.entries(WALLS).filter(([wall]) => faces(wall)).map(([wall]) => {
    const [ox, oy] = OUTWARD[wall], axis = ox ? 0 : 1, sign = -(ox || oy);
    return [axis, sign > 0 ? 0 : (axis ? WIDTH : LENGTH), sign];
  });
}

// the mold at once in the pixels of the screen while it turns, smooth when it rests
function drawSolid() {
  const ratio = window.devicePixelRatio || 1, sharp = Math.min(3, 2 * ratio);
  const told = {seen, turn, planes: planes(), floor: -BLACK, looks: look.solid, width: size[0], height: size[1]};
  const picture = solid({...told, ratio: resting === "rest" ? sharp : Math.min(ratio, 1.5)});
  pen.imageSmoothingQuality = "high";
  pen.drawImage(picture, 0, 0, ...size);
}

// what is in the cavity is seen through the mouth of a whole mold only; the tip above the rim is in front of it
function throughMouth(paint) {
  if (show === "none" || planes().length) { paint(-Infinity, Infinity); return; }
  const [x0, x1, y0, y1, z] = mold.mouth;
  pen.save();
  pen.beginPath();
  [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].forEach(([x, y], k) => { const [a, b] = seen(x, y, z); if (k) pen.lineTo(a, b); else pen.moveTo(a, b); });
  pen.clip();
  paint(-Infinity, z);
  pen.restore();
  drawTip(z, Infinity);
}

function drawTip(low, high) {
  const {depth} = data.states[state], lift = TOP - depth;
  if (depth <= 0) return;
  drawMesh(TIP.filter(({corners}) => { const middle = lift + corners.reduce((sum, place) => sum + place[2], 0) / 4; return low <= middle && middle < high; }), lift, look.tip, 0.42, 0.4);
}

function drawFloor() {
  const floor = [[0, 0], [LENGTH, 0], [LENGTH, WIDTH], [0, WIDTH]];
  polygon(floor.map(([x, y]) => seen(x, y, 0)), look.floor, look.muted, 0.75);
  for (const [wall, [a, b]] of Object.entries(WALLS)) {
    if (faces(wall)) {
      polygon([seen(...a, 0), seen(...b, 0), seen(...b, -BLACK), seen(...a, -BLACK)], look.black, look.muted, 0.75);
    }
  }
}

function drawWalls(front) {
  for (const [wall, [a, b]] of Object.entries(WALLS)) {
    if (faces(wall) !== front) continue;
    pen.globalAlpha = front ? 0.05 : 0.12;
    polygon([seen(...a, 0), seen(...b, 0), seen(...b, TOP), seen(...a, TOP)], look.clear);
    pen.globalAlpha = front ? 0.5 : 0.8;
    polygon([seen(...a, 0), seen(...b, 0), seen(...b, TOP), seen(...a, TOP)], null, look.muted, 0.75);
    pen.globalAlpha = 1;
    for (const part of data.parts) if (part[2] === wall) drawPart(part, front);
  }
}

function onWall(wall, along, z) {
  return wall === "south" ? [along, 0, z] : wall === "north" ? [along, WIDTH, z]
    : wall === "west" ? [0, along, z] : [LENGTH, along, z];
}

function drawPart([name, kind, wall, along, height, half, tall], front) {
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([u, v]) => seen(...onWall(wall, along + u * half, height + v * tall)));
  const active = pair === 0 ? data.pairs.some((text) => text.split("-").includes(name)) : data.pairs[pair - 1].split("-").includes(name);
  pen.globalAlpha = (front ? 0.55 : 0.9) * (active ? 1 : 0.45);
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
  for (const [name, , wall, along, height] of data.parts) {
    if ((busy || size[0] < 600) && !active.has(name)) continue;
    const [x, y, z] = onWall(wall, along, height), [ox, oy] = OUTWARD[wall];
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

// directions of the mesh around the press: even ones, and those of the corners, so that the rim is the block's
const [PX, PY] = data.place;
const DIRECTIONS = (() => {
  const even = Array.from({length: SECTORS}, (_, k) => 2 * Math.PI * k / SECTORS - Math.PI);
  const corners = [[0, 0], [LENGTH, 0], [LENGTH, WIDTH], [0, WIDTH]].map(([x, y]) => Math.atan2(y - PY, x - PX));
  return [...even, ...corners].sort((a, b) => a - b);
})();
function toRim(angle) {
  const c = Math.cos(angle), s = Math.sin(angle), free = Infinity;
  const x = c > 1e-12 ? (LENGTH - PX) / c : c < -1e-12 ? -PX / c : free;
  const y = s > 1e-12 ? (WIDTH - PY) / s : s < -1e-12 ? -PY / s : free;
  return Math.min(x, y);
}

function heightAt(curve, radius) {
  for (let k = curve.length - 1; k > 0; k -= 1) {
    const [r0, z0] = curve[k - 1], [r1, z1] = curve[k];
    if (r0 <= radius && radius <= r1) return r1 > r0 ? z0 + (z1 - z0) * (radius - r0) / (r1 - r0) : z1;
  }
  return 0;
}

// four-cornered pieces of the top: each its corners in the block's frame
const meshes = data.states.map(({curve}) => {
  const reach = Math.max(...DIRECTIONS.map(toRim)), rings = curve.length ? curve.slice() : [[0, 0]];
  for (let last = rings[rings.length - 1][0]; last < reach;) { last += reach / 10; rings.push([last, 0]); }
  const spokes = DIRECTIONS.map((angle) => {
    const rim = toRim(angle), c = Math.cos(angle), s = Math.sin(angle);
    return rings.map(([r, z]) => r <= rim ? [PX + r * c, PY + r * s, TOP + z] : [PX + rim * c, PY + rim * s, TOP + heightAt(curve, rim)]);
  });
  return pieces(spokes);
});
const TIP = pieces(Array.from({length: 28}, (_, k) => data.tip.map(([r, z]) => [PX + r * Math.cos(2 * Math.PI * k / 28), PY + r * Math.sin(2 * Math.PI * k / 28), z])));

function pieces(spokes) {
  const found = [];
  spokes.forEach((spoke, k) => {
    const next = spokes[(k + 1) % spokes.length];
    for (let n = 1; n < spoke.length; n += 1) {
      const corners = [spoke[n - 1], spoke[n], next[n], next[n - 1]];
      const u = corners[2].map((value, axis) => value - corners[0][axis]), v = corners[3].map((value, axis) => value - corners[1][axis]);
      const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      const length = Math.hypot(...normal);
      if (length > 1e-9) found.push({corners, normal: normal.map((value) => value / length)});
    }
  });
  return found;
}

function drawMesh(mesh, lift, colour, alpha, edge) {
  const seenPieces = mesh.map(({corners, normal}) => {
    const flat = corners.map(([x, y, z]) => seen(x, y, z + lift));
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
    drawRays();
    drawMesh(meshes[state], 0, look.clear, 0.16, 0.3);
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
// a browser keeps choices over a reload: follow them
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
