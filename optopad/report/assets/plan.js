// The pad from above, in a drawing whose y runs downward: a rectangle, or a disc with a facet for each part.
const optopadPlan = (pad, draw) => {
"use strict";
const {length, width, space, outline} = pad;
const up = (y) => width - y;
const plan = {
  outline(look) {
    if (outline) draw("polygon", {...look, points: outline.map(([x, y]) => `${x},${up(y)}`).join(" ")});
    else draw("rect", {...look, x: 0, y: 0, width: length, height: width});
    return plan;
  },
  workspace(look) {
    const [x0, x1, y0, y1] = space;
    if (outline) draw("circle", {...look, cx: (x0 + x1) / 2, cy: up((y0 + y1) / 2), r: (x1 - x0) / 2});
    else draw("rect", {...look, x: x0, y: up(y1), width: x1 - x0, height: y1 - y0});
    return plan;
  },
};
return plan;
};
