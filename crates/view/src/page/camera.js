// The camera of the page: vectors, moves, projection, and the cross of axes.
"use strict";

// ── vectors ──

const add = (a, b, k = 1) => a.map((x, i) => x + k * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length = (a) => Math.hypot(...a);
const unit = (a) => a.map((x) => x / (length(a) || 1));
// Rodrigues' rotation about a unit axis.
function turn(v, axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return add(add(v.map((x) => x * c), cross(axis, v), s), axis, dot(axis, v) * (1 - c));
}

// ── camera ──

function moved() {
  touched = performance.now();
  unmark();
  axes();
  sendLook();
}

// Turns the camera about a point: left and right about the vertical axis, up and down to the poles at most.
function orbit(dx, dy, about = look?.target) {
  if (!look) return;
  const axis = [0, 1, 0];
  const spin = (v) => turn(v, axis, -dx);
  const back = spin(unit(add(look.position, look.target, -1)));
  const right = unit(cross(spin(unit(look.up)), back));
  const tilt = (v) => turn(v, right, -dy);
  const high = Math.abs(dot(tilt(back), axis));
  const tilts = high < 0.999 || high < Math.abs(dot(back, axis));
  const whole = (v) => (tilts ? tilt(spin(v)) : spin(v));
  const moves = (p) => add(about, whole(add(p, about, -1)));
  const [position, target] = [moves(look.position), moves(look.target)];
  // Up is made perpendicular to the view, so that a camera without roll keeps its horizon.
  const along = unit(add(position, target, -1)), up = whole(unit(look.up));
  look = { ...look, position, target, up: unit(add(up, along, -dot(up, along))) };
  moved();
}

// The point about which a drag turns: the surface under the pointer, else the middle of the scene if it is in front.
async function grasped(pixel) {
  if (!look) return null;
  const surface = pixel && (await asked("pixel", pixel))?.surface;
  if (surface?.object) return surface.position;
  const middle = facts?.bounds && add(facts.bounds[0], facts.bounds[1]).map((x) => x / 2);
  const ahead = middle && dot(add(middle, look.position, -1), add(look.target, look.position, -1)) > 0;
  return ahead ? middle : look.target;
}

// Tangents of half the horizontal and vertical field of view.
function tangents() {
  const tan = Math.tan(((look.fov ?? 40) * Math.PI) / 360);
  return [tan * (head.frame[0] / head.frame[1]), tan];
}

// Turns the camera to the middle of a box, from the same side, and lets the box fill the picture.
function frameBox(bounds) {
  if (!look || !head) return;
  const [low, high] = bounds, middle = add(low, high).map((x) => x / 2);
  const radius = length(add(high, low, -1)) / 2;
  if (!(radius > 0)) return;
  const back = unit(add(look.position, look.target, -1));
  const half = Math.atan(Math.min(...tangents()));
  look = { ...look, position: add(middle, back, radius / Math.sin(half)), target: middle };
  if (look.height) look.height = 2 * radius * Math.max(1, head.frame[1] / head.frame[0]);
  moved();
}

async function frameObject() {
  const object = hovered && (await asked("object", hovered));
  if (!object) return toast("There is no object under the pointer");
  frameBox(object.bounds);
  toast(object.name || "Framed");
}

// Looks at the same point along an axis, from its positive or its negative end.
function viewAlong(axis, sign) {
  if (!look) return;
  const back = [0, 0, 0];
  back[axis] = sign;
  const far = length(add(look.position, look.target, -1));
  look = { ...look, position: add(look.target, back, far), up: axis === 1 ? [0, 0, -sign] : [0, 1, 0] };
  moved();
}

// A point of the scene in the picture, as shares of its width and height; null behind the camera.
function projected(p) {
  const back = unit(add(look.position, look.target, -1)), right = unit(cross(look.up, back)), up = cross(back, right);
  const to = add(p, look.position, -1), depth = -dot(to, back);
  if (!(depth > 0)) return null;
  const [wide, high] = look.height
    ? [(look.height * head.frame[0]) / head.frame[1] / 2, look.height / 2]
    : tangents().map((tan) => tan * depth);
  return [0.5 + dot(to, right) / (2 * wide), 0.5 - dot(to, up) / (2 * high)];
}

// ── axes ──

const SIDES = [["X", "from the side"], ["Y", "from the top"], ["Z", "from the front"]];

function svg(name, of, text) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const key in of) node.setAttribute(key, of[key]);
  if (text !== undefined) node.textContent = text;
  return node;
}

// Draws the cross of axes in the corner, those that point away from the camera first.
function axes() {
  if (!look) return;
  const back = unit(add(look.position, look.target, -1)), right = unit(cross(look.up, back)), up = cross(back, right);
  const order = [0, 1, 2].sort((i, j) => back[i] - back[j]);
  for (const i of order) {
    const group = $("axes").querySelector(`[data-axis="${i}"]`), [x, y] = [24 * right[i], -24 * up[i]];
    const [line, disc, label] = group.children;
    for (const [name, value] of [["x2", x], ["y2", y]]) line.setAttribute(name, value);
    for (const [name, value] of [["cx", x], ["cy", y]]) disc.setAttribute(name, value);
    for (const [name, value] of [["x", x], ["y", y + 3.5]]) label.setAttribute(name, value);
    if (order.indexOf(i) !== [...$("axes").children].indexOf(group)) $("axes").append(group);
  }
}

function makeAxes() {
  SIDES.forEach(([name, from], i) => {
    const group = svg("g", { "data-axis": i, role: "button", tabindex: 0, "aria-label": `View ${from}` });
    group.append(svg("line", { x1: 0, y1: 0 }), svg("circle", { r: 7 }), svg("text", { "text-anchor": "middle" }, name));
    group.append(svg("title", {}, `View ${from} (${name})`));
    const go = (event) => {
      event.stopPropagation();
      viewAlong(i, event.shiftKey ? -1 : 1);
    };
    group.addEventListener("click", go);
    group.addEventListener("keydown", (event) => event.key === "Enter" && go(event));
    $("axes").append(group);
  });
  $("axes").addEventListener("pointerdown", (event) => event.stopPropagation());
}

function shift(dx, dy) {
  if (!look || !head) return;
  const offset = add(look.position, look.target, -1), back = unit(offset);
  const right = unit(cross(look.up, back)), up = cross(back, right);
  const height = look.height ?? 2 * length(offset) * Math.tan(((look.fov ?? 40) * Math.PI) / 360);
  const step = height / fitted().h;
  const by = add(right.map((x) => -dx * step * x), up, dy * step);
  look = { ...look, position: add(look.position, by), target: add(look.target, by) };
  moved();
}

function dolly(amount) {
  if (!look) return;
  const offset = add(look.position, look.target, -1), factor = Math.exp(amount);
  const least = facts?.bounds ? 1e-4 * length(add(facts.bounds[1], facts.bounds[0], -1)) : 1e-6;
  if (length(offset) * factor < least) return;
  look = { ...look, position: add(look.target, offset, factor) };
  if (look.height) look.height *= factor;
  moved();
}
