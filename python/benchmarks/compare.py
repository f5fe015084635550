"""Measures brakecheck beside other programs and writes a page of it.

    python3 python/benchmarks/compare.py [WHEEL] [--environment DIRECTORY]

Without WHEEL it builds the wheel. It installs the wheel and the other programs
into a virtual environment below `target/`, or into DIRECTORY. A program that the
package index does not give is named as missing. The environment variable CARGO
replaces `cargo`.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import venv
from pathlib import Path

import page

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
OUTPUT = ROOT / "target" / "benchmarks"
PAGE = OUTPUT / "benchmarks.md"
RIVALS = ["highway-env", "rtamt", "mstlo-python", "stable-baselines3"]
CARGO = os.environ.get("CARGO", "cargo")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheel", nargs="?", type=Path, metavar="WHEEL")
    parser.add_argument("--environment", type=Path, default=OUTPUT / "venv", metavar="DIRECTORY")
    given = parser.parse_args()
    OUTPUT.mkdir(parents=True, exist_ok=True)
    python = environment(given.environment)
    install(python, given.wheel or built(python))
    lines = measured(python)
    lines["hand"] = hand_loop()
    lines["machine"] = f"{processor()}, {platform.system()}, Python {platform.python_version()}"
    PAGE.write_text(page.text(lines), encoding="utf-8")
    print(f"wrote {PAGE.relative_to(ROOT)}")


def environment(directory: Path) -> Path:
    """Returns the interpreter of the virtual environment, made if it is missing."""
    folder, name = ("Scripts", "python.exe") if os.name == "nt" else ("bin", "python")
    python = directory / folder / name
    if not python.exists():
        venv.create(directory, with_pip=True)
    return python


def pip(python: Path, *arguments: str) -> bool:
    """Installs packages, and returns whether that succeeded."""
    command = [str(python), "-m", "pip", "install", "--quiet", *arguments]
    return subprocess.run(command).returncode == 0


def built(python: Path) -> Path:
    """Builds the wheel and returns its path."""
    if not pip(python, "maturin>=1.9,<2"):
        sys.exit("maturin cannot be installed: give the path of a wheel")
    wheels = OUTPUT / "wheels"
    shutil.rmtree(wheels, ignore_errors=True)
    command = [str(python), "-m", "maturin", "build", "--release", "--out", str(wheels)]
    manifest = HERE.parent / "Cargo.toml"
    subprocess.run([*command, "--manifest-path", str(manifest)], check=True)
    return next(wheels.glob("*.whl"))


def install(python: Path, wheel: Path) -> None:
    """Installs the wheel and every program that the index gives."""
    if not pip(python, str(wheel)):
        sys.exit(f"{wheel} cannot be installed")
    # Another build of the same version would be taken for installed.
    pip(python, "--force-reinstall", "--no-deps", str(wheel))
    for rival in RIVALS:
        if not pip(python, rival):
            print(f"{rival} is missing", file=sys.stderr)


def measured(python: Path) -> dict:
    """Runs `measure.py` in the environment and returns its tables."""
    found = OUTPUT / "measured.json"
    # Threads of a numerical library would count as processor time of one.
    one_thread = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    command = [str(python), str(HERE / "measure.py"), str(found)]
    subprocess.run(command, check=True, cwd=OUTPUT, env={**os.environ, **one_thread})
    return json.loads(found.read_text(encoding="utf-8"))


def hand_loop() -> dict[str, float] | None:
    """Decisions per CPU-s by loop and number of environments, if cargo exists."""
    if shutil.which(CARGO) is None:
        return None
    command = [CARGO, "bench", "--bench", "hand_loop"]
    # It fails if the loop and the test bench move differently.
    ran = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    rows = [line.split() for line in ran.stdout.splitlines()]
    loops = ("hand", "kinematic", "vector")
    return {f"{row[0]} {row[1]}": float(row[2]) for row in rows if row and row[0] in loops}


def processor() -> str:
    """Returns the name of the processor."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


if __name__ == "__main__":
    main()
