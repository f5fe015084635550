"""Lets esmini drive the ego against a trained ado that brakecheck moves and judges.

    python3 esmini_bridge.py RUN MODEL [STARTS] [KEEP]

RUN is a training in a world with an ego and an ado on two straight lanes, such as cut_in, or
that world itself, whose ados are then neutral.
MODEL is one of esmini's ALKS drivers: Regulation, ReferenceDriver, RSS or FSM.
ESMINI_LIB is the path of libesminiLib.so, BRAKECHECK that of brakecheck.
"""
import ctypes as c, json, math, os, pathlib, subprocess, sys

run, model, starts, keep = (sys.argv[1:] + ["40", ""][len(sys.argv) - 3:])[:4]
here = pathlib.Path(__file__).resolve().parent
template, road = (here / "two_cars.xosc").read_text(), str(here / "two_lanes.xodr")
esmini = c.CDLL(os.environ["ESMINI_LIB"])
AXLE_TO_FRONT_M = 2.7 + 0.92  # esmini's reference point is the rear axle, ours the front


class State(c.Structure):  # the beginning of SE_ScenarioObjectState, and room for its rest
    _fields_ = ([(name, c.c_int) for name in ("id", "model", "control")] + [("time", c.c_double)]
                + [(name, c.c_double) for name in ("x", "y", "z", "h", "p", "r")]
                + [(name, c.c_int) for name in ("road", "junction")] + [("t", c.c_double)]
                + [("lane", c.c_int), ("offset", c.c_double), ("s", c.c_double), ("speed", c.c_double)]
                + [("rest", c.c_char * 256)])


def axle(body):  # front bumper to rear axle
    x, y, h = body["x_m"], body["y_m"], body["heading_rad"]
    return {"x": x - AXLE_TO_FRONT_M * math.cos(h), "y": y - AXLE_TO_FRONT_M * math.sin(h), "h": h, "speed": body["speed_mps"]}


def ask(**message):
    print(json.dumps(message), file=ado.stdin, flush=True)
    answer = json.loads(ado.stdout.readline())
    return answer if "error" not in answer else sys.exit(answer["error"])


command = [os.environ.get("BRAKECHECK", "brakecheck"), "serve", run] + ["--keep", keep] * bool(keep)
ado = subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
hello = ask(hello={"protocol": 1})["hello"]
sizes = {agent["name"]: agent | {"axle_m": AXLE_TO_FRONT_M - agent["length_m"] / 2} for agent in hello["agents"]}
failures, steps = 0, round(hello["sample_s"] / 0.01)
for index in range(int(starts)):
    now = ask(reset={"seed": 0, "index": index})
    cars = {name: sizes[name] | axle(body) for name, body in now["bodies"].items()}
    args = [b"", b"--osc_str", template.format(road=road, model=model, **cars).encode(), b"--headless", b"--disable_stdout", b"--disable_log"]
    assert esmini.SE_InitWithArgs(len(args), (c.c_char_p * len(args))(*args)) == 0, "esmini refuses the scenario"
    state, (ego_id, ado_id) = State(), (esmini.SE_GetIdByName(name) for name in (b"ego", b"ado"))
    while not now["done"]:
        car = {key: c.c_double(value) for key, value in axle(now["bodies"]["ado"]).items()}
        esmini.SE_ReportObjectPosXYH(ado_id, car["x"], car["y"], car["h"])
        esmini.SE_ReportObjectSpeed(ado_id, car["speed"])
        for _ in range(steps):  # esmini's drivers need finer steps than a sample
            esmini.SE_StepDT(c.c_double(hello["sample_s"] / steps))
        esmini.SE_GetObjectState(ego_id, c.byref(state))
        front = [place + AXLE_TO_FRONT_M * turn(state.h) for place, turn in ((state.x, math.cos), (state.y, math.sin))]
        now = ask(sample={"ego": {"x_m": front[0], "y_m": front[1], "heading_rad": state.h, "speed_mps": state.speed}})
    esmini.SE_Close()
    failures += now["is_success"]
    print(index, now["verdict"], f"{now['time_s']:.2f} s", now["broken_rule"] or "", now["contact"] or "", now.get("kept", now.get("not_kept", "")))
print(f"{model} fails from {failures} of {starts} starts, every rule judged")
