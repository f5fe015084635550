// The page of `brakecheck drive`: keys to the program, samples to the screen.

import { Scene3d } from "./scene3d.js";
import { Panel } from "./panel.js";

const byId = (id) => document.getElementById(id);
const scene = new Scene3d(byId("scene")), panel = new Panel();
// Strength of the keys: m/s² along the road, m/s across it. Shift brakes as hard as it gets.
const GAS = 3, BRAKE = 5, HARD = 9, ACROSS = 1.5;

let page = null, stage = null, frames = [], state = { running: false, done: false, speed: 1, wheel: null };
/** Frame that the panels show. */
let drawn = null;
/** Sample that is looked at, or null for the newest. */
let looked = null;
/** Way through the samples that were played: where and when it began, or null. */
let replay = null;
let arrived = performance.now();
const held = new Set();
let sent = "", action = null;

/** Asks the program. Only the page at the wheel is answered. */
async function ask(request) {
  if (page === null || state.wheel !== page) return;
  const body = JSON.stringify({ page, ask: request });
  const answer = await fetch("do", { method: "POST", headers: { "Content-Type": "application/json" }, body });
  if (!answer.ok) byId("note").textContent = await answer.text();
}

/** Says who drives. */
function who(now) {
  if (now.wheel !== page) return "You watch: another page is at the wheel.";
  if (stage?.seat.ado !== undefined) return `You are ${stage.ados[stage.seat.ado]}.`;
  return stage?.setup.ego === "you" || !stage ? "You are at the wheel." : "The ego drives by itself.";
}

function newest() { return frames.length - 1; }
function shownAt() { return looked === null ? newest() : Math.min(looked, newest()); }

const receive = {
  stage(it) {
    stage = it; frames = []; looked = null; replay = null;
    scene.setStage(it); panel.setStage(it);
    byId("problems").hidden = true;
    byId("note").textContent = it.setup.ado === "search" ? "The search found a sequence with which the ego fails. Press Go." : "";
    byId("timeline").max = Math.round(it.horizon_s / it.sample_s);
    const own = it.seat.ado === undefined ? null : it.seat.ado;
    action = null;
    byId("keys").textContent = own === null
      ? (it.setup.ego === "you" ? "↑ gas   ↓ brake (Shift: hard)   ← → across   Space go / pause" : "Space go / pause")
      : it.actions[own].map((name, at) => `${at + 1}: ${name}`).join("   ");
  },
  geometry(it) { scene.setRoads(it); },
  frame(it) { frames.push(it); looked = null; arrived = performance.now(); },
  frames(all) { frames = all; looked = null; arrived = performance.now(); },
  state(it) {
    state = it;
    byId("speed").value = String(it.speed);
    byId("wheel").textContent = who(it);
    for (const button of document.querySelectorAll("#controls button, #begin")) {
      if (!["camera", "keep", "resume"].includes(button.id)) button.disabled = it.wheel !== page;
    }
  },
  kept(name) { byId("note").textContent = `Kept as ${name}`; },
  note(text) { byId("note").textContent = text; },
  problems(text) { byId("problems").textContent = text; byId("problems").hidden = false; },
  page(id) { page = id; },
};

const events = new EventSource("events");
events.onmessage = (event) => {
  for (const [kind, content] of Object.entries(JSON.parse(event.data))) receive[kind]?.(content);
};
events.onerror = () => { byId("wheel").textContent = "The program is gone or does not answer."; };

/** Sends what the keys and the gamepad say, whenever it changes. */
function sendInput() {
  if (!stage) return;
  const pad = [...(navigator.getGamepads?.() ?? [])].find((it) => it);
  const strength = held.has("Shift") ? HARD : BRAKE;
  let accel = (held.has("ArrowUp") ? GAS : 0) - (held.has("ArrowDown") ? strength : 0);
  let across = (held.has("ArrowLeft") ? ACROSS : 0) - (held.has("ArrowRight") ? ACROSS : 0);
  if (pad) {
    accel += GAS * (pad.buttons[7]?.value ?? 0) - HARD * (pad.buttons[6]?.value ?? 0);
    if (Math.abs(pad.axes[0]) > 0.1) across -= ACROSS * pad.axes[0];
  }
  const input = { accel_mps2: accel, lateral_mps: across, action };
  const text = JSON.stringify(input);
  if (text === sent) return;
  sent = text;
  ask({ keys: input });
}

async function goOn() {
  // From the moment that is looked at: what was played after it is given up.
  replay = null;
  if (looked !== null && looked < newest()) await ask({ back: looked });
  await ask({ run: true });
}
/** What was played runs again, from the moment that is looked at or from the beginning. */
const watch = () => { replay = { from: looked ?? 0, since: performance.now() }; };
const run = () => {
  if (replay) { replay = null; return; }
  if (state.running) { ask({ run: false }); return; }
  // Only "On from here" and "Again" give up what was driven.
  if (state.done || (looked !== null && looked < newest())) watch(); else goOn();
};
const look = (at) => { replay = null; if (state.running) ask({ run: false }); looked = Math.max(0, Math.min(at, newest())); };
const again = () => ask({ begin: stage.setup });
const begin = () => {
  const values = panel.egoValues().filter((it) => it.touched).map((it) => [it.name, it.value]);
  const ego = byId("ego").value;
  ask({ begin: {
    ego, ado: byId("player").value, noise: stage.setup.noise,
    start: panel.startValues().map((it) => it.value),
    // Another ego has other parameters.
    ego_values: ego === stage.setup.ego ? Object.fromEntries(values) : {},
  } });
};
const camera = () => { scene.fromAbove = !scene.fromAbove; };

// Requests without a value are words.
const actions = {
  run, back: () => look(shownAt() - 1), resume: goOn, camera, again, begin,
  step: () => (looked !== null && looked < newest() ? look(looked + 1) : ask("step")),
  next: () => ask("next"), keep: () => ask("keep"),
};
for (const [id, act] of Object.entries(actions)) {
  byId(id).addEventListener("click", (event) => { act(); event.currentTarget.blur(); });
}
byId("speed").addEventListener("change", (event) => ask({ speed: Number(event.target.value) }));
// Arrow keys drive, and must not move the slider.
byId("timeline").addEventListener("change", (event) => event.target.blur());
byId("signals").parentElement.addEventListener("toggle", () => { drawn = null; });
byId("timeline").addEventListener("input", (event) => look(Number(event.target.value)));

const KEYS = { " ": run, ",": actions.back, ".": actions.step, c: camera, r: again, n: actions.next, k: actions.keep };
const NAMES = { w: "ArrowUp", s: "ArrowDown", a: "ArrowLeft", d: "ArrowRight" };
const isTyping = (event) => ["INPUT", "SELECT"].includes(event.target.tagName);
window.addEventListener("keydown", (event) => {
  if (isTyping(event) || event.ctrlKey || event.metaKey || event.altKey) return;
  const key = NAMES[event.key.toLowerCase()] ?? event.key;
  if (key.startsWith("Arrow") || key === " ") event.preventDefault();
  held.add(key);
  if (/^[1-9]$/.test(key) && stage?.seat.ado !== undefined) action = Number(key) - 1;
  if (!event.repeat) KEYS[key.toLowerCase()]?.();
  sendInput();
});
window.addEventListener("keyup", (event) => { held.delete(NAMES[event.key.toLowerCase()] ?? event.key); sendInput(); });
// A key that is released elsewhere would stay held.
window.addEventListener("blur", () => { held.clear(); sendInput(); });

/** Poses between the last two samples, so that motion is smooth. */
function bodiesNow() {
  const at = shownAt(), now = frames[at], before = frames[at - 1];
  if (looked !== null || !before || !state.running) return now.placements;
  const share = Math.min(1, (performance.now() - arrived) / (1000 * stage.sample_s / state.speed));
  return now.placements.map((body, i) => body.map((value, k) => {
    const from = before.placements[i][k];
    // Opposite quaternions are the same orientation.
    return k < 3 || from * value > -0.5 ? from + (value - from) * share : value;
  }));
}

const labels = byId("labels");
function show() {
  requestAnimationFrame(show);
  sendInput();
  if (!stage || !frames.length) return;
  if (replay) {
    const played = (performance.now() - replay.since) / (1000 * stage.sample_s / state.speed);
    looked = Math.min(newest(), replay.from + Math.floor(played));
    if (looked === newest()) { replay = null; looked = null; }
  }
  byId("run").textContent = state.running || replay ? "❚❚ Pause" : "▶ Go";
  const at = shownAt(), frame = frames[at];
  const places = scene.show(bodiesNow(), frame.phases);
  while (labels.children.length > stage.geometry.agents.length) labels.lastChild.remove();
  stage.geometry.agents.forEach((agent, i) => {
    const label = labels.children[i] ?? labels.appendChild(document.createElement("div"));
    label.className = agent.role.toLowerCase();
    label.hidden = !places[i];
    if (!places[i]) return;
    label.textContent = `${agent.name} ${frame.speeds_mps[i]?.toFixed(1) ?? ""} m/s`;
    label.style.left = `${places[i][0]}px`; label.style.top = `${places[i][1]}px`;
  });
  // The panels change with the samples only.
  if (drawn === frame) return;
  drawn = frame;
  panel.show(frame, frames);
  byId("timeline").value = at;
  byId("resume").disabled = looked === null || looked >= newest() || state.wheel !== page;
  byId("keep").disabled = !frames[newest()].outcome?.keeps || state.wheel !== page;
}
show();
