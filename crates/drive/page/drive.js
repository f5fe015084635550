// The page of `brakecheck drive`: keys to the program, samples to the screen.

import { Scene3d } from "./scene3d.js";
import { Panel } from "./panel.js";

const byId = (id) => document.getElementById(id);
const choose = (at) => { action = at; sendInput(); };
const scene = new Scene3d(byId("scene")), panel = new Panel(choose);
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
let sent = {}, action = null;
/** Buttons of the gamepad that were held at the last look. */
let pressed = [];

/** Request before the next one. Each waits for it, since two connections have no order. */
let asked = Promise.resolve();
/** Asks the program. Only the page at the wheel is answered. */
function ask(request) {
  if (page === null || state.wheel !== page) return asked;
  const body = JSON.stringify({ page, ask: request });
  const send = async () => {
    const answer = await fetch("do", { method: "POST", headers: { "Content-Type": "application/json" }, body });
    if (!answer.ok) byId("note").textContent = await answer.text();
  };
  // A request that is lost stops no other one.
  asked = asked.then(send).catch(() => {});
  return asked;
}

/** Says who drives. */
function who(now) {
  if (now.wheel !== page) return "You watch: another page is at the wheel.";
  if (stage?.seat.ado !== undefined) return `You are ${stage.ados[stage.seat.ado]}.`;
  return stage?.setup.ego === "you" || !stage ? "You are at the wheel." : "The ego drives by itself.";
}

/** Drivers that the boxes show. */
function players() {
  const moved = panel.egoValues().filter((it) => it.touched).map((it) => [it.name, it.value]);
  return { ego: byId("ego").value, ado: byId("player").value, ego_values: Object.fromEntries(moved) };
}

/** True if the boxes show something else than what is played. */
function isChosenAnew() {
  if (!stage || state.wheel !== page) return false;
  const { setup } = stage, now = players();
  return now.ego !== setup.ego || now.ado !== setup.ado
    || Object.entries(now.ego_values).some(([name, value]) => setup.ego_values[name] !== value)
    || panel.startValues().some((it, at) => it.value !== setup.start[at]);
}

/** Says that a choice is not played yet. */
function showChoice() {
  const isDue = isChosenAnew();
  byId("begin").classList.toggle("due", isDue);
  byId("due").hidden = !isDue;
  if (isDue) forgetOpening();
}

/** Words about the search of this start, until something is played. */
let opening = "";
/** True until the state that follows a new stage. */
let isNewStage = false;
/** True if the stage that is asked for goes at once. */
let goesAtOnce = false;

/** Says what the search found from a start. */
function sayOpening(number) {
  const { search_found: isFound, setup } = stage;
  const from = number === null || number === undefined ? "this start" : `start ${number}`;
  const whose = setup.ego === "you" ? "the world's own ego" : "the ego";
  opening = "";
  if (isFound === true) opening = `The search found a sequence with which ${whose} fails from ${from}. Press Go.`;
  if (isFound === false) opening = `The search found no sequence with which ${whose} fails from ${from}, so the adversary is neutral here. Press Go to drive, or N for the next start.`;
  if (opening) byId("note").textContent = opening;
}
function forgetOpening() {
  if (opening && byId("note").textContent === opening) byId("note").textContent = "";
  opening = "";
}

function newest() { return frames.length - 1; }
function shownAt() { return looked === null ? newest() : Math.min(looked, newest()); }

const receive = {
  stage(it) {
    stage = it; frames = []; looked = null; replay = null; painted = "";
    scene.setStage(it); panel.setStage(it);
    panel.cause = "";
    byId("problems").hidden = true;
    byId("note").textContent = "";
    isNewStage = true;
    byId("timeline").max = Math.round(it.horizon_s / it.sample_s);
    action = null;
    byId("keys").textContent = it.seat.ado === undefined
      ? (it.setup.ego === "you" ? "↑ gas   ↓ brake (Shift: hard)   ← → across   Space go / pause" : "Space go / pause")
      : "1 to 9: your action   Space go / pause";
    if (goesAtOnce) { goesAtOnce = false; ask({ run: true }); }
  },
  geometry(it) { scene.setRoads(it); painted = ""; },
  frame(it) { frames.push(it); looked = null; arrived = performance.now(); forgetOpening(); },
  frames(all) { frames = all; looked = null; arrived = performance.now(); panel.cause = ""; },
  cause(text) { panel.cause = text; drawn = null; },
  state(it) {
    state = it; drawn = null;
    if (isNewStage && newest() < 1) sayOpening(it.number);
    isNewStage = false;
    byId("speed").value = String(it.speed);
    byId("number").value = it.number ?? "";
    byId("number").disabled = it.wheel !== page;
    byId("wheel").textContent = who(it);
    for (const button of document.querySelectorAll("#controls button, #begin")) {
      if (!["camera", "keep", "resume"].includes(button.id)) button.disabled = it.wheel !== page;
    }
    showChoice();
  },
  kept(name) { byId("note").textContent = `Kept as ${name}`; },
  note(text) { byId("note").textContent = text; goesAtOnce = false; },
  problems(text) { byId("problems").textContent = text; byId("problems").hidden = false; },
  page(id) { page = id; },
};

const events = new EventSource("events");
events.onmessage = (event) => {
  for (const [kind, content] of Object.entries(JSON.parse(event.data))) receive[kind]?.(content);
};
events.onerror = () => { byId("wheel").textContent = "The program is gone or does not answer."; };

/** Gamepad that is connected, if any. Its order is that of a standard gamepad. */
function gamepad() {
  for (const it of navigator.getGamepads?.() ?? []) if (it) return it;
  return null;
}

/** Does what buttons of the gamepad say that are newly pressed. */
function pressButtons(pad) {
  if (!pad && !pressed.length) return;
  const now = pad ? pad.buttons.map((it) => it.pressed) : [];
  const isNew = (at) => now[at] && !pressed[at];
  const own = stage.actions[stage.seat.ado]?.length ?? 0;
  // The four buttons on the right are the first four actions, and ↑ and ↓ go through all.
  for (let at = 0; at < Math.min(4, own); at++) if (isNew(at)) action = at;
  if (own) {
    const by = (isNew(13) ? 1 : 0) - (isNew(12) ? 1 : 0);
    if (by) action = Math.max(0, Math.min(own - 1, action === null ? 0 : action + by));
  }
  const others = { 4: actions.back, 5: actions.step, 8: camera, 9: run };
  for (const at in others) if (isNew(at)) others[at]();
  pressed = now;
}

/** Sends what the keys and the gamepad say, whenever it changes. */
function sendInput() {
  if (!stage) return;
  const pad = gamepad();
  pressButtons(pad);
  const strength = held.has("Shift") ? HARD : BRAKE;
  let accel = (held.has("ArrowUp") ? GAS : 0) - (held.has("ArrowDown") ? strength : 0);
  let across = (held.has("ArrowLeft") ? ACROSS : 0) - (held.has("ArrowRight") ? ACROSS : 0);
  if (pad) {
    accel += GAS * (pad.buttons[7]?.value ?? 0) - HARD * (pad.buttons[6]?.value ?? 0);
    if (Math.abs(pad.axes[0]) > 0.1) across -= ACROSS * pad.axes[0];
  }
  if (sent.accel_mps2 === accel && sent.lateral_mps === across && sent.action === action) return;
  sent = { accel_mps2: accel, lateral_mps: across, action };
  ask({ keys: sent });
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
  // At the beginning and after the end, what the boxes show is played.
  if (isChosenAnew() && (newest() < 1 || state.done)) { begin(); goesAtOnce = true; return; }
  // Only "On from here" and "Again" give up what was driven.
  if (state.done || (looked !== null && looked < newest())) watch(); else goOn();
};
const look = (at) => { replay = null; if (state.running) ask({ run: false }); looked = Math.max(0, Math.min(at, newest())); };
/** A search takes seconds in some worlds. */
const sayWait = () => {
  if (byId("player").value === "search") byId("note").textContent = "The search looks for a sequence with which the ego fails …";
};
const begin = () => {
  if (!stage || state.wheel !== page) return;
  sayWait();
  ask({ begin: { ...players(), noise: stage.setup.noise, start: panel.startValues().map((it) => it.value) } });
};
/** Begins a test start with the drivers that the boxes show. */
const beginStart = (request) => {
  if (!stage || state.wheel !== page) return;
  sayWait();
  ask({ players: players() });
  ask(request);
};
const camera = () => { scene.fromAbove = !scene.fromAbove; };

// Requests without a value are words.
const actions = {
  run, back: () => look(shownAt() - 1), resume: goOn, camera, again: begin, begin,
  step: () => (looked !== null && looked < newest() ? look(looked + 1) : ask("step")),
  next: () => beginStart("next"), keep: () => ask("keep"),
};
for (const [id, act] of Object.entries(actions)) {
  byId(id).addEventListener("click", (event) => { act(); event.currentTarget.blur(); });
}
byId("speed").addEventListener("change", (event) => ask({ speed: Number(event.target.value) }));
byId("number").addEventListener("change", (event) => {
  const number = Number(event.target.value);
  if (event.target.value !== "" && Number.isInteger(number) && number >= 0) beginStart({ start: number });
  event.target.blur();
});
for (const id of ["ego", "player"]) {
  byId(id).addEventListener("change", (event) => {
    // The keys drive again.
    event.target.blur();
    forgetOpening();
    if (id === "ego") panel.egoSliders(event.target.value);
    // Nothing is lost where nothing is played yet.
    if (newest() < 1 && !state.running && isChosenAnew()) begin(); else showChoice();
  });
}
byId("setup").addEventListener("input", showChoice);
// Arrow keys drive, and must not move the slider.
byId("timeline").addEventListener("change", (event) => event.target.blur());
byId("signals").parentElement.addEventListener("toggle", () => { drawn = null; });
byId("timeline").addEventListener("input", (event) => look(Number(event.target.value)));

const KEYS = { " ": run, ",": actions.back, ".": actions.step, c: camera, r: begin, n: actions.next, k: actions.keep };
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

/** Poses of the picture, made once. */
const poses = [];
/** Poses between the last two samples, so that motion is smooth. */
function bodiesNow() {
  const at = shownAt(), now = frames[at], before = frames[at - 1];
  if (looked !== null || !before || !state.running) return now.placements;
  const share = Math.min(1, (performance.now() - arrived) / (1000 * stage.sample_s / state.speed));
  poses.length = now.placements.length;
  now.placements.forEach((body, i) => {
    const pose = poses[i] ??= [];
    for (let k = 0; k < body.length; k++) {
      const from = before.placements[i][k];
      // Opposite quaternions are the same orientation.
      pose[k] = k < 3 || from * body[k] > -0.5 ? from + (body[k] - from) * share : body[k];
    }
  });
  return poses;
}

/** Time between pictures that is too long. */
const LATE_MS = 22;
/** Pictures of which more than a tenth may not be late, and those without one before a try for more. */
const WINDOW = 60, CALM = 300;
/** Sharpness of moving pictures: less where they come too late, as on a slow processor. */
const pace = {
  before: 0, pictures: 0, late: 0, calm: 0, patience: CALM, sharpness: 1,
  picture(now) {
    const passed = now - this.before;
    this.before = now;
    // A page in the background draws nothing for a long time.
    const isLate = passed > LATE_MS && passed < 500;
    this.late += isLate ? 1 : 0;
    this.calm = isLate ? 0 : this.calm + 1;
    if (this.sharpness < 1 && this.calm >= this.patience) {
      this.calm = 0;
      this.sharpness = Math.min(1, 1.25 * this.sharpness);
      // A try that fails is repeated later.
      this.patience *= 2;
    }
    if (++this.pictures < WINDOW) return;
    if (this.late > WINDOW / 10) this.sharpness = Math.max(0.35, 0.8 * this.sharpness);
    this.pictures = this.late = 0;
  },
};

/** Writes a text that changed: every write costs a layout of the page. */
const write = (at, text) => { if (at.textContent !== text) at.textContent = text; };

/** Time between two changes of the numbers while they run, which nobody reads faster. */
const NUMBERS_MS = 100;
let numbered = 0;

/** Height of a label, and the mean width of its letters and its sides. */
const LABEL_PX = 19, LETTER_PX = 6.4, SIDES_PX = 12;
/** Places of the labels where none covers another. The nearest car, lowest in the picture, keeps its own. */
function apart(places) {
  const set = [], apart = [...places];
  const width = (at) => SIDES_PX + LETTER_PX * (labels.children[at]?.textContent.length ?? 0);
  const order = places.map((_, at) => at).filter((at) => places[at]).sort((a, b) => places[b][1] - places[a][1]);
  for (const at of order) {
    const own = { x: places[at][0], y: places[at][1], width: width(at) };
    const covers = (it) => Math.abs(it.x - own.x) < 0.5 * (it.width + own.width) && Math.abs(it.y - own.y) < LABEL_PX;
    // Every move leaves at least one label below, so it ends.
    for (let hit = set.find(covers); hit; hit = set.find(covers)) own.y = hit.y - LABEL_PX - 1;
    set.push(own);
    apart[at] = [own.x, own.y];
  }
  return apart;
}

/** What the last picture showed, beside its sample. */
let painted = "";
const labels = byId("labels");
function show(now) {
  requestAnimationFrame(show);
  sendInput();
  if (!stage || !frames.length) return;
  if (replay) {
    const played = (performance.now() - replay.since) / (1000 * stage.sample_s / state.speed);
    looked = Math.min(newest(), replay.from + Math.floor(played));
    if (looked === newest()) { replay = null; looked = null; }
  }
  write(byId("run"), state.running || replay ? "❚❚ Pause" : "▶ Go");
  const at = shownAt(), frame = frames[at], isMoving = state.running && looked === null;
  if (isMoving) pace.picture(now);
  scene.sharpness = isMoving ? pace.sharpness : 1;
  const canvas = scene.canvas;
  const view = [canvas.clientWidth, canvas.clientHeight, devicePixelRatio, scene.fromAbove, scene.sharpness, isMoving].join();
  if (!isMoving && drawn === frame && painted === view) return;
  painted = view;
  const isDue = !isMoving || now - numbered >= NUMBERS_MS;
  const places = apart(scene.show(bodiesNow(), frame.phases, frame.seen));
  const taken = frame.action?.split(" | ") ?? [];
  while (labels.children.length > stage.geometry.agents.length) labels.lastChild.remove();
  stage.geometry.agents.forEach((agent, i) => {
    const label = labels.children[i] ?? labels.appendChild(document.createElement("div"));
    if (isDue) {
      label.className = agent.role.toLowerCase();
      const unseen = frame.seen?.[i] === false ? ", not seen by the ego" : "";
      const action = taken.length === stage.ados.length ? taken[stage.ados.indexOf(agent.name)] : undefined;
      write(label, `${agent.name} ${frame.speeds_mps[i]?.toFixed(1) ?? ""} m/s${action ? `, ${action}` : ""}${unseen}`);
    }
    if (label.hidden !== !places[i]) label.hidden = !places[i];
    if (!places[i]) return;
    label.style.transform = `translate(${places[i][0]}px, ${places[i][1]}px) translate(-50%, -100%)`;
  });
  // The panels change with the samples only.
  if (drawn === frame || !isDue) return;
  drawn = frame; numbered = now;
  panel.show(frame, frames);
  byId("timeline").value = at;
  byId("resume").disabled = looked === null || looked >= newest() || state.wheel !== page;
  byId("keep").disabled = !frames[newest()].outcome?.keeps || state.wheel !== page;
}
requestAnimationFrame(show);
