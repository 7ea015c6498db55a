// A shape of a drawing, with its attributes and its text.
const optopadDrawn = (parent, tag, attributes, text) => {
"use strict";
const made = document.createElementNS(parent.namespaceURI, tag);
for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
if (text !== undefined) made.textContent = text;
parent.append(made);
return made;
};

// Slanted lines that fill a shape, by name: their distance, and their width if it is not the page's.
const optopadHatch = (parent, id, apart, style) => {
"use strict";
const pattern = optopadDrawn(optopadDrawn(parent, "defs", {}), "pattern", {id, width: apart, height: apart, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)"});
optopadDrawn(pattern, "line", {class: "hatch", x1: 0, x2: 0, y1: 0, y2: apart, ...(style ? {style} : {})});
};

// The pad, its workspace and its parts from above, in a drawing whose y runs downward.
const optopadPlan = (pad, parent) => {
"use strict";
const up = (y) => pad.width - y;
const draw = (tag, attributes) => optopadDrawn(parent, tag, attributes);
const polygon = (corners, look) => draw("polygon", {...look, points: corners.map(([x, y]) => `${x},${up(y)}`).join(" ")});
const plan = {
  outline(look) { polygon(pad.outline, look); return plan; },
  workspace(look) { polygon(pad.space, look); return plan; },
  part([, kind, x, y], half, look) {
    const named = {class: `part ${kind}${look}`};
    if (kind === "emitter") draw("circle", {...named, cx: x, cy: up(y), r: half});
    else draw("rect", {...named, x: x - half, y: up(y) - half, width: 2 * half, height: 2 * half});
    return plan;
  },
};
return plan;
};

// An empty drawing of the pad from above, with room around it [mm] and its title.
const optopadSheet = (drawing, pad, room, title) => {
"use strict";
drawing.replaceChildren();
drawing.setAttribute("viewBox", `${-room} ${-room} ${pad.length + 2 * room} ${pad.width + 2 * room}`);
optopadDrawn(drawing, "title", {}, title);
};
