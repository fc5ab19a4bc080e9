// The page of `opsr view`: shows the newest frame of the server, and sends changes of options.
"use strict";

const $ = (id) => document.getElementById(id);
const stage = $("stage"), sheet = $("sheet"), canvases = [$("picture"), $("other")];

let state = null;      // state of the server
let head = null;       // description of the last frame
let facts = null;
let look = null;       // camera of this page
let touched = -1e9;    // time at which this page last moved the camera
let lensShown = "";    // lens that the fields show
let zoom = 1, pan = [0, 0];
let split = 0.5;
let picking = false;
let marked = null;     // pixel whose paths are shown

// ── messages ──

function toast(text, time = 2600) {
  const line = $("toast");
  line.textContent = text;
  line.classList.add("seen");
  clearTimeout(toast.timer);
  toast.timer = setTimeout(() => line.classList.remove("seen"), time);
}

async function post(path, message) {
  let answer;
  try {
    answer = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(message) });
  } catch {
    return null;
  }
  if (!answer.ok) {
    toast(await answer.text(), 8000);
    if (state) adopt();
    return null;
  }
  return answer.json();
}

const set = (message) => post("set", message);
const option = (name, value) => set({ options: { [name]: value === "" ? null : value } });

// Sends one message at a time; of the waiting messages only the newest.
function latest(send) {
  let waiting = null, busy = false;
  return async function offer(value) {
    waiting = { value };
    if (busy) return;
    busy = true;
    while (waiting) {
      const { value } = waiting;
      waiting = null;
      await send(value);
    }
    busy = false;
  };
}

const sendLook = latest(() => set({ look: look }));
const sendOption = latest(([name, value]) => option(name, value));

// A hidden page frees its connection for other pages: browsers open six to a server.
let asking = new AbortController();
document.addEventListener("visibilitychange", () => document.hidden && asking.abort());

async function poll() {
  let frame = 0, words = 0;
  for (;;) {
    if (document.hidden) {
      await new Promise((seen) => document.addEventListener("visibilitychange", seen, { once: true }));
    }
    try {
      asking = new AbortController();
      const answer = await fetch(`poll?frame=${frame}&words=${words}`, { signal: asking.signal });
      if (!answer.ok) throw new Error(await answer.text());
      const [news, bytes, at] = unpacked(await answer.arrayBuffer());
      [frame, words] = [news.frame, news.words];
      state = news.state;
      // Frames of the animations replace the picture.
      if (news.picture && !(playing && head)) draw(news.picture, news.images, bytes, at);
      if (!facts || facts.scene !== state.scene) await learn();
      adopt();
      // Too many pages wait, so that the server answers this one at once.
      if (news.crowded) await new Promise((done) => setTimeout(done, 200));
    } catch (error) {
      if (error.name === "AbortError") continue;
      $("phase").textContent = "gone";
      $("phase").className = "gone";
      fault("The viewer does not answer: it was ended, or this page is of an older one.");
      await new Promise((done) => setTimeout(done, 1000));
    }
  }
}

// JSON and bytes of an answer, and the offset of its pixels.
function unpacked(bytes) {
  const length = new DataView(bytes).getUint32(0, true);
  return [JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length))), bytes, 4 + length];
}

// ── pictures ──

function paint(canvas, pixels) {
  const { width, height } = pixels;
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  canvas.getContext("2d").putImageData(pixels, 0, 0);
}

function draw(picture, images, bytes, at) {
  head = picture;
  stage.style.setProperty("--frame", picture.frame.join(" / "));
  images.forEach(([width, height], i) => {
    const count = 4 * width * height;
    paint(canvases[i], new ImageData(new Uint8ClampedArray(bytes, at, count), width, height));
    at += count;
  });
  const two = images.length > 1;
  canvases[1].hidden = $("divider").hidden = !two;
  $("side-a").hidden = $("side-b").hidden = !two;
  $("veil").hidden = true;
  stage.dataset.frames = 1 + Number(stage.dataset.frames || 0);
  stage.dataset.samples = picture.samples;
  stage.dataset.preview = picture.preview;
  legend(picture.legend);
  place();
}

function legend(scale) {
  $("legend").hidden = !scale;
  if (!scale) return;
  $("legend-low").textContent = short(scale.low);
  $("legend-high").textContent = short(scale.high);
  $("legend-what").textContent = scale.what;
}

// Rectangle of the whole frame in the stage, in CSS pixels.
function fitted() {
  const [w, h] = head ? head.frame : [16, 9];
  const { clientWidth: W, clientHeight: H } = stage;
  const fit = Math.min(W / w, H / h);
  const scale = fit * zoom;
  const clamp = (room, size, at) => (size <= room ? (room - size) / 2 : Math.min(0, Math.max(room - size, at)));
  const x = clamp(W, w * scale, pan[0] + (W - w * scale) / 2);
  const y = clamp(H, h * scale, pan[1] + (H - h * scale) / 2);
  return { x, y, w: w * scale, h: h * scale, scale };
}

function place() {
  const at = fitted();
  sheet.style.transform = `translate(${at.x}px, ${at.y}px)`;
  sheet.style.width = `${at.w}px`;
  sheet.style.height = `${at.h}px`;
  const full = head && canvases[0].width === head.frame[0];
  sheet.classList.toggle("sharp", Boolean(full && at.scale * devicePixelRatio > 1.5));
  const edge = at.x + split * at.w;
  $("divider").style.left = `${edge}px`;
  $("divider").setAttribute("aria-valuenow", Math.round(100 * split));
  canvases[1].style.clipPath = `inset(0 0 0 ${100 * split}%)`;
  const mark = $("mark");
  mark.hidden = !marked;
  if (marked) {
    mark.style.left = `${marked[0] * at.scale - 1}px`;
    mark.style.top = `${marked[1] * at.scale - 1}px`;
    mark.style.width = mark.style.height = `${at.scale + 2}px`;
  }
}

// Pixel of the frame under a point of the window; null outside.
function pixelAt(event) {
  if (!head) return null;
  const box = stage.getBoundingClientRect(), at = fitted();
  const x = Math.floor((event.clientX - box.left - at.x) / at.scale);
  const y = Math.floor((event.clientY - box.top - at.y) / at.scale);
  const [w, h] = head.frame;
  return x >= 0 && y >= 0 && x < w && y < h ? [x, y] : null;
}

function zoomTo(factor, event) {
  const before = fitted(), box = stage.getBoundingClientRect();
  const point = event ? [event.clientX - box.left, event.clientY - box.top] : [stage.clientWidth / 2, stage.clientHeight / 2];
  const share = [(point[0] - before.x) / before.w, (point[1] - before.y) / before.h];
  zoom = factor;
  const after = fitted();
  pan = [
    point[0] - share[0] * after.w - (stage.clientWidth - after.w) / 2,
    point[1] - share[1] * after.h - (stage.clientHeight - after.h) / 2,
  ];
  place();
}

// ── pointer ──

const fingers = new Map();
let gesture = null;
let hovered = null;    // pixel under the pointer

stage.addEventListener("pointerdown", (event) => {
  if (event.target.id === "divider") return;
  stage.focus({ preventScroll: true });
  stage.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, event);
  const both = [...fingers.values()];
  gesture = {
    pans: event.button === 1 || event.button === 2 || event.shiftKey,
    still: fingers.size === 1 && event.button === 0,
    from: [event.clientX, event.clientY],
    apart: both.length > 1 ? apart(both) : 0,
    about: null,
    turned: [0, 0],
  };
  const own = gesture;
  grasped(pixelAt(event)).then((about) => {
    own.about = about;
    drag(own, 0, 0);
  });
});

// Turns the camera by the whole drag so far, once the point to turn about is known.
function drag(own, dx, dy) {
  own.turned = add(own.turned, [dx, dy]);
  if (!own.about || !own.turned.some((x) => x !== 0)) return;
  orbit(...own.turned, own.about);
  own.turned = [0, 0];
}

const apart = ([a, b]) => Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);

stage.addEventListener("pointermove", (event) => {
  if (!fingers.has(event.pointerId)) {
    hovered = pixelAt(event);
    if (event.pointerType === "mouse") ask(hovered);
    return;
  }
  const before = fingers.get(event.pointerId);
  const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
  if (Math.hypot(event.clientX - gesture.from[0], event.clientY - gesture.from[1]) > 4) gesture.still = false;
  if (gesture.still) return;
  fingers.set(event.pointerId, event);
  const both = [...fingers.values()];
  if (both.length > 1) {
    const now = apart(both);
    if (gesture.apart) dolly(Math.log(gesture.apart / Math.max(now, 1)));
    gesture.apart = now;
    shift(dx / 2, dy / 2);
  } else if (event.altKey) {
    pan = add(pan, [dx, dy]);
    place();
  } else if (gesture.pans) {
    shift(dx, dy);
  } else {
    drag(gesture, (dx * Math.PI) / stage.clientWidth * 1.5, (dy * Math.PI) / stage.clientHeight);
  }
});

function released(event) {
  const clicked = gesture?.still && fingers.size === 1 && event.type === "pointerup";
  fingers.delete(event.pointerId);
  if (!clicked) return;
  const pixel = pixelAt(event);
  if (!pixel || playing) return;
  if (picking) {
    focusBy(false);
    post("pick", { x: pixel[0], y: pixel[1], what: "focus" }).then((to) => to && toast(`In focus at ${short(to.depth)}`));
    return;
  }
  ask(pixel);
  why(pixel);
}
stage.addEventListener("pointerup", released);
stage.addEventListener("pointercancel", released);
stage.addEventListener("contextmenu", (event) => event.preventDefault());
stage.addEventListener("dblclick", (event) => {
  const pixel = pixelAt(event);
  if (!pixel || event.target.id === "divider") return;
  touched = -1e9;
  post("pick", { x: pixel[0], y: pixel[1], what: "target" }).then((to) => to && toast("The camera turns around this point"));
});
stage.addEventListener("wheel", (event) => {
  event.preventDefault();
  if (event.ctrlKey || event.altKey) {
    zoomTo(Math.min(32, Math.max(1, zoom * Math.exp(-0.01 * event.deltaY))), event);
  } else {
    dolly(0.0012 * Math.max(-200, Math.min(200, event.deltaY)));
  }
}, { passive: false });

function dragSplit(event) {
  const box = stage.getBoundingClientRect(), at = fitted();
  split = Math.min(1, Math.max(0, (event.clientX - box.left - at.x) / at.w));
  place();
}
$("divider").addEventListener("pointerdown", (event) => {
  event.stopPropagation();
  $("divider").setPointerCapture(event.pointerId);
  $("divider").onpointermove = dragSplit;
});
$("divider").addEventListener("pointerup", () => { $("divider").onpointermove = null; });
$("divider").addEventListener("keydown", (event) => {
  const by = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
  if (!by) return;
  event.preventDefault();
  event.stopPropagation();
  split = Math.min(1, Math.max(0, split + by));
  place();
});

// ── text ──

function short(x) {
  if (x === null || x === undefined) return "–";
  if (!Number.isFinite(x)) return String(x);
  const size = Math.abs(x);
  if (size !== 0 && (size >= 1e5 || size < 1e-3)) return x.toExponential(2);
  return String(Number(x.toPrecision(3)));
}
const percent = (share) => `${Number((100 * share).toPrecision(2))} %`;
const clock = (s) => (s < 90 ? `${Math.max(1, Math.round(s))} s` : s < 5400 ? `${Math.round(s / 60)} min` : s < 172800 ? `${Math.round(s / 3600)} h` : `${Math.round(s / 86400)} days`);

function element(name, text, kind) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (kind) made.className = kind;
  return made;
}

// ── controls ──

function fault(text) {
  $("fault").hidden = !text;
  $("fault").textContent = text || "";
}

const scales = { exp2: [(x) => 2 ** x, Math.log2] };

// Shows the state of the server in the controls.
function adopt() {
  const phase = $("phase");
  phase.textContent = state.phase;
  phase.className = state.phase;
  stage.dataset.phase = state.phase;
  const { samples, seconds } = state.course;
  const error = state.error ? `, error ${percent(state.error)}` : "";
  const flip = state.flip !== null ? `, FLIP ${short(state.flip)}` : "";
  $("compared").textContent = `${state.flip !== null ? `FLIP ${short(state.flip)}. ` : ""}The other picture gets the same time. Drag the border.`;
  $("numbers").textContent = samples ? `${samples} samples, ${seconds.toFixed(1)} s${error}${flip}` : "";
  fault(state.fault);
  if (state.fault && !head) $("veil").textContent = state.fault;
  if (state.look && performance.now() - touched > 400) {
    look = state.look;
    axes();
  }
  $("pause").setAttribute("aria-pressed", state.paused);
  $("pause").textContent = state.paused ? "Go on" : "Pause";
  if (!playing) $("command").textContent = state.command;
  $("missing").hidden = !state.missing;
  $("missing").textContent = state.missing ?? "";
  $("notes").replaceChildren(...[...(state.warnings || []), ...state.notes].map((note) => element("li", note)));
  const options = state.options;
  for (const input of document.querySelectorAll("[data-option]")) {
    if (input === document.activeElement && input.type !== "checkbox" && input.tagName !== "SELECT") continue;
    const value = options[input.dataset.option];
    if (input.type === "checkbox") input.checked = Boolean(value);
    else if (input.type === "range") {
      const scale = scales[input.dataset.scale];
      input.value = value === undefined ? 0 : scale ? scale[1](value) : value;
      showRange(input);
    } else {
      const values = [...(input.options ?? [])].map((choice) => choice.value);
      // A table without an integrator implies path tracing; any other option that is not given has an empty value.
      const usual = input.dataset.option === "integrator" && options.table !== undefined ? "path" : "";
      input.value = value ?? (values.length === 0 || values.includes(usual) ? usual : values[0]);
    }
  }
  // Only when the lens changes: a distance may be typed before its radius.
  if (lensShown !== (options.lens ?? "")) {
    lensShown = options.lens ?? "";
    const [radius, distance] = lensShown.split(",");
    for (const [input, number] of [[$("aperture"), radius], [$("focus"), distance]]) {
      if (input !== document.activeElement) input.value = number ?? "";
    }
  }
  timeLine(options.at);
  const constant = typeof options.table === "number";
  if (!constant) known($("roughening"), options.table);
  $("roughening").value = constant ? "gamma" : options.table ?? "";
  $("gamma-row").hidden = !constant;
  if (constant && document.activeElement !== $("gamma")) {
    $("gamma").value = options.table;
    $("gamma").nextElementSibling.value = options.table;
  }
  const automatic = options.exposure === undefined || options.exposure === "auto";
  $("auto").checked = automatic;
  if (document.activeElement !== $("exposure")) {
    const stops = automatic ? head?.exposure ?? 0 : Number(options.exposure) || 0;
    $("exposure").value = stops;
    $("exposure").nextElementSibling.value = short(Math.round(10 * stops) / 10);
  }
  for (const button of document.querySelectorAll("#overlays button")) {
    button.setAttribute("aria-checked", button.value === state.overlay);
  }
  const other = state.other;
  $("compare").value = other === null ? "" : typeof other === "string" ? other : other.integrator;
  if (other !== null) {
    const named = typeof other === "string" ? { reference: "reference", plain: "plain paths" }[other] : other.integrator;
    const side = (name, course) => `${name}${course.samples ? `, ${course.samples} samples` : ""}`;
    $("side-a").textContent = side(state.integrator || "this", state.course);
    $("side-b").textContent = side(named, state.other_course);
  }
  curve();
}

// Adds a value to the choices of an element, so that it can be shown.
function known(select, value) {
  if (value === undefined || value === null || [...select.options].some((o) => o.value === String(value))) return;
  select.append(new Option(String(value), String(value)));
}

function showRange(input) {
  const scale = scales[input.dataset.scale];
  if (input.nextElementSibling) input.nextElementSibling.value = short(scale ? scale[0](Number(input.value)) : Number(input.value));
}

async function learn() {
  const answer = await fetch("facts");
  if (!answer.ok) return;
  facts = await answer.json();
  $("title").textContent = facts.title;
  document.title = `${facts.title}, opsr`;
  for (const { name, choices, help, default: usual } of facts.options) {
    const input = document.querySelector(`[data-option="${name}"]`);
    if (!input) continue;
    input.title = help;
    if (input.tagName === "SELECT" && choices.length && input.options.length === 0) {
      choices.forEach((choice) => input.add(new Option(choice, choice === usual ? "" : choice)));
    }
  }
  const cameras = $("camera");
  cameras.replaceChildren(new Option("first", ""), ...facts.cameras.map((name) => new Option(name, name)));
  known(cameras, state.options.camera);
  known($("env"), state.options.env);
  const variants = facts.variants ?? [];
  $("variant").replaceChildren(new Option("of the file", ""), ...variants.map((name) => new Option(name, name)));
  $("variant-row").hidden = variants.length === 0;
  $("denoise-row").hidden = !facts.denoiser;
  const compare = $("compare"), kinds = facts.options.find((o) => o.name === "integrator").choices;
  compare.replaceChildren(new Option("nothing", ""), new Option("plain path tracing", "plain"));
  if (facts.reference) compare.add(new Option("the reference", "reference"));
  kinds.filter((kind) => kind !== "auto").forEach((kind) => compare.add(new Option(kind, kind)));
  const box = document.querySelector("#overlays .choices");
  box.replaceChildren(...facts.overlays.map((name, i) => {
    const button = element("button", name);
    button.type = "button";
    button.value = name;
    button.title = `Key ${(i + 1) % 10}`;
    button.setAttribute("role", "radio");
    button.onclick = () => overlay(name);
    return button;
  }));
}

function overlay(name) {
  const lacks = { noise: "levels", bias: "levels", level: "levels", flip: "a picture to compare with" }[name];
  if (lacks === "levels" && $("roughening").value === "") toast("This is known of several levels: choose a table or a constant.");
  if (name === "missing" && !state.missing) toast("No light is known to be missing. A witness looks from 32 samples on, beside renders of one level without roughening.", 6000);
  if (name === "flip" && state.other === null) toast("FLIP needs a picture to compare with.");
  if (playing && name !== "picture") toggle();
  set({ overlay: name });
}

for (const input of document.querySelectorAll("[data-option]")) {
  const name = input.dataset.option;
  const value = () => {
    if (input.type === "checkbox") return input.checked || null;
    if (input.type === "range") {
      const scale = scales[input.dataset.scale];
      const x = Number(input.value);
      return x === 0 ? null : scale ? scale[0](x) : x;
    }
    if (input.type === "number") return input.value === "" ? null : Number(input.value);
    return input.value === "" ? null : input.value;
  };
  input.addEventListener("input", () => {
    if (input.type !== "range") return;
    showRange(input);
    sendOption([name, value()]);
  });
  input.addEventListener("change", () => input.type !== "range" && option(name, value()));
}

$("roughening").onchange = (event) => {
  const value = event.target.value;
  option("table", value === "gamma" ? Number($("gamma").value) : value || null);
};
$("gamma").oninput = (event) => {
  event.target.nextElementSibling.value = event.target.value;
  sendOption(["table", Number(event.target.value)]);
};
// A distance needs a radius; a radius of 0 has no distance.
const lens = () => {
  const radius = $("aperture").value, distance = $("focus").value;
  if (radius === "" && distance !== "") toast("A lens needs a radius.");
  option("lens", radius === "" ? null : Number(radius) === 0 || distance === "" ? radius : `${radius},${distance}`);
};
$("aperture").onchange = $("focus").onchange = lens;
$("auto").onchange = (event) => option("exposure", event.target.checked ? null : Number($("exposure").value));
const expose = (stops) => {
  $("exposure").value = stops;
  $("exposure").nextElementSibling.value = short(stops);
  $("auto").checked = false;
  sendOption(["exposure", stops]);
};
$("exposure").oninput = (event) => expose(Number(event.target.value));
$("compare").onchange = (event) => {
  const value = event.target.value;
  set({ other: value === "" ? null : ["plain", "reference"].includes(value) ? value : { integrator: value } });
};
$("pause").onclick = () => set({ paused: !state.paused });
$("home").onclick = () => {
  touched = -1e9;
  unmark();
  set({ home: true });
};
$("full").onclick = () => {
  const change = document.fullscreenElement ? document.exitFullscreen() : $("viewport").requestFullscreen?.();
  if (!change) return toast("This browser has no full screen");
  change.catch((error) => toast(error.message));
};
function focusBy(on) {
  picking = on;
  stage.classList.toggle("picking", on);
  $("pick-focus").setAttribute("aria-pressed", on);
}
$("pick-focus").onclick = () => {
  focusBy(!picking);
  if (picking) toast("Click what is to be in focus");
};

async function copy(text, what) {
  try {
    await navigator.clipboard.writeText(text);
    toast(`Copied ${what}`);
  } catch {
    $("command").textContent = text;
    toast("Not allowed to copy: the text is below Save");
  }
}
const numbers = () => [...look.position, ...look.target, ...look.up, look.height ? `h${look.height}` : look.fov, ...(look.shift ?? [])].join();
$("copy-look").onclick = () => state?.look && copy(`--camera ${numbers()}`, "the camera");
$("copy-command").onclick = () => {
  const { command, samples } = onStage ?? { command: state?.command, samples: state?.course.samples };
  if (command) copy(`${command} --spp ${Math.max(1, samples)} -o out.exr`, "the command");
};
// Files show a frame at rest: saving stops the animations first.
for (const link of document.querySelectorAll("#save-png, #save-exr, #save-look")) {
  link.addEventListener("click", (event) => {
    if (!playing) return;
    event.preventDefault();
    toggle().then(() => link.click());
  });
}

// ── keys ──

const step = Math.PI / 36;
const keys = {
  ArrowLeft: ["Turn the camera", () => orbit(-step, 0), () => shift(30, 0)],
  ArrowRight: ["", () => orbit(step, 0), () => shift(-30, 0)],
  ArrowUp: ["", () => orbit(0, -step), () => shift(0, 30)],
  ArrowDown: ["", () => orbit(0, step), () => shift(0, -30)],
  "+": ["Near", () => dolly(-0.1)],
  "-": ["Far", () => dolly(0.1)],
  "[": ["Darker", () => expose(Math.round(10 * Number($("exposure").value) - 5) / 10)],
  "]": ["Brighter", () => expose(Math.round(10 * Number($("exposure").value) + 5) / 10)],
  " ": ["Pause or go on", () => $("pause").click()],
  h: ["Camera of the file", () => $("home").click()],
  f: ["Frame the object under the pointer", frameObject],
  Home: ["Frame all", () => facts?.bounds && frameBox(facts.bounds)],
  x: ["From the side; with Shift from the other", () => viewAlong(0, 1), () => viewAlong(0, -1)],
  y: ["From the top; with Shift from below", () => viewAlong(1, 1), () => viewAlong(1, -1)],
  z: ["From the front; with Shift from behind", () => viewAlong(2, 1), () => viewAlong(2, -1)],
  t: ["Play the animations, and stop", () => toggle()],
  o: ["Open a file", () => $("open").click()],
  m: ["Full screen, and back", () => $("full").click()],
  p: ["Larger pixels, and back", () => zoomTo(zoom >= 16 ? 1 : zoom * 4, null)],
  d: ["The next click sets the focus", () => $("pick-focus").click()],
  c: ["Copy numbers of the camera", () => $("copy-look").click()],
  k: ["Copy the command", () => $("copy-command").click()],
  s: ["Save a PNG file", () => $("save-png").click()],
  e: ["Save an EXR file", () => $("save-exr").click()],
  v: ["Save the view", () => $("save-look").click()],
  "?": ["This list", () => $("help").showModal()],
};

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || $("help").open) return;
  const typing = event.target.matches("input, select, textarea");
  const pressing = event.key === " " && event.target.matches("button, a, summary");
  const arrows = event.key.startsWith("Arrow") && event.target !== stage && event.target !== document.body;
  if (typing || pressing || arrows) return;
  if (event.key === "Escape") return focusBy(false);
  const at = /^[0-9]$/.test(event.key) ? Number(event.key) || 10 : 0;
  if (at && facts && at <= facts.overlays.length) return overlay(facts.overlays[at - 1]);
  const key = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key] ?? keys[{ "=": "+", ".": "f" }[event.key]];
  if (!key) return;
  event.preventDefault();
  (event.shiftKey && key[2] ? key[2] : key[1])();
});

function fillKeys() {
  const rows = Object.entries(keys).filter(([, [what]]) => what).map(([key, [what]]) => [{ ArrowLeft: "← → ↑ ↓", " ": "space" }[key] ?? key, what]);
  rows.push(["Shift + arrows", "Move the camera"], ["1 … 9, 0", "Picture, and what is known of it"]);
  rows.push(["drag", "Turn about what is under the pointer; with Shift or the right button move"], ["wheel", "Near and far; with Ctrl larger pixels"]);
  rows.push(["double click", "Look at this point"], ["click", "Value and paths of a pixel"]);
  $("keys").replaceChildren(...rows.map(([key, what]) => {
    const row = element("tr"), cell = element("td");
    cell.append(element("kbd", key));
    row.append(cell, element("td", what));
    return row;
  }));
}

$("help-button").onclick = () => $("help").showModal();
new ResizeObserver(place).observe(stage);
makeAxes();
fillKeys();
// Starts after the scripts that follow this one.
document.addEventListener("DOMContentLoaded", poll);
