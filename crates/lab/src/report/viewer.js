// Turns the list of figures into a viewer: one picture at a time, in the same place, at the same zoom.
"use strict";
const viewer = document.getElementById("viewer");
const stage = viewer.querySelector(".stage");
const figures = [...stage.querySelectorAll("figure")];
const unique = (key) => [...new Set(figures.map((f) => f.dataset[key]).filter((v) => v !== undefined))];
const state = { picture: figures[0].dataset.picture, stops: undefined, zoom: 1, x: 0, y: 0 };
state.stops = unique("stops").includes("0") ? "0" : unique("stops")[0];

function bar(key, values, label) {
  const row = document.createElement("div");
  row.className = "bar";
  for (const value of values) {
    const button = document.createElement("button");
    button.textContent = label(value);
    button.dataset.value = value;
    button.onclick = () => { state[key] = value; show(); };
    row.append(button);
  }
  stage.before(row);
  return { row, key };
}
const bars = [bar("picture", unique("picture"), (v) => v)];
if (unique("stops").length > 1) bars.push(bar("stops", unique("stops"), (v) => (v > 0 ? "+" : "") + v + " stops"));

function show() {
  for (const f of figures) {
    const here = f.dataset.picture === state.picture;
    f.classList.toggle("shown", here && (f.dataset.stops === undefined || f.dataset.stops === state.stops));
    f.querySelector("img").style.transform = `translate(${state.x}px, ${state.y}px) scale(${state.zoom})`;
  }
  for (const { row, key } of bars)
    for (const b of row.children) b.setAttribute("aria-pressed", String(b.dataset.value === state[key]));
}

// The place under the pointer stays where it is.
stage.addEventListener("wheel", (e) => {
  e.preventDefault();
  const box = stage.getBoundingClientRect();
  const zoom = Math.min(64, Math.max(1, state.zoom * 2 ** (-e.deltaY / 300)));
  const [px, py] = [e.clientX - box.left, e.clientY - box.top];
  state.x = px - (px - state.x) * zoom / state.zoom;
  state.y = py - (py - state.y) * zoom / state.zoom;
  state.zoom = zoom;
  if (zoom === 1) state.x = state.y = 0;
  show();
}, { passive: false });
stage.addEventListener("pointerdown", (e) => stage.setPointerCapture(e.pointerId));
stage.addEventListener("pointermove", (e) => {
  if (e.buttons & 1) { state.x += e.movementX; state.y += e.movementY; show(); }
});
stage.addEventListener("dblclick", () => { Object.assign(state, { zoom: 1, x: 0, y: 0 }); show(); });
stage.addEventListener("dragstart", (e) => e.preventDefault());
addEventListener("keydown", (e) => {
  const pictures = unique("picture");
  const at = pictures.indexOf(state.picture);
  const digit = pictures[Number(e.key) - 1];
  if (digit !== undefined) state.picture = digit;
  else if (e.key === "ArrowRight") state.picture = pictures[(at + 1) % pictures.length];
  else if (e.key === "ArrowLeft") state.picture = pictures[(at + pictures.length - 1) % pictures.length];
  else return;
  e.preventDefault();
  show();
});
viewer.classList.add("live");
document.querySelector(".hint").hidden = false;
show();
