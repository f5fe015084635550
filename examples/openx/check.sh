#!/bin/sh
# Exports kept counterexamples and lets others judge the files: esmini plays
# them, ASAM's checkers read them.
#
#   ESMINI=…/esmini examples/openx/check.sh [KEPT] [OUT]
#
# KEPT is a kept counterexample or a directory of them (tests/regressions unless
# given), OUT the directory to export into (a temporary one unless given). The
# tools are found by environment variables, or by name on the path:
#
#   BRAKECHECK       target/release/brakecheck   cargo build --release
#   ESMINI           esmini                      github.com/esmini/esmini
#   QC_OPENSCENARIO  qc_openscenario             pip install asam-qc-openscenarioxml
#   QC_OPENDRIVE     qc_opendrive                pip install asam-qc-opendrive
#
# (the checkers want a virtual environment each). What is not there is said, and
# then the script ends with 2; with 1 where something is wrong, else with 0.
set -eu
here=$(dirname "$0")
kept=${1:-$here/../../tests/regressions}
if [ $# -ge 2 ]; then
    out=$2
else
    out=$(mktemp -d)
    trap 'rm -rf "$out"' EXIT
fi
export BRAKECHECK="${BRAKECHECK:-$here/../../target/release/brakecheck}"
python3 "$here/check.py" "$kept" "$out"
