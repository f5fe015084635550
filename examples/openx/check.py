"""Compares what esmini plays of exported files with the recorded samples.

Called by check.sh, which says how. Of each counterexample:

- NAME.xosc at steps of 0.01 s: the middle of every front bumper against the
  columns x and y of NAME.csv, and the contact against the recorded one;
- NAME.external.xosc: that it plays to the horizon, the others as recorded until
  the contact;
- the issues that ASAM's checkers raise on all three files.
"""

import csv
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET

STEP_S = 0.01
MOST_M = 1e-3
# Of the checks for OpenDRIVE a 23rd is for version 1.8 only.
CHECKS = {"xosc": ("QC_OPENSCENARIO", "qc_openscenario", "xoscBundle", 17),
          "xodr": ("QC_OPENDRIVE", "qc_opendrive", "xodrBundle", 22)}


def tool(variable, name):
    """The program that a variable or the path names; none if there is none."""
    return shutil.which(os.environ.get(variable) or name)


def play(esmini, file, *more):
    """What esmini logs of every entity, {name: {step: row}}, and its collisions."""
    with tempfile.TemporaryDirectory() as scratch:
        log = os.path.join(scratch, "log.txt")
        rows = os.path.join(scratch, "rows.csv")
        command = [esmini, "--osc", file, "--headless", "--fixed_timestep", str(STEP_S),
                   "--collision", "--traj_filter", "0", "--pline_interpolation", "segment",
                   "--logfile_path", log, "--csv_logger", rows, *more]
        done = subprocess.run(command, capture_output=True, text=True, timeout=600)
        if done.returncode != 0:
            sys.exit(f"{file}: esmini ends with {done.returncode}\n{done.stdout[-2000:]}")
        with open(log, encoding="utf-8") as text:
            text = text.read()
        with open(rows, encoding="utf-8") as lines:
            return entities(list(lines)), collisions(text)


def entities(lines):
    """Rows by entity and step; esmini names the columns in one long line."""
    begin = next(i for i, line in enumerate(lines) if line.startswith("Index"))
    names = [name.strip() for name in lines[begin].split(",")]
    first = [i for i, name in enumerate(names) if name.endswith("Entity_Name [-]")]
    width = first[1] - first[0] if 1 < len(first) else len(names) - first[0]
    column = {re.sub(r"^#1 ", "", names[first[0] + i]).split(" ")[0]: i for i in range(width)}
    played = {}
    for line in lines[begin + 1:]:
        values = [value.strip() for value in line.split(",")]
        step = round(float(values[1]) / STEP_S)
        for at in range(first[0], len(values) - 1, width):
            entity = values[at:at + width]
            if len(entity) < len(column) - 2 or not entity[0]:
                continue
            value = {name: entity[i] for name, i in column.items() if i < len(entity)}
            played.setdefault(value["Entity_Name"], {})[step] = value
    return played


def collisions(log):
    found = re.findall(r"\[([0-9.]+)\] \[\w+\] Collision between (\S+) and (\S+)", log)
    return [(float(time_s), {first, second}) for time_s, first, second in found]


def front(row):
    """The middle of the front bumper: ahead of the reference point by the box."""
    ahead_m = float(row["bb_x"]) + 0.5 * float(row["bb_length"])
    heading_rad = float(row["World_Heading_Angle"])
    return (float(row["World_Position_X"]) + ahead_m * math.cos(heading_rad),
            float(row["World_Position_Y"]) + ahead_m * math.sin(heading_rad))


def farthest(played, trace, agents, contact_s):
    """The greatest distance between played and recorded front bumpers."""
    most_m, compared = 0.0, 0
    for row in trace:
        time_s = float(row["time"])
        # The last row of a contact shows its instant, not its time.
        if contact_s is not None and contact_s <= time_s:
            break
        step = round(time_s / STEP_S)
        for agent in agents:
            if step in played[agent]:
                x_m, y_m = front(played[agent][step])
                most_m = max(most_m, math.hypot(x_m - float(row[f"{agent}.x"]),
                                                y_m - float(row[f"{agent}.y"])))
                compared += 1
    return most_m, compared


def recorded(file):
    """Agents, those with a controller, the contact (time, names) and the end."""
    root = ET.parse(file).getroot()
    agents = [entity.get("name") for entity in root.iter("ScenarioObject")]
    properties = {it.get("name"): it.get("value") for it in root.iter("Property")}
    told = re.match(r"(\S+) and (\S+) at ([0-9.]+) s", properties["brakecheck.contact"])
    contact = (float(told[3]), {told[1], told[2]}) if told else None
    ends = [it.get("value") for it in root.iter("SimulationTimeCondition")
            if it.get("rule") == "greaterThan"]
    ego = [entity.get("name") for entity in root.iter("ScenarioObject")
           if entity.find("ObjectController") is not None]
    return agents, ego, contact, float(ends[-1])


def issues(file):
    """What a checker says: issues, or that it did not do all of its checks."""
    variable, name, bundle, checks = CHECKS[file.rsplit(".", 1)[1]]
    checker = tool(variable, name)
    if checker is None:
        return None
    with tempfile.TemporaryDirectory() as scratch:
        config, result = (os.path.join(scratch, it) for it in ("config.xml", "result.xqar"))
        with open(config, "w", encoding="utf-8") as text:
            text.write(f'<Config><Param name="InputFile" value="{os.path.abspath(file)}"/>'
                       f'<CheckerBundle application="{bundle}"><Param name="resultFile" '
                       f'value="{result}"/></CheckerBundle></Config>')
        subprocess.run([checker, "-c", config], capture_output=True, cwd=scratch, timeout=600)
        root = ET.parse(result).getroot()
    states = [checker.get("status") for checker in root.iter("Checker")]
    found = [issue.get("description") for issue in root.iter("Issue")]
    if states.count("completed") != checks:
        found.append(f"{states.count('completed')} of {checks} checks were completed")
    return found


def judge_replay(esmini, file, samples):
    """A line about a replay, and whether it is wrong."""
    agents, _, contact, _ = recorded(file)
    played, hits = play(esmini, file)
    with open(samples, encoding="utf-8") as text:
        trace = list(csv.DictReader(text))
    most_m, compared = farthest(played, trace, agents, contact and contact[0])
    wrong = MOST_M < most_m or compared < 2 * len(agents)
    line = f"front faces {1000 * most_m:.3f} mm off at most ({compared} compared)"
    if contact is None:
        return f"{line}, no contact: {hits or 'none'}", wrong or bool(hits)
    if not hits:
        return f"{line}, NO contact, recorded at {contact[0]:.4f} s", True
    late_s = hits[0][0] - contact[0]
    wrong |= hits[0][1] != contact[1] or not -1e-6 <= late_s <= STEP_S + 1e-6
    names = " and ".join(sorted(hits[0][1]))
    return f"{line}, contact of {names} {late_s:.4f} s late", wrong


def judge_external(esmini, file, samples, contact):
    agents, ego, _, end_s = recorded(file)
    others = [agent for agent in agents if agent not in ego]
    with open(samples, encoding="utf-8") as text:
        trace = list(csv.DictReader(text))
    lines, wrong = [], len(ego) != 1
    for more in [], ["--disable_controllers"]:
        played, _ = play(esmini, file, *more)
        most_m, _ = farthest(played, trace, others, contact and contact[0])
        last_s = STEP_S * max(max(rows) for rows in played.values())
        wrong |= MOST_M < most_m or last_s < end_s
        lines.append(f"{1000 * most_m:.3f} mm, to {last_s:.2f} s")
    return f"others {'; without controllers '.join(lines)}", wrong


def main():
    kept, out = sys.argv[1:]
    command = [os.environ["BRAKECHECK"], "export", kept, "-o", out, "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    if not done.stdout:
        sys.exit(f"{' '.join(command)}\n{done.stderr}")
    exported = json.loads(done.stdout)
    for refused in exported["refused"]:
        print(f"{refused['file']}: not exported: {refused['why']}")
    esmini = tool("ESMINI", "esmini")
    missing = [] if esmini else ["esmini (ESMINI): nothing was played"]
    for variable, name, *_ in CHECKS.values():
        if tool(variable, name) is None:
            missing.append(f"{name} ({variable}): no file was checked by it")
    wrong = 0
    for file in exported["files"]:
        lines, is_wrong = [], False
        base = os.path.basename(file).removesuffix(".xosc").removesuffix(".external")
        directory = kept if os.path.isdir(kept) else os.path.dirname(kept)
        samples = os.path.join(directory, f"{base}.csv")
        if esmini and file.endswith(".external.xosc"):
            contact = recorded(file)[2]
            line, is_wrong = judge_external(esmini, file, samples, contact)
            lines.append(line)
        elif esmini and file.endswith(".xosc"):
            line, is_wrong = judge_replay(esmini, file, samples)
            lines.append(line)
        found = issues(file)
        if found is not None:
            lines.append(f"{len(found)} issues{''.join(f'{chr(10)}  {it}' for it in found)}")
            is_wrong |= bool(found)
        print(f"{'WRONG ' if is_wrong else ''}{os.path.basename(file)}: {', '.join(lines)}")
        wrong += is_wrong
    print(f"{len(exported['files'])} files, {wrong} wrong")
    for what in missing:
        print(f"NOT THERE: {what}", file=sys.stderr)
    sys.exit(1 if wrong else 2 if missing else 0)


main()
