// The pad in space: its walls, and its top and the tip under each press, as pieces with four corners.
const optopadPad = (data) => {
"use strict";
const SECTORS = 40;
// sharper angles of the outline are edges [radians]
const CORNER = 0.35;
// the outline counter-clockwise, and its walls: two ends with the heights of their top, outward normal, and whether the
// outline has an edge at the start of the wall
const EDGE = data.edge;
const WALLS = EDGE.map((a, k) => {
  const b = EDGE[(k + 1) % EDGE.length], before = EDGE[(k + EDGE.length - 1) % EDGE.length];
  const run = Math.hypot(b[0] - a[0], b[1] - a[1]), outward = [(b[1] - a[1]) / run, (a[0] - b[0]) / run];
  const turned = Math.atan2(b[1] - a[1], b[0] - a[0]) - Math.atan2(a[1] - before[1], a[0] - before[0]);
  return {a, b, outward, isEdge: Math.abs(Math.atan2(Math.sin(turned), Math.cos(turned))) > CORNER};
});
const inPlan = (x, y) => WALLS.every(({a, outward}) => (x - a[0]) * outward[0] + (y - a[1]) * outward[1] <= 1e-9);

// the frame of the presses: points of the top by coordinates along its two axes and height over the untouched top
const {origin: ORIGIN, axes: AXES, crown: CROWN, along: ALONG} = data.press;
const inFrame = (u, v, w) => ORIGIN.map((value, k) => value + u * AXES[0][k] + v * AXES[1][k] + w * AXES[2][k]);
const seenFromIt = (place) => AXES.map((axis) => axis.reduce((sum, value, k) => sum + value * (place[k] - ORIGIN[k]), 0));
function fallen(u, v) {
  if (!CROWN) return 0;
  const square = Math.min(ALONG * u * u + v * v, CROWN * CROWN);
  return square / (CROWN + Math.sqrt(CROWN * CROWN - square));
}
const onTop = (u, v, height) => inFrame(u, v, height - fallen(u, v));

// directions of the mesh around the press: even ones, and those of the outline's edges, so that its rim is the pad's
const DIRECTIONS = (() => {
  const even = Array.from({length: SECTORS}, (_, k) => 2 * Math.PI * k / SECTORS - Math.PI);
  const corners = WALLS.filter(({isEdge}) => isEdge).map(({a}) => { const [u, v] = seenFromIt(a); return Math.atan2(v, u); });
  return [...even, ...corners].sort((a, b) => a - b);
})();
const REACH = Math.max(...EDGE.map((place) => { const [u, v] = seenFromIt(place); return Math.hypot(u, v); }));

// points of the top from the press to the rim in one direction
function spokeOf(angle, rings, curve) {
  const c = Math.cos(angle), s = Math.sin(angle), found = [];
  let before = 0;
  for (const [r, z] of rings) {
    const place = onTop(r * c, r * s, z);
    if (r > 0 && !inPlan(place[0], place[1])) {
      let low = before, high = r;
      for (let k = 0; k < 40; k += 1) {
        const middle = (low + high) / 2, [x, y] = onTop(middle * c, middle * s, heightAt(curve, middle));
        if (inPlan(x, y)) low = middle; else high = middle;
      }
      const rim = onTop(low * c, low * s, heightAt(curve, low));
      while (found.length < rings.length) found.push(rim);
      return found;
    }
    found.push(place);
    before = r;
  }
  return found;
}

function heightAt(curve, radius) {
  for (let k = curve.length - 1; k > 0; k -= 1) {
    const [r0, z0] = curve[k - 1], [r1, z1] = curve[k];
    if (r0 <= radius && radius <= r1) return r1 > r0 ? z0 + (z1 - z0) * (radius - r0) / (r1 - r0) : z1;
  }
  return 0;
}

// four-cornered pieces of the top, each by its corners in the block's frame
const meshes = data.states.map(({curve}) => {
  const rings = curve.length ? curve.slice() : [[0, 0]];
  for (let last = rings[rings.length - 1][0]; last < 1.05 * REACH;) { last += REACH / 10; rings.push([last, 0]); }
  return pieces(DIRECTIONS.map((angle) => spokeOf(angle, rings, curve)));
});
const TIP = pieces(Array.from({length: 28}, (_, k) => data.tip.map(([r, z]) => inFrame(r * Math.cos(2 * Math.PI * k / 28), r * Math.sin(2 * Math.PI * k / 28), z))));

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

// the convex hull of points on the screen (Andrew 1979)
function hull(places) {
  const sorted = places.slice().sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (row) => row.reduce((kept, p) => {
    while (kept.length > 1) {
      const [a, b] = kept.slice(-2);
      if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
      kept.pop();
    }
    return [...kept, p];
  }, []).slice(0, -1);
  return [...half(sorted), ...half(sorted.slice().reverse())];
}

return {edge: EDGE, walls: WALLS, axes: AXES, meshes, tip: TIP, hull};
};
