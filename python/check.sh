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
mkdir -p "$where"
# The directory changes below, so a relative path would lead elsewhere.
where=$(cd "$where" && pwd)
python=${PYTHON:-python3}

"$python" -m venv --clear "$where/fresh"
fresh="$where/fresh/bin/python"
rm -rf "$where/wheels"
# The first half of `pip install ./python`, which keeps the wheel. The second half brings
# the packages that the tests need.
"$fresh" -m pip wheel --quiet --no-deps --wheel-dir "$where/wheels" "$here"
"$fresh" -m pip install --quiet "$(ls "$where"/wheels/*.whl)[test]"
cd "$where"
"$fresh" -m mypy --config-file "$here/pyproject.toml" -p brakecheck
# The stub says what the module has, no more and no less.
"$fresh" -m mypy.stubtest --concise --ignore-disjoint-bases brakecheck._brakecheck
"$where/fresh/bin/brakecheck" --version
rm -rf "$where/tutorial"
mkdir -p "$where/tutorial"
cp "$here/examples/tutorial.ipynb" "$where/tutorial"
(cd "$where/tutorial" && "$fresh" -m jupyter execute --inplace tutorial.ipynb)
# The tests come last, so that their count closes the output.
"$fresh" -m pytest -q -p no:cacheprovider "$here/tests"
echo "the wheel: $(ls "$where"/wheels/*.whl)"
