"""Exports kept counterexamples as OSI traces and lets others read them.

    python3 examples/openx/osi.py [KEPT]

KEPT is a directory of kept counterexamples (tests/regressions unless given). It takes
`pip install omega-prime asam-osi-utilities`. omega-prime validates every file, both tools
read it, and the box centres are compared with the recorded samples.
"""
import csv, math, os, pathlib, subprocess, sys, tempfile, warnings

import omega_prime
from osi_utilities.tracefile.readers.multi import MultiTraceReader

root = pathlib.Path(__file__).resolve().parents[2]
kept = pathlib.Path(sys.argv[1]) if 1 < len(sys.argv) else root / "tests/regressions"
brakecheck = os.environ.get("BRAKECHECK", str(root / "target/release/brakecheck"))
warnings.simplefilter("ignore")
worst_m, files, messages = 0.0, 0, 0
with tempfile.TemporaryDirectory() as out:
    # A grid world is refused, and the others are written.
    subprocess.run([brakecheck, "export", str(kept), "-o", out, "--osi"], stdout=subprocess.DEVNULL)
    for path in sorted(pathlib.Path(out).glob("*.mcap")):
        recording = omega_prime.Recording.from_file(path, validate=True, parse_map=True)
        assert recording.map is not None and recording.map.lanes, f"{path.name}: no road"
        reader = MultiTraceReader(decoder_mode="mcap-contained")
        assert reader.open(path), path.name
        read = 0
        while (result := reader.read_message()) is not None:
            assert result.message is not None, f"{path.name}: {result.error_message}"
            read += 1
        rows = list(csv.DictReader((kept / path.with_suffix(".csv").name).open()))
        names = [name[:-2] for name in rows[0] if name.endswith(".x")]
        frame = recording.df.sort(["idx", "total_nanos"])
        for number, name in enumerate(names, 1):
            own = frame.filter(frame["idx"] == number)
            instants = own.select("total_nanos", "x", "y", "length").rows()
            assert len(instants) == read, f"{path.name}: {len(instants)} of {read}"
            for row, (_, x, y, length) in zip(rows, instants):
                heading, back = float(row[f"{name}.heading"]), 0.5 * length
                off_x = x - float(row[f"{name}.x"]) + back * math.cos(heading)
                off_y = y - float(row[f"{name}.y"]) + back * math.sin(heading)
                worst_m = max(worst_m, math.hypot(off_x, off_y))
        files, messages = files + 1, messages + read
print(f"{files} files, {messages} messages, box centres within {1000 * worst_m:.2f} mm of the trace")
sys.exit(0 if files and worst_m < 0.01 else 1)
