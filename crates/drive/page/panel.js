// The panels beside the scene: margins, numbers, the adversary's values, sliders.

const byId = (id) => document.getElementById(id);
const element = (name, text, kind) => {
  const made = document.createElement(name);
  // As text: names come from files of others.
  if (text !== undefined) made.textContent = text;
  if (kind) made.className = kind;
  return made;
};
const number = (value, digits = 2) => (value === null || value === undefined ? "–" : value.toFixed(digits));
const signed = (value) => (value === null ? "∞" : (value > 0 ? "+" : value < 0 ? "−" : "") + Math.abs(value).toFixed(2));
export const PLAYERS = {
  neutral: "neutral: it does nothing", trained: "the trained ado",
  random: "random actions", search: "a search's sequence",
};

/** Symmetric logarithm: shows the sign near 0 and the size far from it. */
const symlog = (value) => Math.sign(value) * Math.log1p(Math.abs(value));

/** Most joint actions whose words are told apart. */
const MOST_JOINT = 4096;

export class Panel {
  /** `choose` is called with an action of your ado that is pressed in its list. */
  constructor(choose) {
    this.choose = choose;
    /** Cause of the failure, once the program has it. */
    this.cause = "";
    /** Words of the verdict that is shown. */
    this.said = "";
  }

  setStage(stage) {
    this.stage = stage;
    byId("world").textContent = stage.world;
    byId("question").textContent = stage.question;
    const names = [["The ego's specification", stage.spec], ...stage.rules.map((it) => [`${it.ado}: ${it.name}`, `rule of ${it.ado}`])];
    this.rows = names.map(([name, about]) => {
      const row = element("div", undefined, "margin"), bar = element("div", undefined, "bar"), fill = element("i");
      const value = element("div", "", "number"), label = element("div", name, "name");
      label.title = about;
      bar.append(fill); row.append(label, value, bar);
      return { row, value, fill };
    });
    byId("margins").replaceChildren(...this.rows.map((it) => it.row));
    this.fillActions(stage);
    this.fillSetup(stage);
  }

  /** Lists the actions of every ado. Those of your own can be pressed. */
  fillActions(stage) {
    this.actions = stage.actions.map((labels, ado) => labels.map((label, at) => {
      const own = stage.seat.ado === ado;
      const row = element(own ? "button" : "div", undefined, "action");
      row.append(element("span", own && at < 9 ? `${at + 1}: ${label}` : label), element("b"));
      if (own) row.addEventListener("click", () => { this.choose(at); row.blur(); });
      return row;
    }));
    byId("actions").replaceChildren(...stage.ados.flatMap((name, ado) => {
      const title = element("h3", stage.seat.ado === ado ? `${name} (you)` : name);
      return stage.ados.length > 1 ? [title, ...this.actions[ado]] : this.actions[ado];
    }));
    byId("ado").classList.toggle("own", stage.seat.ado !== undefined);
    const count = stage.actions.reduce((product, own) => product * own.length, 1);
    // From the words of a joint action to its number.
    this.joint = new Map(Array.from({ length: count > MOST_JOINT ? 0 : count }, (_, at) => [this.inWords(at), at]));
  }

  /** The parts of a joint action. The first ado is the lowest digit. */
  parts(joint) {
    return this.stage.actions.map((own) => {
      const part = joint % own.length;
      joint = Math.floor(joint / own.length);
      return part;
    });
  }

  inWords(joint) {
    return this.parts(joint).map((part, ado) => this.stage.actions[ado][part]).join(" | ");
  }

  fillSetup(stage) {
    const options = (id, values, shown, chosen) => byId(id).replaceChildren(...values.map((value) => {
      const option = element("option", shown(value));
      option.value = value; option.selected = value === chosen;
      return option;
    }));
    const egoName = (name) => ({ you: "you", nominal: "the world's own" }[name] ?? name);
    options("ego", stage.egos, egoName, stage.setup.ego);
    options("player", stage.players, (it) => PLAYERS[it], stage.setup.ado);
    this.startValues = this.sliders("start-sliders", stage.start_sliders, {});
    this.egoSliders(stage.setup.ego);
    // With one ado in your seat there is no other to choose a player for.
    byId("player").disabled = stage.seat.ado !== undefined && stage.ados.length === 1;
  }

  /** Shows the parameters of an ego, with the values of the episode if it is its ego. */
  egoSliders(ego) {
    const { egos, ego_sliders, setup } = this.stage, sliders = ego_sliders[egos.indexOf(ego)] ?? [];
    this.egoValues = this.sliders("ego-sliders", sliders, ego === setup.ego ? setup.ego_values : {});
    if (!sliders.length) byId("ego-sliders").textContent = "This ego has none.";
  }

  /** Builds sliders, and returns a function that gives their values. */
  sliders(id, sliders, values) {
    const inputs = sliders.map((slider) => {
      const row = element("label", undefined, "slider"), input = element("input"), shown = element("output");
      input.type = "range"; input.min = slider.lo; input.max = slider.hi; input.step = "any";
      input.value = values[slider.name] ?? slider.value;
      const exact = { value: values[slider.name] ?? slider.value };
      const show = () => { shown.textContent = exact.value.toFixed(2); };
      // An untouched slider keeps the exact value, which a range input may round.
      input.addEventListener("input", () => { exact.value = Number(input.value); exact.touched = true; show(); });
      show();
      const label = element("span", slider.name);
      label.title = slider.about;
      row.append(label, shown, input);
      return { row, exact, slider };
    });
    byId(id).replaceChildren(...inputs.map((it) => it.row));
    return () => inputs.map((it) => ({ name: it.slider.name, value: it.exact.value, touched: Boolean(it.exact.touched) || it.slider.name in values }));
  }

  /** Shows a sample. `frames` are all of the episode, for the curve. */
  show(frame, frames) {
    const margins = [frame.spec, ...frame.rules];
    this.rows.forEach(({ row, value, fill }, at) => {
      const margin = margins[at], isBroken = margin !== null && margin <= 0;
      row.classList.toggle("broken", isBroken);
      value.textContent = signed(margin);
      const share = margin === null ? 50 : 50 * Math.min(1, Math.abs(symlog(margin)) / symlog(50));
      fill.style.width = `${share}%`;
      fill.style.left = isBroken ? `${50 - share}%` : "50%";
    });
    const isAfter = frame.outcome && frame.time_s > frame.outcome.time_s;
    byId("counts").textContent = isAfter ? "after the verdict" : "above 0 is kept";
    this.curve(frame, frames);
    this.table(frame);
    this.showActions(frame);
    byId("clock").textContent = `${frame.time_s.toFixed(2)} s`;
    this.verdict(frame.outcome);
  }

  table(frame) {
    const rows = this.stage.geometry.agents.map((agent, at) => [`${agent.name}, speed`, `${number(frame.speeds_mps[at], 1)} m/s`]);
    const signal = (names, title, digits) => {
      const at = this.stage.signals.findIndex(([name]) => names.includes(name));
      if (at >= 0) rows.push([title, `${number(frame.signals[at], digits)} ${this.stage.signals[at][1]}`]);
    };
    signal(["gap", "ado.gap", "clearance"], "gap", 1);
    signal(["headway"], "headway", 1);
    signal(["ttc", "ado.ttc", "time_to_collision"], "time to collision", 2);
    if (frame.value !== null) rows.push(["value of the trained ado", number(frame.value)]);
    this.fill("numbers", rows);
    if (byId("signals").parentElement.open) {
      this.fill("signals", this.stage.signals.map(([name, unit], at) => [name, `${number(frame.signals[at], 3)} ${unit}`]));
    }
  }

  fill(id, rows) {
    const table = byId(id);
    while (table.rows.length > rows.length) table.deleteRow(-1);
    rows.forEach(([name, value], at) => {
      const row = table.rows[at] ?? table.insertRow();
      const cells = [row.cells[0] ?? row.insertCell(), row.cells[1] ?? row.insertCell()];
      if (cells[0].textContent !== name) cells[0].textContent = name;
      if (cells[1].textContent !== value) cells[1].textContent = value;
    });
  }

  /** Marks the actions that are taken, with the trained ado's value of each. */
  showActions(frame) {
    const joint = this.joint.get(frame.action), taken = joint === undefined ? [] : this.parts(joint);
    const isOne = this.actions.length === 1;
    this.actions.forEach((rows, ado) => rows.forEach((row, at) => {
      row.classList.toggle("chosen", taken[ado] === at);
      row.lastChild.textContent = isOne && at in frame.values ? frame.values[at].toFixed(3) : "";
    }));
    // Joint actions are too many to list: the best eight.
    const ranked = isOne ? [] : frame.values.map((value, at) => [value, at]).sort((a, b) => b[0] - a[0]).slice(0, 8);
    if (isOne && !byId("values").firstChild) return;
    byId("values").replaceChildren(...(ranked.length ? [element("h3", "best together")] : []), ...ranked.map(([value, at]) => {
      const row = element("div", undefined, at === joint ? "action chosen" : "action");
      row.append(element("span", this.inWords(at)), element("b", value.toFixed(3)));
      return row;
    }));
  }

  /** Margins over time, on an axis that shows where they cross 0. */
  curve(frame, frames) {
    const canvas = byId("curve"), draw = canvas.getContext("2d"), { width, height } = canvas;
    draw.clearRect(0, 0, width, height);
    const count = 1 + this.stage.rules.length, top = symlog(50);
    const x = (time) => 4 + (width - 8) * time / this.stage.horizon_s;
    const y = (value) => height / 2 - (height / 2 - 4) * Math.max(-1, Math.min(1, symlog(value) / top));
    draw.strokeStyle = "#586675"; draw.beginPath(); draw.moveTo(0, y(0)); draw.lineTo(width, y(0)); draw.stroke();
    for (let line = count - 1; line >= 0; line--) {
      draw.strokeStyle = line === 0 ? "#58a6ff" : "#ffab4a80"; draw.lineWidth = line === 0 ? 4 : 2;
      draw.beginPath();
      let open = false;
      for (const it of frames) {
        const value = line === 0 ? it.spec : it.rules[line - 1];
        if (value === null) { open = false; continue; }
        draw[open ? "lineTo" : "moveTo"](x(it.time_s), y(value)); open = true;
      }
      draw.stroke();
    }
    draw.strokeStyle = "#e8edf2"; draw.lineWidth = 1;
    draw.beginPath(); draw.moveTo(x(frame.time_s), 0); draw.lineTo(x(frame.time_s), height); draw.stroke();
  }

  verdict(outcome) {
    const banner = byId("verdict");
    banner.hidden = !outcome;
    if (!outcome) return;
    banner.className = `over ${outcome.verdict}`;
    const words = [`${outcome.words} (decided at ${outcome.time_s.toFixed(2)} s)`, this.why(outcome)];
    // An equal text that is written again is read out again.
    if (this.said === words.join()) return;
    this.said = words.join();
    banner.replaceChildren(...words.filter(Boolean).map((it, at) => element("div", it, at ? "why" : undefined)));
  }

  /** Why an episode ended so. */
  why(outcome) {
    if (outcome.verdict !== "foul") return this.cause;
    const rule = this.stage.rules[outcome.broken[0]];
    return `${rule?.ado ?? "An ado"} broke its rule first, so this start gives no answer about the ego.`;
  }
}
