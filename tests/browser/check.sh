#!/bin/sh
# Drives the pages of `brakecheck drive` and `brakecheck report` in Chromium:
#
#   sh tests/browser/check.sh [DIRECTORY]
#
# DIRECTORY is where the environment goes (a temporary one without it). The program must be
# built (`cargo build --release`). Chromium comes from Debian's packages if it is missing.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
where=${1:-$(mktemp -d)}
mkdir -p "$where"
where=$(cd "$where" && pwd)
chromium=$(command -v chromium || true)
if [ -z "$chromium" ]; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends chromium
    chromium=$(command -v chromium)
fi
"${PYTHON:-python3}" -m venv "$where/browser"
"$where/browser/bin/python" -m pip install --quiet 'playwright>=1.50,<2' 'pytest>=8'
CHROMIUM="$chromium" PROGRAM="${PROGRAM:-$here/../../target/release/brakecheck}" \
    "$where/browser/bin/python" -m pytest -q -p no:cacheprovider "$here/drive.py" "$here/report.py"
