// Draws closed meshes with a depth buffer, in parallel projection, without a graphics card: mold and bodies of parts.
// Walls that face the viewer can be cut away; the visible inside of a mesh in the cut is drawn as its section.
const optopadSolid = (() => {
"use strict";
const LIGHTS = [[0.35, 0.25, 0.90, 0.62], [-0.80, 0.45, 0.40, 0.30]];
const AMBIENT = 0.34, NEARER_MM = 0.12;

function numbers(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Kind(bytes.buffer);
}

// p: the eight corners, base before top, each counter-clockwise from above
function boxOf(p) {
  const quads = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
  const edges = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
  return {
    faces: quads.flatMap(([a, b, c, d]) => [[p[a], p[b], p[c]], [p[a], p[c], p[d]]]),
    edges: edges.map(([a, b]) => [p[a], p[b]]),
  };
}

function addMesh(mesh, material, faces, edges) {
  const points = numbers(mesh.points, Uint16Array), triangles = numbers(mesh.triangles, Uint32Array);
  const creases = numbers(mesh.creases, Uint32Array);
  const place = (k) => [0, 1, 2].map((axis) => mesh.low[axis] + mesh.step * points[3 * k + axis]);
  for (let k = 0; k < triangles.length; k += 3) faces.push([[0, 1, 2].map((n) => place(triangles[k + n])), material]);
  for (let k = 0; k < creases.length; k += 2) edges.push([[place(creases[k]), place(creases[k + 1])], material]);
}

// faces and edges of all bodies, each with the number of its material: 0 mold, 1 emitter, 2 receiver, 3 lid
function gathered(data, lid) {
  const faces = [], edges = [];
  addMesh(data, 0, faces, edges);
  if (lid) addMesh(lid, 3, faces, edges);
  for (const [kind, corners] of data.bodies) {
    const box = boxOf(corners), material = kind === "emitter" ? 1 : 2;
    for (const face of box.faces) faces.push([face, material]);
    for (const edge of box.edges) edges.push([edge, material]);
  }
  return {faces: faces.map(([corners, material]) => ({corners, material, normal: normalOf(corners)})), edges};
}

function normalOf([a, b, c]) {
  const u = b.map((value, axis) => value - a[axis]), v = c.map((value, axis) => value - a[axis]);
  const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const length = Math.hypot(...n) || 1;
  return n.map((value) => value / length);
}

// the part of a polygon or line where a point, by its weights, is beyond a limit
function halfOf(corners, [wx, wy, wz], limit) {
  const found = [], closed = corners.length > 2, beyond = ([x, y, z]) => wx * x + wy * y + wz * z - limit;
  corners.forEach((corner, k) => {
    if (!closed && k === corners.length - 1) { if (beyond(corner) >= 0) found.push(corner); return; }
    const next = corners[(k + 1) % corners.length];
    const here = beyond(corner), there = beyond(next);
    if (here >= 0) found.push(corner);
    if ((here > 0 && there < 0) || (here < 0 && there > 0)) {
      const share = here / (here - there);
      found.push(corner.map((value, n) => value + share * (next[n] - value)));
    }
  });
  return found;
}

// what remains of a polygon without the part before the upright planes (normal x, y, and limit) and above a floor
function cutBy(corners, planes, floor) {
  const low = halfOf(corners, [0, 0, -1], -floor);
  const high = planes.reduce((rest, [x, y, limit]) => rest.length ? halfOf(rest, [x, y, 0], limit) : rest, halfOf(corners, [0, 0, 1], floor));
  return [low, high].filter((part) => part.length > 1);
}

return (data, lid) => {
  const whole = gathered(data, lid), cuts = new Map();
  const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
  let image = null, pixels = null, far = null;

  function remaining(planes, floor) {
    const key = JSON.stringify([planes, floor]);
    if (!cuts.has(key)) {
      const faces = whole.faces.flatMap((face) => cutBy(face.corners, planes, floor)
        .filter((corners) => corners.length > 2).map((corners) => ({...face, corners})));
      const edges = whole.edges.flatMap(([ends, material]) => cutBy(ends, planes, floor).map((rest) => [rest, material]));
      cuts.set(key, {faces, edges});
    }
    return cuts.get(key);
  }

  function sized(width, height) {
    if (canvas.width !== width || canvas.height !== height || !image) {
      canvas.width = width;
      canvas.height = height;
      image = pen.createImageData(width, height);
      pixels = new Uint32Array(image.data.buffer);
      far = new Float32Array(width * height);
    }
    pixels.fill(0);
    far.fill(Infinity);
  }

  function fill(a, b, c, colour) {
    const area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if (Math.abs(area) < 1e-9) return;
    const width = canvas.width, height = canvas.height;
    const x0 = Math.max(0, Math.floor(Math.min(a[0], b[0], c[0]))), x1 = Math.min(width - 1, Math.ceil(Math.max(a[0], b[0], c[0])));
    const y0 = Math.max(0, Math.floor(Math.min(a[1], b[1], c[1]))), y1 = Math.min(height - 1, Math.ceil(Math.max(a[1], b[1], c[1])));
    const ux = (b[1] - c[1]) / area, uy = (c[0] - b[0]) / area, vx = (c[1] - a[1]) / area, vy = (a[0] - c[0]) / area;
    const zx = ux * a[2] + vx * b[2] - (ux + vx) * c[2], slack = -1e-6;
    for (let y = y0; y <= y1; y += 1) {
      let u = ux * (x0 + 0.5 - c[0]) + uy * (y + 0.5 - c[1]), v = vx * (x0 + 0.5 - c[0]) + vy * (y + 0.5 - c[1]);
      let z = u * a[2] + v * b[2] + (1 - u - v) * c[2];
      for (let k = y * width + x0; k <= y * width + x1; k += 1) {
        if (u >= slack && v >= slack && u + v <= 1 - slack && z < far[k]) { far[k] = z; pixels[k] = colour; }
        u += ux; v += vx; z += zx;
      }
    }
  }

  function line(a, b, colour, wide) {
    const steps = Math.ceil(Math.max(Math.abs(b[0] - a[0]), Math.abs(b[1] - a[1]))) + 1;
    for (let k = 0; k <= steps; k += 1) {
      const t = k / steps, x = Math.floor(a[0] + t * (b[0] - a[0])), y = Math.floor(a[1] + t * (b[1] - a[1])), z = a[2] + t * (b[2] - a[2]) - NEARER_MM;
      for (let n = 0; n < wide; n += 1) {
        for (const at of [[x + n, y], [x, y + n]]) {
          if (at[0] < 0 || at[1] < 0 || at[0] >= canvas.width || at[1] >= canvas.height) continue;
          const place = at[1] * canvas.width + at[0];
          if (z <= far[place]) pixels[place] = colour;
        }
      }
    }
  }

  const packed = ([r, g, b], light) => {
    const byte = (value) => Math.max(0, Math.min(255, Math.round(value * light)));
    return (255 << 24 | byte(b) << 16 | byte(g) << 8 | byte(r)) >>> 0;
  };

  // seen: point to [x, y, distance from the viewer]; turn: cosines and sines of yaw and pitch; looks: colours of the
  // materials, their sections and edges; returns a canvas of width x height times ratio
  return ({seen, turn, planes, floor, looks, width, height, ratio}) => {
    sized(Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio)));
    const scaled = (place) => { const [x, y, z] = seen(...place); return [x * ratio, y * ratio, z]; };
    const {faces, edges} = planes.length ? remaining(planes, floor) : whole;
    for (const {corners, normal: [nx, ny, nz], material} of faces) {
      const right = turn.c * nx - turn.s * ny, back = turn.s * nx + turn.c * ny;
      const view = [right, nz * turn.level + back * turn.tilt, nz * turn.tilt - back * turn.level];
      let colour = packed(looks.section[material], 1);
      if (view[2] > 0) {
        let light = AMBIENT;
        for (const [x, y, z, strength] of LIGHTS) light += strength * Math.max(0, (view[0] * x + view[1] * y + view[2] * z) / Math.hypot(x, y, z));
        colour = packed(looks.body[material], light);
      } else if (!planes.length) continue;
      const flat = corners.map(scaled);
      for (let k = 2; k < flat.length; k += 1) fill(flat[0], flat[k - 1], flat[k], colour);
    }
    const wide = Math.max(1, Math.round(ratio));
    for (const [[a, b], material] of edges) line(scaled(a), scaled(b), packed(looks.edge[material], 1), wide);
    pen.putImageData(image, 0, 0);
    return canvas;
  };
};
})();
