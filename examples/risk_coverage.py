#!/usr/bin/env python3
"""Estimates of `brakecheck risk` beside counted natural runs.

    python3 examples/risk_coverage.py acc --traffic examples/traffic/acc.ron --seeds 40

Further options go to `brakecheck risk`. An interval covers if it contains the mean of the
estimates and of counting, weighted by their precision.
"""
import argparse, json, math, statistics, subprocess

parser = argparse.ArgumentParser(description="Coverage of the intervals of `brakecheck risk`")
parser.add_argument("world")
parser.add_argument("--seeds", type=int, default=40)
parser.add_argument("--first-seed", type=int, default=900)
parser.add_argument("--counted", type=int, default=10_000_000, help="natural runs")
args, options = parser.parse_known_args()

def risk(*more):
    command = ["brakecheck", "risk", args.world, *options, *map(str, more), "--json"]
    done = subprocess.run(command, stdout=subprocess.PIPE)
    # Exit code 3 is a refused estimate, which has no number.
    if done.returncode not in (0, 3):
        raise SystemExit(done.returncode)
    return json.loads(done.stdout)["egos"][0].get("fails")

counted = risk("--natural-runs", args.counted, "--budget", args.counted, "--seed", 1_000_000)
seeds = range(args.first_seed, args.first_seed + args.seeds)
made = [fails for seed in seeds if (fails := risk("--seed", seed))]
mean = statistics.fmean(fails["probability"] for fails in made)
error = statistics.stdev(fails["probability"] for fails in made) / math.sqrt(len(made))
rate, rate_error = counted["probability"], counted["probability"] / math.sqrt(counted["hits"])
truth = (mean / error**2 + rate / rate_error**2) / (1 / error**2 + 1 / rate_error**2)
cover = sum(fails["interval"][0] <= truth <= fails["interval"][1] for fails in made)
apart = (mean - rate) / math.hypot(error, rate_error)
print(f"counted {rate:.2e} ± {196 * rate_error / rate:.1f} %, estimated {mean:.2e} ± {196 * error / mean:.1f} %")
print(f"{apart:+.1f} joint standard errors apart, {cover} of {len(made)} cover, {args.seeds - len(made)} refused")
