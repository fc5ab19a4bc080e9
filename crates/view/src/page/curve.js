// The average error over time, and a forecast of it.
"use strict";

// Error ~ a t^b by least squares over the later half of the points, with b between -1 and 0.
function trend(points) {
  const late = points.slice(Math.floor(points.length / 2)).map(([t, , e]) => [Math.log(t), Math.log(e)]);
  if (late.length < 3) return null;
  const mean = (i) => late.reduce((sum, p) => sum + p[i], 0) / late.length;
  const [mx, my] = [mean(0), mean(1)];
  const xx = late.reduce((sum, p) => sum + (p[0] - mx) ** 2, 0);
  if (xx < 0.02) return { slope: -0.5, at: my + 0.5 * mx };
  const xy = late.reduce((sum, p) => sum + (p[0] - mx) * (p[1] - my), 0);
  const slope = Math.min(-0.05, Math.max(-1, xy / xx));
  return { slope, at: my - slope * mx };
}

function curve() {
  const sides = [state.course, state.other_course].map((c) => c.curve.filter(([t, , e]) => t > 0 && e > 0));
  const all = sides.flat(), goal = state.options.target_error;
  const fit = trend(sides[0]);
  if (all.length < 2) {
    $("curve").replaceChildren();
    $("forecast").textContent = state.error ? `Average error ${percent(state.error)}.` : "No estimate yet.";
    return;
  }
  const times = all.map((p) => p[0]), errors = all.map((p) => p[2]).concat(goal || []);
  let [t0, t1] = [Math.min(...times), Math.max(...times) * 2];
  let [e0, e1] = [Math.min(...errors) * 0.8, Math.max(...errors) * 1.25];
  const x = (t) => 34 + (258 * Math.log(t / t0)) / Math.log(t1 / t0);
  const y = (e) => 8 + (100 * Math.log(e1 / e)) / Math.log(e1 / e0);
  const made = [];
  const draw = (name, of, text) => {
    made.push(svg(name, of, text));
  };
  const ticks = (low, high, of) => {
    let found = [];
    for (let k = Math.floor(Math.log10(low)); k <= Math.ceil(Math.log10(high)); k++) {
      for (const m of of) found.push(m * 10 ** k);
    }
    return found.filter((v) => v >= low && v <= high);
  };
  const thin = (low, high) => (high / low > 60 ? [1] : high / low > 8 ? [1, 3] : [1, 2, 3, 5, 7]);
  for (const e of ticks(e0, e1, thin(e0, e1))) {
    draw("line", { class: "grid", x1: 34, x2: 292, y1: y(e), y2: y(e) });
    draw("text", { x: 30, y: y(e) + 3, "text-anchor": "end" }, short(e));
  }
  for (const t of ticks(t0, t1, thin(t0, t1))) {
    draw("line", { class: "grid", x1: x(t), x2: x(t), y1: 8, y2: 108 });
    draw("text", { x: x(t), y: 121, "text-anchor": "middle" }, `${short(t)} s`);
  }
  sides.forEach((points, side) => {
    const line = points.map(([t, , e]) => `${x(t).toFixed(1)},${y(e).toFixed(1)}`).join(" ");
    if (points.length) draw("polyline", { class: side ? "b" : "a", points: line });
  });
  if (goal) draw("line", { class: "goal", x1: 34, x2: 292, y1: y(goal), y2: y(goal) });
  if (fit) {
    const last = sides[0].at(-1), end = Math.exp(fit.at + fit.slope * Math.log(t1));
    draw("line", { class: "ahead", x1: x(last[0]), y1: y(last[2]), x2: x(t1), y2: Math.min(108, y(end)) });
  }
  $("curve").replaceChildren(...made);
  $("forecast").textContent = forecast(fit, goal);
}

function forecast(fit, goal) {
  const { seconds } = state.course;
  const now = state.error ? `Average error ${percent(state.error)}` : "";
  const until = (error) => Math.exp((Math.log(error) - fit.at) / fit.slope) - seconds;
  if (!fit || !state.error) return now ? `${now}.` : "No estimate yet.";
  if (goal && state.error <= goal) return `${now}: the target is reached.`;
  const aim = goal || state.error / 2;
  return `${now}. ${percent(aim)} is expected in about ${clock(until(aim))}.`;
}
