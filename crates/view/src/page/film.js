// The time line: moments of the animations, and the frames that this page keeps while they run.
"use strict";

let playing = null;    // when the play began, and its frame then
let reel = null;       // numbers of the film and of its last change, and the frames
let onStage = null;    // the frame that is shown while the animations run

const sendFrame = (frame) => sendOption(["at", `${Math.round(frame)}@${facts.rate}`]);

// The frame that the clock shows.
const ticked = (now) => Math.floor(playing.from + ((now - playing.since) / 1000) * facts.rate) % facts.frames;

// Starts the animations at a frame, or stops them at the shown one, for all pages.
function play(on) {
  if (!facts?.seconds || on === Boolean(playing)) return Promise.resolve();
  if (on) {
    const from = Number($("moment").value);
    run(from);
    return set({ options: { at: `${from}@${facts.rate}` }, playing: true });
  }
  const frame = onStage?.frame ?? Number($("moment").value);
  halt();
  return set({ options: { at: `${frame}@${facts.rate}` }, playing: false });
}

function run(from) {
  playing = { from, since: performance.now(), asking: new AbortController() };
  unmark();
  requestAnimationFrame(tick);
  fetchFrames(playing);
  pressed();
}

function halt() {
  playing?.asking.abort();
  playing = onStage = null;
  delete stage.dataset.frame;
  pressed();
}

function pressed() {
  $("play").setAttribute("aria-pressed", Boolean(playing));
  $("play").textContent = playing ? "Stop" : "Play";
}

// Shows the frame of the clock, or the last stored one before it.
function tick(now) {
  if (!playing) return;
  requestAnimationFrame(tick);
  const at = ticked(now);
  showMoment(at);
  for (let back = 0; reel && back < facts.frames; back++) {
    const still = reel.stills[(at - back + facts.frames) % facts.frames];
    if (!still) continue;
    if (still !== onStage) show(still);
    return;
  }
}

function show(still) {
  onStage = still;
  paint(canvases[0], still.pixels);
  canvases[1].hidden = $("divider").hidden = $("side-a").hidden = $("side-b").hidden = true;
  stage.dataset.frame = still.frame;
  $("command").textContent = still.command;
  legend(null);
  place();
}

// Fetches every new or better frame, the oldest change first.
async function fetchFrames(own) {
  while (playing === own) {
    try {
      const path = `film?film=${reel?.film ?? 0}&change=${reel?.change ?? 0}`;
      const answer = await fetch(path, { signal: own.asking.signal });
      if (!answer.ok) throw new Error(await answer.text());
      const [news, bytes, at] = unpacked(await answer.arrayBuffer());
      if (news.size) {
        if (news.film !== reel?.film) reel = { film: news.film, stills: [] };
        const pixels = new ImageData(new Uint8ClampedArray(bytes, at), ...news.size);
        reel.change = news.change;
        reel.stills[news.frame] = { ...news, pixels };
        $("kept").textContent = progress();
      } else if (news.crowded) await pause(200);
    } catch (error) {
      if (error.name !== "AbortError") await pause(1000);
    }
  }
}

const pause = (time) => new Promise((done) => setTimeout(done, time));

function progress() {
  const kept = Object.keys(reel.stills).length;
  return kept < facts.frames ? `${kept} of ${facts.frames} frames` : "";
}

// Shows a moment such as 0.5s or 12@24, or rest; starts and stops with other pages.
function timeLine(at) {
  $("time").hidden = !facts?.seconds;
  if (!facts?.seconds) {
    if (playing) halt();
    return;
  }
  $("moment").max = facts.frames - 1;
  if (performance.now() - (play.at ?? -1e9) > 400 && state.playing !== Boolean(playing)) {
    if (state.playing) run(state.film?.position ?? 0);
    else halt();
  }
  if (playing) return;
  const [number, rate] = (at ?? "0s").split("@").map(Number.parseFloat);
  if (document.activeElement !== $("moment")) $("moment").value = (number / (rate || 1)) * facts.rate;
  showSeconds(at === undefined ? "at rest" : undefined, number / (rate || 1));
}

function showMoment(frame) {
  $("moment").value = frame;
  showSeconds(undefined, frame / facts.rate);
}

function showSeconds(text, seconds) {
  const shown = text ?? `${seconds.toFixed(2)} of ${facts.seconds.toFixed(2)} s`;
  if ($("seconds").value === shown) return;
  $("seconds").value = shown;
  $("moment").setAttribute("aria-valuetext", shown);
  if (!playing) $("kept").textContent = "";
}

const toggle = () => {
  play.at = performance.now();
  return play(!playing);
};
$("play").onclick = toggle;
$("rest").onclick = () => {
  play.at = performance.now();
  halt();
  set({ options: { at: null }, playing: false });
};
$("moment").oninput = (event) => {
  const frame = Number(event.target.value);
  if (playing) {
    play.at = performance.now();
    halt();
    set({ playing: false });
  }
  showMoment(frame);
  sendFrame(frame);
};
