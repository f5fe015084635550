#!/usr/bin/env python3
"""What a rule-keeping ado does to other people's egos: pip install libsumo highway-env fiss-planner fmpy

    python3 examples/egos/gallery.py target/release/brakecheck runs/acc_iso 40 124 [Mine.fmu …] > gallery.md

RUN is what `train worlds/acc_iso.ron --seed 120` made; 40 starts of seed 124, which training never saw.
A success counts if the cars touch and a careful driver would have avoided it; search has one switch.
"""
import json
import pathlib
import subprocess
import sys

EGOS = {
    "SUMO Krauss": ("sumo.py", "Krauss", "sigma=0"),
    "SUMO IDM": ("sumo.py", "IDM"),
    "SUMO EIDM": ("sumo.py", "EIDM", "sigmaerror=0"),
    "SUMO ACC": ("sumo.py", "ACC"),
    "SUMO CACC": ("sumo.py", "CACC"),
    "highway-env IDM": ("highway.py",),
    "highway-env IDM, sporty": ("highway.py", "TIME_WANTED=0.5", "DISTANCE_WANTED=2"),
    "MPC": ("mpc.py",),
    "MPC, brakes with 3.5 m/s²": ("mpc.py", "brake_mps2=3.5"),
    "fiss-planner, FISS+": ("fiss.py", "fiss_plus"),
}
HERE = pathlib.Path(__file__).parent


def percent(row):
    return f"{100 * row['success_rate']:.0f} %"


def closing(row):
    speed = row.get("closing_speed_mps")
    return "–" if not speed else f"{speed['median']:.1f} / {speed['p90']:.1f}"


def main(program, run, starts, seed, *fmus):
    print("| ego | trained, untouched | held random | best constant | search, one switch | adapted by 100 runs [95 %] "
          "| closing m/s, median / 90 % | expected |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |", flush=True)
    for name, (script, *words) in {**EGOS, **{fmu: ("fmu.py", fmu) for fmu in fmus}}.items():
        ego = [sys.executable, str(HERE / script), *words]
        command = [program, "eval", run, "--starts", starts, "--seed", seed, "--runs", "100",
                   "--search", "1", "--json", "--", *ego]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True)
        if done.returncode:
            sys.exit(f"{name}: brakecheck ended with {done.returncode}")
        found = json.loads(done.stdout)
        # Held random actions have two rows, the first one with one run per start.
        rows = {row["ado"]: row for row in reversed(found["rows"])}
        low, high = rows["adapted"]["ci95"]
        cells = [name, percent(rows["trained"]), percent(rows["hold"]), percent(rows["constant"]), percent(rows["search"]),
                 f"{percent(rows['adapted'])} [{100 * low:.0f}, {100 * high:.0f}]", closing(rows["adapted"]),
                 f"{100 * found['adapted'][0]['expected']:.0f} %"]
        print("| " + " | ".join(cells) + " |", flush=True)


main(*sys.argv[1:])
