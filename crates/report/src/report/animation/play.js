// Moves what the page already shows: it loads nothing and needs nothing else.
"use strict";
for (const figure of document.querySelectorAll(".film")) {
  // Names of lists are explained in src/report/animation/data.rs.
  const film = JSON.parse(figure.dataset.film);
  const find = (what) => figure.querySelector(what);
  const all = (what) => [...figure.querySelectorAll(what)];
  const [stage, world, ghosts, met, past, burst] =
    [".stage", ".world", ".ghosts", ".met", ".met .past", ".stage > .burst"].map(find);
  const [bodies, labels, lights] = [".stage .body", ".stage .label", ".stage .light"].map(all);
  const [button, back, on, slider, rate, clock, event, ending] =
    [".play", ".back", ".on", "input", ".rate", ".clock", ".event", ".ending"].map(find);
  const contact = event.textContent;
  const end = film.t.at(-1);
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const places = labels.map(() => 0);
  // Shown over and over: up to the contact, or a little beyond the violation.
  const [from, until] = [Math.max(0, film.still - 4), film.contact ? end : Math.min(end, film.still + 1)];
  let [time, playing, previewing, speed, before, hold] = [film.still, false, false, 1, 0, 0];
  let [width, height] = [0, 0];

  // Where a time lies between two samples.
  function place(t) {
    let [low, high] = [0, film.t.length - 1];
    while (low + 1 < high) {
      const middle = (low + high) >> 1;
      if (film.t[middle] <= t) low = middle; else high = middle;
    }
    const span = film.t[high] - film.t[low];
    return [low, high, span ? Math.min(1, Math.max(0, (t - film.t[low]) / span)) : 1];
  }
  const between = (list, [low, high, share]) => list[low] + share * (list[high] - list[low]);
  const turned = (x, y) => [
    x * Math.cos(film.turn) + y * Math.sin(film.turn),
    y * Math.cos(film.turn) - x * Math.sin(film.turn),
  ];
  const clamp = (value, low, high) => Math.min(Math.max(value, low), Math.max(low, high));

  // As camera.rs, for a screen of any width.
  function camera(at, poses) {
    const wide = width >= 700;
    const foot = wide ? 36 : 64;
    const margin = wide ? [120, 62] : [40, 62];
    const room = [width, height - foot];
    const [u, v, w, h] = film.focus.map((list) => between(list, at));
    const fits = [(room[0] - 2 * margin[0]) / Math.max(w, 0.1), (room[1] - 2 * margin[1]) / Math.max(h, 0.1)];
    const view = (scale, centre) => ({ room, scale, centre, to: ([a, b]) => [
      0.5 * room[0] + (a - centre[0]) * scale, 0.5 * room[1] - (b - centre[1]) * scale] });
    if (film.cells) return view(Math.min(...fits), [u, v]);
    const own = poses[film.ego];
    const length = film.bodies[film.ego].size[0];
    const least = (wide ? Math.max(60, width / 18) : 40) / length;
    const scale = Math.max(least, Math.min(...fits, room[1] / 8.5));
    const centre = [u, v].map((middle, axis) => {
      const reach = Math.max(0, (0.5 * room[axis] - Math.min(margin[axis], 40)) / scale - 0.5 * length);
      return clamp(middle, own.at[axis] - reach, own.at[axis] + reach);
    });
    return view(scale, centre);
  }

  function words(who, pose, inside) {
    const body = film.bodies[who];
    if (film.cells) return [body.name];
    if (!inside) {
      const own = film.poses[film.ego];
      return [`${body.name}, ${Math.hypot(own.x - pose.x, own.y - pose.y).toFixed(0)} m away`];
    }
    const first = `${body.name} ${pose.v.toFixed(1)} m/s`;
    const move = body.moves.findLast((it) => it[0] < time + 1e-9);
    if (move) return [first, move[1]];
    if (pose.a < -0.5) return [first, `brakes −${(-pose.a).toFixed(1)} m/s²`];
    if (0.5 < pose.a) return [first, `speeds up +${pose.a.toFixed(1)} m/s²`];
    return [first];
  }

  // As labels.rs; a label stays on its side as long as nothing else is there.
  function label(who, lines, room, taken, view) {
    const w = 7.4 * Math.max(...lines.map((line) => [...line].length)) + 12;
    const h = 15 * lines.length + 6;
    const x = 0.5 * (room[0] + room[2] - w);
    const y = 0.5 * (room[1] + room[3] - h);
    const [above, below] = [[x, room[1] - h - 6], [x, room[3] + 6]];
    const [behind, ahead] = [[room[0] - w - 6, y], [room[2] + 6, y]];
    const wanted = who === film.ego ? [below, above, behind, ahead] : [above, below, ahead, behind];
    const far = wanted.map(([a, b]) => [a, b + Math.sign(b - y) * (h + 6)]);
    const highest = Math.min(28, view.room[1] - h);
    const rings = [];
    for (let ring = 1; ring <= 14; ring++) for (let spot = 0; spot < 16; spot++) {
      const turn = 2 * Math.PI * spot / 16;
      rings.push([x + Math.cos(turn) * (0.5 * (room[2] - room[0] + w) + 14 * ring),
        y + Math.sin(turn) * (0.5 * (room[3] - room[1] + h) + 14 * ring)]);
    }
    const spots = [...wanted, ...far, ...rings].map(([a, b]) => [
      clamp(a, 4, view.room[0] - w - 4), clamp(b, highest, view.room[1] - h)]);
    const free = ([a, b]) => taken.every((it) => a + w <= it[0] || it[2] <= a || b + h <= it[1] || it[3] <= b);
    if (!free(spots[places[who]])) places[who] = Math.max(0, spots.findIndex(free));
    const [a, b] = spots[places[who]];
    taken.push([a, b, a + w, b + h]);
    const group = labels[who];
    group.setAttribute("transform", `translate(${a.toFixed(1)} ${b.toFixed(1)})`);
    const box = group.querySelector("rect");
    box.setAttribute("width", w.toFixed(1));
    box.setAttribute("height", h);
    const [u, v] = [clamp(0.5 * (room[0] + room[2]), 0, width), clamp(0.5 * (room[1] + room[3]), 0, height)];
    const ends = { x1: u - a, y1: v - b, x2: clamp(u - a, 0, w), y2: clamp(v - b, 0, h) };
    for (const end in ends) group.querySelector("line").setAttribute(end, ends[end].toFixed(1));
    const texts = group.querySelectorAll("text");
    texts[0].textContent = lines[0];
    texts[1].textContent = lines[1] ?? "";
  }

  function draw() {
    const at = place(time);
    const poses = film.poses = film.bodies.map((body) => {
      const [x, y, h, v, a] = [body.x, body.y, body.h, body.v, body.a].map((list) => between(list, at));
      return { x, y, h, v, a, at: turned(x, y) };
    });
    const view = camera(at, poses);
    const { scale, centre, room } = view;
    world.setAttribute("transform",
      `translate(${0.5 * room[0]} ${0.5 * room[1]}) scale(${scale} ${-scale}) ` +
      `translate(${-centre[0]} ${-centre[1]}) rotate(${-film.turn * 180 / Math.PI})`);
    const rooms = poses.map((pose, who) => {
      bodies[who].setAttribute("transform", `translate(${pose.x} ${pose.y}) rotate(${pose.h * 180 / Math.PI})`);
      bodies[who].classList.toggle("braking", pose.a < -0.8);
      const [x, y] = view.to(pose.at);
      const [l, w] = film.bodies[who].size.map((size) => 0.5 * size * scale);
      const [s, c] = [Math.abs(Math.sin(pose.h - film.turn)), Math.abs(Math.cos(pose.h - film.turn))];
      return [x - l * c - w * s, y - l * s - w * c, x + l * c + w * s, y + l * s + w * c];
    });
    const taken = [...rooms];
    rooms.forEach((box, who) => {
      const inside = 0 < box[2] && box[0] < width && 0 < box[3] && box[1] < height;
      label(who, words(who, poses[who], inside), box, taken, view);
    });
    lights.forEach((light, nth) => {
      const now = film.lights[nth].findLast((it) => it[0] <= time + 1e-9);
      light.setAttribute("class", `light is-${now[1]}`);
    });
    const [broken, over] = [film.broken <= time + 1e-3, film.still <= time + 1e-3];
    ghosts.style.display = broken ? "" : "none";
    if (burst) {
      const [x, y] = view.to(film.contact);
      burst.setAttribute("transform", `translate(${x} ${y})`);
      // Bodies that roll on cover the place of the contact.
      burst.style.display = over && !(past && film.still + 0.4 < time) ? "" : "none";
    }
    met.style.display = over ? "" : "none";
    past?.setAttribute("transform", `scale(${1 / scale})`);
    clock.textContent = `${time.toFixed(2)} s`;
    const touching = over && film.contact;
    event.className = `event ${touching ? "k-contact" : "k-broken"}`;
    const later = film.after?.findLast((it) => it[0] <= time + 1e-3);
    event.textContent = later ? later[1] : touching ? contact : `Requirement broken: ${film.leaf}`;
    event.style.visibility = touching || broken ? "visible" : "hidden";
    ending.classList.toggle("shown", over);
    slider.value = 1000 * time / end;
    button.textContent = playing ? "❚❚" : "▶";
    button.setAttribute("aria-label", playing ? "Pause" : "Play");
  }

  function step(now) {
    if (!playing) return;
    const passed = Math.min(0.1, (now - before) / 1000);
    before = now;
    const last = previewing ? until : end;
    if (time < last) {
      time = Math.min(last, time + speed * passed);
      hold = 0;
      draw();
    } else if (previewing && (hold += passed) > 3) {
      time = from;
    } else if (!previewing) {
      playing = false;
      draw();
    }
    requestAnimationFrame(step);
  }
  function play(preview) {
    [playing, previewing] = [true, preview];
    if (preview) time = from; else if (end <= time) time = 0;
    before = performance.now();
    requestAnimationFrame(step);
  }
  let touched = false;
  function go(to) {
    [touched, playing, time] = [true, false, to];
    draw();
  }
  function fit() {
    width = figure.clientWidth || 1190;
    height = width >= 700 ? clamp(width * 0.286, 260, 340) : 290;
    stage.setAttribute("viewBox", `0 0 ${width} ${height}`);
    draw();
  }

  button.onclick = () => {
    touched = true;
    if (playing) go(time); else play(false);
    draw();
  };
  slider.oninput = () => go(slider.value / 1000 * end);
  const rates = [[1, "1×"], [0.5, "½×"], [0.25, "¼×"], [0.1, "⅒×"], [2, "2×"]];
  rate.onclick = () => {
    const [next, words] = rates[(rates.findIndex(([it]) => it === speed) + 1) % rates.length];
    [speed, rate.textContent] = [next, words];
  };
  // To a neighbouring sample, also from a time between two of them.
  const samples = {
    back: () => go(film.t.findLast((t) => t < time - 1e-6) ?? 0),
    on: () => go(film.t.find((t) => time + 1e-6 < t) ?? end),
  };
  back.onclick = samples.back;
  on.onclick = samples.on;
  const keys = {
    " ": () => button.click(), s: () => rate.click(), Home: () => go(0), End: () => go(end),
    ",": samples.back, ".": samples.on, ArrowLeft: samples.back, ArrowRight: samples.on,
  };
  figure.onkeydown = (event) => {
    // Space presses the button that has the focus.
    const presses = event.key === " " && event.target.tagName === "BUTTON";
    if (!(event.key in keys) || presses || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    keys[event.key]();
  };
  for (const thumb of all(".thumb")) thumb.onclick = () => go(Math.min(end, +thumb.dataset.t));
  figure.classList.add("live");
  fit();
  addEventListener("resize", fit);
  // What comes into view plays its last seconds over and over, unless somebody
  // wants no motion or has taken hold of it.
  if (!still && "IntersectionObserver" in window) {
    new IntersectionObserver(([seen]) => {
      if (touched) return;
      if (seen.isIntersecting) play(true); else playing = false;
    }, { threshold: 0.6 }).observe(find(".screen"));
  }
}
