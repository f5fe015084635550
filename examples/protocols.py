#!/usr/bin/env python3
"""Points of test protocols that each ego passes, as a Markdown table.

    python3 examples/protocols.py worlds/ncap/*.ron
    python3 examples/protocols.py worlds/r157/*.ron --ego mine.ron

`!` counts the passed points at which a lawful variation makes the ego fail, and `c` those of
them at which CC_LATCHED or FSM does not fail. Half an hour of one core for all of Euro NCAP.
"""
import argparse, collections, json, pathlib, subprocess

parser = argparse.ArgumentParser(description="Points of test protocols, ego by ego")
parser.add_argument("worlds", nargs="+", metavar="WORLD.ron")
parser.add_argument("--ego", default="all", metavar="NAME|FILE.ron|all")
args = parser.parse_args()
rows, total = {}, collections.defaultdict(collections.Counter)
for world in args.worlds:
    command = ["brakecheck", "eval", world, "--ego", args.ego, "--search", "2", "--json"]
    # An ego that did not run has passed nothing, so its exit code ends the script.
    tables = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)["points"]
    row = rows[f"{pathlib.Path(world).parent.name}/{pathlib.Path(world).stem}"] = {}
    for table in tables:
        varied = [point["varied"] for point in table["points"] if (point.get("varied") or {}).get("fails")]
        avoided = sum(variation["preventable"] is True for variation in varied)
        row[table["ego"]] = collections.Counter(points=len(table["points"]), passed=table["passed"])
        row[table["ego"]].update({"!": len(varied), "c": avoided})
        total[table["ego"]].update(row[table["ego"]])
print("| world | points |", " | ".join(total), "|\n| --- | --- |" + " --- |" * len(total))
for world, row in [*rows.items(), ("all", total)]:
    marks = {ego: "".join(f" {mark}{n[mark]}" for mark in "!c" if n[mark]) for ego, n in row.items()}
    cells = [f"{row[ego]['passed']}{marks[ego]}" if ego in row else "–" for ego in total]
    print(f"| {world} | {next(iter(row.values()))['points']} |", " | ".join(cells), "|")
