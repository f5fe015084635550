// The page of `brakecheck drive`: keys to the program, samples to the screen.

import { Scene3d } from "./scene3d.js";
import { Panel } from "./panel.js";

const byId = (id) => document.getElementById(id);
const scene = new Scene3d(byId("scene")), panel = new Panel();
// Strength of the keys: m/s² along the road, m/s across it. Shift brakes as hard as it gets.
const GAS = 3, BRAKE = 5, HARD = 9, ACROSS = 1.5;

let page = null, stage = null, frames = [], state = { running: false, done: false, speed: 1, wheel: null };
/** Sample that is looked at, or null for the newest. */
let looked = null;
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

function newest() { return frames.length - 1; }
function shownAt() { return looked === null ? newest() : Math.min(looked, newest()); }

const receive = {
  stage(it) {
    stage = it; frames = []; looked = null;
    scene.setStage(it); panel.setStage(it);
    byId("problems").hidden = true;
    byId("note").textContent = "";
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
    byId("run").textContent = it.running ? "❚❚ Pause" : "▶ Go";
    byId("speed").value = String(it.speed);
    byId("wheel").textContent = it.wheel === page ? "You are at the wheel." : "You watch: another page is at the wheel.";
    for (const button of document.querySelectorAll("#controls button, #begin")) {
      if (!["camera", "keep", "resume"].includes(button.id)) button.disabled = it.wheel !== page;
    }
  },
  kept(name) { byId("note").textContent = `Kept as ${name}. The terminal shows where.`; },
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
  if (state.done && looked === null) await again();
  // From the moment that is looked at: what was played after it is given up.
  if (looked !== null && looked < newest()) await ask({ back: looked });
  await ask({ run: true });
}
const run = () => (state.running ? ask({ run: false }) : goOn());
const look = (at) => { if (state.running) ask({ run: false }); looked = Math.max(0, Math.min(at, newest())); };
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
let drawn = null;
function show() {
  requestAnimationFrame(show);
  sendInput();
  if (!stage || !frames.length) return;
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
