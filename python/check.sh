#!/bin/sh
# Builds the wheel, installs it into a fresh virtual environment, tests it, and
# runs the tutorial:
#
#   sh python/check.sh [DIRECTORY]
#
# DIRECTORY is where the environment goes (a temporary one without it). It needs
# a Rust toolchain, Python 3.10 or later, and the package index.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
where=${1:-$(mktemp -d)}
python=${PYTHON:-python3}

"$python" -m venv "$where/build"
"$where/build/bin/pip" install --quiet 'maturin>=1.9,<2'
rm -rf "$where/wheels"
# The tests read nothing of the checkout but themselves.
"$where/build/bin/maturin" build --release --manifest-path "$here/Cargo.toml" \
    --interpreter "$python" --out "$where/wheels" ${MATURIN_ARGS:-}

"$python" -m venv --clear "$where/fresh"
"$where/fresh/bin/pip" install --quiet "$(ls "$where"/wheels/*.whl)[test]"
cd "$where"
"$where/fresh/bin/python" -m pytest -q -p no:cacheprovider "$here/tests"
"$where/fresh/bin/python" -m mypy --config-file "$here/pyproject.toml" -p brakecheck
"$where/fresh/bin/brakecheck" --version
mkdir -p "$where/tutorial"
cp "$here/examples/tutorial.ipynb" "$where/tutorial"
(cd "$where/tutorial" && "$where/fresh/bin/jupyter" execute --inplace tutorial.ipynb)
echo "the wheel: $(ls "$where"/wheels/*.whl)"
