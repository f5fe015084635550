#!/usr/bin/env bash
# The pictures of README and docs/, drawn again: docs/pictures.sh
# Needs brakecheck (built, or $BRAKECHECK). docs/img/viewer.png is a screenshot of the rerun
# viewer (`pip install rerun-sdk`, 0.36.3 or later, or $RERUN) and is left out, aloud, without it; without
# a graphics card it takes a software Vulkan (Mesa's lavapipe).
set -euo pipefail
cd "$(dirname "$0")/.."
brakecheck=${BRAKECHECK:-target/release/brakecheck}
rerun=${RERUN:-rerun}

"$brakecheck" view tests/regressions/acc_iso-nominal-0005.ron -o docs/img/opening.svg --beside CC
"$brakecheck" view tests/regressions/pedestrian-nominal-0001.ron -o docs/img/still.png

if ! command -v "$rerun" >/dev/null; then
  echo "docs/pictures.sh: $rerun is absent; docs/img/viewer.png stays as it is" >&2
  exit 0
fi
recording=$(mktemp --suffix .rrd)
trap 'rm -f "$recording"' EXIT
"$brakecheck" view tests/regressions/cut_in_clear-idm-0074.ron -o "$recording"
RUST_LOG=error "$rerun" --headless --port 0 --bind 127.0.0.1 --hide-welcome-screen --window-size 1600x900 \
  --screenshot-to docs/img/viewer.png "$recording"
echo docs/img/viewer.png
