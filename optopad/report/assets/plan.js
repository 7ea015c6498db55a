// The pad and its workspace from above, in a drawing whose y runs downward.
const optopadPlan = (pad, draw) => {
"use strict";
const {width, space, outline} = pad;
const polygon = (corners, look) =>
  draw("polygon", {...look, points: corners.map(([x, y]) => `${x},${width - y}`).join(" ")});
const plan = {
  outline(look) { polygon(outline, look); return plan; },
  workspace(look) { polygon(space, look); return plan; },
};
return plan;
};
