#!/usr/bin/env python3
"""What a rule-keeping ado does to other people's egos: pip install libsumo highway-env

    python3 examples/egos/gallery.py target/release/brakecheck runs/acc_iso 60 > gallery.md

RUN is what `train worlds/acc_iso.ron` made; 60 starts of a seed that training never saw.
A success counts if the cars touch and a careful driver would have avoided it.
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
}
HERE = pathlib.Path(__file__).parent


def percent(row):
    return f"{100 * row['success_rate']:.0f} %"


def closing(row):
    speed = row.get("closing_speed_mps")
    return "–" if not speed else f"{speed['median']:.1f} / {speed['p90']:.1f}"


def main(program, run, starts):
    print("| ego | trained, untouched | held random | best constant | adapted by 100 runs [95 %] | closing m/s, median / 90 % | expected |")
    print("| --- | --- | --- | --- | --- | --- | --- |", flush=True)
    for name, (script, *words) in EGOS.items():
        ego = [sys.executable, str(HERE / script), *words]
        command = [program, "eval", run, "--starts", starts, "--seed", "113", "--runs", "100", "--json", "--", *ego]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True)
        if done.returncode:
            sys.exit(f"{name}: brakecheck ended with {done.returncode}")
        found = json.loads(done.stdout)
        rows = {row["ado"]: row for row in found["rows"]}
        low, high = rows["adapted"]["ci95"]
        cells = [name, percent(rows["trained"]), percent(rows["hold"]), percent(rows["constant"]),
                 f"{percent(rows['adapted'])} [{100 * low:.0f}, {100 * high:.0f}]", closing(rows["adapted"]),
                 f"{100 * found['adapted'][0]['expected']:.0f} %"]
        print("| " + " | ".join(cells) + " |", flush=True)


main(*sys.argv[1:])
