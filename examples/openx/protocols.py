#!/usr/bin/env python3
"""Makes worlds/ncap and worlds/r157 from the OpenSCENARIO files of the protocols.

    python3 examples/openx/protocols.py NCAP ALKS [BRAKECHECK]

NCAP is the folder with `CCRs.xosc`, `CPNA.xosc`, … and `Variations/`, ALKS the one
with `alks_scenario_4_2_1_fully_blocking_target_template.xosc`, …. Numbers are taken
over by `brakecheck new --from`, words are not. Beside the imported ego, which
coasts, each world has stock egos to compare with.
"""
import pathlib
import re
import subprocess
import sys

# Kind: file it is a variation of, who may stray, what happens.
KINDS = {
    "CCRs": ("CCRs", "target", "The ego drives up to a standing car."),
    "CCRs_FCW": ("CCRs", "target", "The ego drives up to a standing car, fast: the driver is to be warned."),
    "CCRm": ("CCRs", "target", "The ego drives up to a slower car."),
    "CCRb": ("CCRs", "target", "The car ahead brakes."),
    "CMRs": ("CCRs", "target", "The ego drives up to a standing motorcycle."),
    "CMRs_FCW": ("CCRs", "target", "The ego drives up to a standing motorcycle, fast: the driver is to be warned."),
    "CMRb": ("CCRs", "target", "The motorcycle ahead brakes."),
    "CBLA": ("CBLA", "target", "The ego drives up to a cyclist who rides along its lane."),
    "CBLA_FCW": ("CBLA", "target", "The ego drives up to a cyclist along its lane, fast: the driver is to be warned."),
    "CPLA": ("CBLA", "target", "The ego drives up to a pedestrian who walks along its lane."),
    "CPLA_FCW": ("CBLA", "target", "The ego drives up to a pedestrian along its lane, fast: the driver is to be warned."),
    "CPNA": ("CPNA", "vru", "A pedestrian crosses from the near side."),
    "CPFA": ("CPNA", "vru", "A pedestrian runs across from the far side."),
    "CPNCO": ("CPNCO", "vru", "A child steps out from between parked cars."),
    "CBNA": ("CBNA", "vru", "A cyclist crosses from the near side."),
    "CBNAO": ("CBNAO", "vru", "A cyclist crosses from the near side, out from behind parked cars."),
    "CBFA": ("CBFA", "vru", "A cyclist crosses from the far side."),
    "CCCscp": ("CCCscp", "target", "A car comes straight across at a junction."),
    "CMCscp": ("CCCscp", "target", "A motorcycle comes straight across at a junction."),
    "CCFtap": ("CCFtap", "target", "The ego turns left across the path of an oncoming car."),
    "CMFtap": ("CCFtap", "target", "The ego turns left across the path of an oncoming motorcycle."),
    "CCFhos": ("CCFhos", "target", "A car comes towards the ego in its own lane."),
}
EGO = """Ego(Aeb(
                cruise_gain_per_s: 0.5, cruise_limit_mps2: 2.0, trigger_mps2: 2.0, max_brake_mps2: 8.0,
                margin_m: 1.0, side_m: 0.3, look_ahead_s: 4.0, lag_s: 0.2,
            ))"""
REUSE = """    reuse: {
        "coasts": Change(controller: Coast(accel_mps2: 0.0, lag_s: 0.0)),     // as the protocol has it: every point is hit
        "late braking": Change(ego: (trigger_mps2: 5.0)),
        "idm": Change(controller: Idm(
            desired_speed_mps: 40.0, time_gap_s: 1.0, min_gap_m: 1.5, max_accel_mps2: 0.5,
            comfort_brake_mps2: 3.0, max_brake_mps2: 8.0, lag_s: 0.2,
        )),
        "rss": Change(controller: RssDriver(lag_s: 0.0)),
        "careful driver": Change(controller: CcDriver(lag_s: 0.0)),
    },
)
"""
SCENES = {
    "4_1_1_free_driving": ("free_driving", None, "The ego drives through all bends of a motorway, and nobody else does."),
    "4_1_2_swerving_lead_vehicle": ("swerving_lead", "lead_vehicle", "The car ahead swerves within its lane."),
    "4_1_3_side_vehicle": ("side_vehicle", "side_vehicle", "A truck drives beside the ego through all bends of a motorway."),
    "4_2_1_fully_blocking_target": ("pedestrian_standing", "target_blocking", "A pedestrian stands in the lane."),
    "4_2_2_partially_blocking_target": ("pedestrian_offset", "target_blocking", "A pedestrian stands in the lane, off its middle."),
    "4_2_3_crossing_pedestrian": ("pedestrian_crossing", "target_blocking", "A pedestrian crosses the lane."),
    "4_2_4_multiple_blocking_targets": ("two_standing", "target_blocking", "Two cars stand in the lane, one behind the other."),
    "4_3_1_follow_lead_vehicle_comfortable": ("lead_slows", "lead_vehicle", "The car ahead slows down."),
    "4_3_2_follow_lead_vehicle_emergency_brake": ("lead_brakes", "lead_vehicle", "The car ahead brakes hard."),
    "4_4_1_cut_in_no_collision": ("cut_in_far", "cut_in_vehicle", "A slower car cuts in, far enough ahead."),
    "4_4_2_cut_in_unavoidable_collision": ("cut_in_near", "cut_in_vehicle", "A slower car cuts in too near ahead."),
    "4_5_1_cut_out_fully_blocking": ("cut_out", "lead_vehicle", "The car ahead leaves the lane, in which another stands."),
    "4_5_2_cut_out_multiple_blocking_targets": ("cut_out_two", "lead_vehicle", "The car ahead leaves the lane, in which two others stand."),
    "4_6_1_forward_detection_range": ("detection_ahead", "target_blocking", "A pedestrian stands at the edge of the lane."),
    "4_6_2_lateral_detection_range": ("detection_beside", "side_vehicle", "A motorcycle rides beside the ego, a lane away."),
}
HEAD = """// {what}: {does}
//
// Geometry, speeds and points are those of {whose},
// imported (docs/reference/protocols.md).
"""
STRAYS = """// How far `{ado}` may stray from its plan is not in the protocol: the rules are brakecheck's,
// to be replaced by the tolerances of your laboratory.
"""


def written(files, what, whose, ado, does):
    """Our words and egos in files just imported."""
    for file in files:
        text = re.sub(r"\A(//.*\n)+", "", file.read_text())
        asks = "Which points does the ego pass, and which variations of them?" if ado else "Does the ego keep its lane?"
        text = re.sub(r"question: .*", f'question: "{does} {asks}",', text)
        text = re.sub(r"source: .*", f'source: "{whose}: {what}",', text)
        text = re.sub(r"Ego\(Coast\(.*?\)\)", EGO, text)
        text = text.rstrip().removesuffix(")") + REUSE
        head = HEAD + (STRAYS if ado else "")
        file.write_text(head.format(what=what, whose=whose, does=does, ado=ado) + text)


def imported(program, xosc, points, ado, out):
    """The worlds that a file, and its points, make."""
    words = ["--points", points, "--skip-broken"] if points else []
    words += ["--ado", ado] if ado else []
    subprocess.run([program, "new", "--from", xosc, *words, out], check=True)
    return [out] if out.exists() else sorted(out.parent.glob(f"{out.stem}_[0-9].ron"))


def ncap(program, folder):
    for kind, (base, ado, does) in KINDS.items():
        for which in ("Standard", "Extended"):
            points = folder / "Variations" / f"{which}Range" / f"{kind}.xosc"
            out = pathlib.Path("worlds/ncap") / f"{kind.lower()}{'_extended' if which == 'Extended' else ''}.ron"
            files = imported(program, folder / f"{base}.xosc", points, ado, out)
            whose = "Euro NCAP's Crash Avoidance protocol, Frontal Collisions, 2026"
            written(files, f"{kind}, {which.lower()} range", whose, ado, does)


def r157(program, folder):
    for scene, (name, ado, does) in SCENES.items():
        out = pathlib.Path("worlds/r157") / f"{name}.ron"
        files = imported(program, folder / f"alks_scenario_{scene}_template.xosc", None, ado, out)
        number = "Scenario " + ".".join(scene.split("_")[:3])
        written(files, number, "UN R157's scenarios for lane keeping systems", ado, does)


if __name__ == "__main__":
    program = sys.argv[3] if 3 < len(sys.argv) else "target/release/brakecheck"
    for make, folder, out in ((ncap, sys.argv[1], "worlds/ncap"), (r157, sys.argv[2], "worlds/r157")):
        pathlib.Path(out).mkdir(exist_ok=True)
        make(program, pathlib.Path(folder))
