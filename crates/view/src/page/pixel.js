// Values of a pixel and its paths.
"use strict";

// ── values ──

const three = (v) => (v ? v.map(short).join(" ") : "–");

// The server's answer about a pixel; null without an answer.
async function asked(what, pixel) {
  const answer = await fetch(`${what}?x=${pixel[0]}&y=${pixel[1]}`).catch(() => null);
  return answer?.ok ? answer.json() : null;
}

const ask = latest(async (pixel) => {
  // The values are those of the picture, not of a frame of the animations.
  const value = pixel && !playing && (await asked("pixel", pixel));
  if (!value) return;
  const of = value.surface;
  const rows = [["pixel", value.pixel.join(", ")], ["radiance", three(value.radiance)]];
  if (value.other) rows.push(["other", three(value.other)]);
  if (value.reference) rows.push(["reference", three(value.reference)]);
  if (value.error !== null) rows.push(["error", short(value.error)]);
  if (value.bias !== null) rows.push(["bias", short(value.bias)]);
  if (value.level !== null) rows.push(["level", value.level]);
  if (of?.object) rows.push(["object", of.object]);
  if (of) rows.push(["material", of.material || "unnamed"], ["roughness α", short(of.alpha)], ["depth", short(of.depth)], ["normal", three(of.normal)]);
  else rows.push(["surface", "none"]);
  const list = $("pointer");
  list.replaceChildren(...rows.map(([name, text]) => {
    const row = document.createElement("div");
    row.append(element("dt", name), element("dd", String(text)));
    return row;
  }));
});

// ── paths ──

const swatch = (rgb) => {
  const shown = element("span", undefined, "swatch");
  const gain = 2 ** (head?.exposure ?? 0);
  const code = (x) => Math.round(255 * Math.min(1, Math.max(0, x * gain)) ** (1 / 2.2));
  shown.style.background = `rgb(${rgb.map(code).join()})`;
  return shown;
};

async function why(pixel) {
  marked = pixel;
  drawPath(null);
  place();
  const box = $("why");
  const found = await asked("paths", pixel);
  if (marked !== pixel || !found) return;
  box.dataset.pixel = pixel.join();
  const list = element("ol");
  for (const path of found.paths) {
    const item = described(path);
    for (const name of ["pointerenter", "focusin"]) item.addEventListener(name, () => marked === pixel && drawPath(path));
    list.append(item);
  }
  drawPath(found.paths[0]);
  const text = `Pixel ${pixel.join(", ")}: ${found.lit} of ${found.samples} paths of the path tracer find light, mean ${three(found.mean)}. The brightest:`;
  box.replaceChildren(element("p", text, "quiet"), list);
  $("why-box").open = true;
  $("why-box").scrollIntoView({ block: "nearest" });
}

// Draws the vertices of a path over the picture, up to the first behind the camera.
function drawPath(path) {
  const made = [], points = [];
  for (const v of path?.vertices ?? []) {
    const at = projected(v.position);
    if (!at) break;
    points.push(at.map((x) => (1000 * x).toFixed(1)).join());
  }
  if (points.length) {
    for (const kind of ["under", "over"]) made.push(svg("polyline", { points: points.join(" "), class: kind, "vector-effect": "non-scaling-stroke" }));
    // A dot is a line of length 0: its round cap is not stretched with the picture.
    for (const kind of ["under", "over"]) {
      for (const p of points) made.push(svg("polyline", { points: `${p} ${p}`, class: `${kind} dot`, "vector-effect": "non-scaling-stroke" }));
    }
  }
  $("path").replaceChildren(...made);
}

function unmark() {
  if (!marked) return;
  marked = null;
  drawPath(null);
  place();
}

function described(path) {
  const item = element("li"), more = element("details"), line = element("summary");
  const steps = path.vertices.map((v) => v.bsdf).join(" → ") || "nothing";
  line.append(swatch(path.radiance), element("span", `${three(path.radiance)}`), element("span", steps, "quiet"));
  more.append(line);
  const table = element("table"), body = element("tbody");
  const row = (...cells) => {
    const made = element("tr");
    cells.forEach((cell, i) => made.append(element(i ? "td" : "th", cell)));
    body.append(made);
  };
  row("sample", `${path.sample}; ${three(path.emission)} straight from emitters`);
  path.vertices.forEach((v, i) => {
    const roughened = v.alpha_reg > v.alpha ? `α ${short(v.alpha)} → ${short(v.alpha_reg)}` : `α ${short(v.alpha)}`;
    const lobe = v.lobe ? `goes on by ${v.lobe}` : "ends";
    const kind = v.class === null ? "" : `, class ${v.class}`;
    row(`${i + 1} ${v.bsdf}`, `${v.material || "unnamed"}${v.mesh ? ` (mesh ${v.mesh})` : ""}, ${roughened}${kind}, throughput ${three(v.throughput)}, light ${three(v.light)}, ${lobe}, ${short(v.distance)} from the last`);
  });
  table.append(body);
  more.append(table);
  item.append(more);
  return item;
}
