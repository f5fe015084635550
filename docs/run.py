#!/usr/bin/env python3
"""Execution of the commands that the pages quote, with a comparison of their output.

A block ```sh is executed with `bash -e` in a scratch directory of its page, and must exit
with 0, or with N if its last line ends in `# exit N`. A block ```text that follows is its
output, stdout and stderr together. A line `…` stands for any lines that are left out.
Processor times, rates per second, paths of temporary files and padding in tables may
differ, and lines of progress are ignored.

A block ```sh skip is not executed, and its output is ```text skip. The test
tests/architecture/references.rs looks up the verbs and flags of its commands.

A block ```python, ```ron, ```toml, ```json, ```yaml or ```c is written to the scratch
directory as a file if the line above it, or the first comment in it, names the file.

The exit code is 0, 1 after a mistake in a page, or 2 after a bad use.
"""

import argparse
import concurrent.futures
import hashlib
import io
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# Pages that are executed unless the command line names others.
PAGES = [
    "README.md",
    "docs/**/*.md",
    "crates/repro/README.md",
    "crates/stl/README.md",
    "examples/**/README.md",
    "python/README.md",
    "CONTRIBUTING.md",
]

# Files of the repository that commands read.
FILES = ["worlds", "examples", "tests/regressions", "tests/data", "assets", "python/examples"]

# Runs and crashes that every page finds in its scratch directory.
PREPARED = [
    "train acc_iso -o runs/acc_iso",
    "train acc -o runs/acc",
    "search acc_iso --starts 20 --keep crashes",
]

# Pages that start without these, and make their own.
BARE_PAGES = {"README.md"}
PREPARED_DIRECTORIES = ["runs", "crashes"]

# Languages of blocks that become files, with the endings of these files.
ENDINGS = {"python": "py", "ron": "ron", "toml": "toml", "json": "json", "yaml": "yaml", "c": "c"}

# Words that would hide a command from this program.
SHELLS = {"bash", "shell", "console", "shell-session", "zsh"}

# Commands in front of the program's own.
CARGO = """#!/bin/sh
case "$*" in
"run --release -- "*) shift 3; exec brakecheck "$@" ;;
esac
echo "docs/run.py: cargo is not available here, mark the block as skip" >&2
exit 127
"""

FENCE = re.compile(r"^(?P<indent>\s*)(?P<marks>`{3,}|~{3,})(?P<info>[^`]*)$")
EXIT_CODE = re.compile(r"#\s*exit\s+(\d+)\s*$")
VARYING = [
    (re.compile(r"\b[\d.,]+ (s|min|h) of processor time"), "T s of processor time"),
    (re.compile(r"\b[\d.,]+ per second\b"), "R per second"),
    (re.compile(r"[\d.]+ ms each: at most [\d.]+ (s|min|h) on \d+ threads?"), "T"),
    (re.compile(r"\b[\d.,]+ ([a-z]{4,})/s\b"), r"R \1/s"),
    (re.compile(r"/tmp/[^\s'\"`:,)]+"), "TEMPORARY"),
]
TIME_COLUMNS = {"cpu s"}
# Lines that a slow command writes while it runs, depending on the machine.
PROGRESS = re.compile(r".+: (\d+ of \d+ after \d+ s|\d+ s so far)(, about \d+ s left)?")


@dataclass
class Block:
    """Fenced block of a page."""

    line: int
    language: str
    is_skipped: bool
    lines: list
    file: str = ""


@dataclass
class Report:
    """Counts and mistakes of pages."""

    executed: int = 0
    compared: int = 0
    skipped: list = field(default_factory=list)
    mistakes: list = field(default_factory=list)
    times: list = field(default_factory=list)

    def add(self, other):
        self.executed += other.executed
        self.compared += other.compared
        self.skipped += other.skipped
        self.mistakes += other.mistakes
        self.times += other.times


def blocks(text):
    """Returns the fenced blocks of a page, and the mistakes in its fences."""
    found, mistakes = [], []
    opened, above = None, ""
    for number, line in enumerate(text.splitlines(), 1):
        fence = FENCE.match(line)
        if opened is None:
            if fence:
                opened = (fence["marks"], len(fence["indent"]))
                words = re.split(r"[\s,]+", fence["info"].strip())
                skip = words[1:] == ["skip"]
                if words[0] in SHELLS:
                    mistakes.append((number, f"write ```sh instead of ```{words[0]}"))
                if words[0] in ("sh", "text") and words[1:] and not skip:
                    mistakes.append((number, f"unknown words: {' '.join(words[1:])}"))
                block = Block(number, words[0], skip, [])
                block.file = named_file(above, words[0])
            elif line.strip():
                above = line
            continue
        marks, indent = opened
        if fence and fence["marks"].startswith(marks) and not fence["info"].strip():
            opened = None
            block.file = block.file or commented_file(block)
            found.append(block)
            continue
        inside = line[indent:] if not line[:indent].strip() else line
        block.lines.append(inside)
    if opened is not None:
        mistakes.append((block.line, "the block has no end"))
    return found, mistakes


def named_file(line, language):
    """Returns the last file with the language's ending that a line of prose names."""
    ending = ENDINGS.get(language)
    names = re.findall(rf"`([\w-]+\.{ending})`", line) if ending else []
    return names[-1] if names else ""


def commented_file(block):
    """Returns the file that the first line of a block names in a comment."""
    ending = ENDINGS.get(block.language)
    if not ending or not block.lines:
        return ""
    name = re.fullmatch(rf"(?:#|//) ([\w.-]+\.{ending})", block.lines[0].strip())
    return name[1] if name else ""


def normal(lines):
    """Returns lines without all that may differ between two runs."""
    normalised, timed = [], []
    for line in lines:
        line = line.rstrip()
        for pattern, instead in VARYING:
            line = pattern.sub(instead, line)
        if line.lstrip().startswith("│"):
            cells = [cell.strip() for cell in re.split("[│┆]", line)]
            if TIME_COLUMNS & set(cells):
                timed = [n for n, cell in enumerate(cells) if cell in TIME_COLUMNS]
            else:
                is_time = lambda n, cell: n in timed and re.fullmatch(r"[\d.,]+", cell)
                cells = ["T" if is_time(n, cell) else cell for n, cell in enumerate(cells)]
            line = " │ ".join(cells)
        elif re.fullmatch(r"\s*[┌╞├└][─═┬╪┼┴┐╡┤┘╌]+", line):
            timed = [] if "└" in line else timed
            line = re.sub(r"[─═╌]+", "─", line)
        normalised.append(line)
    while normalised and not normalised[-1]:
        normalised.pop()
    return normalised


def difference(expected, real):
    """Returns the lines of a diff, or nothing if the output is as expected.

    A line `…` matches any lines. Among all alignments, the diff has the fewest changes.
    """
    real = [line for line in real if not PROGRESS.fullmatch(line.rstrip())]
    left, right = normal(expected), normal(real)
    rows, columns = len(left), len(right)
    # costs[i][j]: fewest changes between the lines from i and from j on.
    costs = [[0] * (columns + 1) for _ in range(rows + 1)]
    costs[rows] = [columns - j for j in range(columns + 1)]
    for i in range(rows - 1, -1, -1):
        own, below = costs[i], costs[i + 1]
        is_gap = left[i].strip() == "…"
        own[columns] = below[columns] + (0 if is_gap else 1)
        for j in range(columns - 1, -1, -1):
            if is_gap:
                own[j] = min(below[j], own[j + 1])
            else:
                changed = below[j + 1] + (left[i] != right[j])
                own[j] = min(changed, below[j] + 1, own[j + 1] + 1)
    if costs[0][0] == 0:
        return []
    lines, i, j = [], 0, 0
    while i < rows or j < columns:
        cost = costs[i][j]
        if i < rows and left[i].strip() == "…":
            if cost == costs[i + 1][j]:
                lines.append("  …")
                i += 1
            else:
                j += 1
        elif i < rows and j < columns and left[i] == right[j] and cost == costs[i + 1][j + 1]:
            lines.append(f"  {expected[i]}")
            i, j = i + 1, j + 1
        elif i < rows and j < columns and cost == costs[i + 1][j + 1] + 1:
            lines += [f"- {expected[i]}", f"+ {real[j]}"]
            i, j = i + 1, j + 1
        elif i < rows and cost == costs[i + 1][j] + 1:
            lines.append(f"- {expected[i]}")
            i += 1
        else:
            lines.append(f"+ {real[j]}")
            j += 1
    return lines


class Scratch:
    """Scratch directory of a page: a copy of the prepared directory."""

    def __init__(self, base, directory, limit_s):
        if directory.exists():
            shutil.rmtree(directory)
        shutil.copytree(base, directory, symlinks=True)
        self.base, self.directory, self.limit_s = base, directory, limit_s

    def write(self, name, lines):
        """Writes a file of a page, unless the prepared directory has a file of this name."""
        if not (self.base / name).exists():
            (self.directory / name).write_text("\n".join(lines) + "\n", encoding="utf-8")

    def execute(self, script):
        """Executes a script, and returns its exit code and its lines of output."""
        environment = dict(os.environ)
        for name in ("CARGO_TARGET_DIR", "CLICOLOR_FORCE", "RUST_BACKTRACE", "RUST_LOG"):
            environment.pop(name, None)
        environment |= {
            "PATH": f"{self.directory / '.bin'}:{environment['PATH']}",
            "B": "target/release/brakecheck",
            "COLUMNS": "100",
            "LC_ALL": "C.UTF-8",
            "NO_COLOR": "1",
        }
        with tempfile.TemporaryFile() as output:
            # A session of its own, so that programs in the background end with the block.
            process = subprocess.Popen(
                ["bash", "-e", "-c", script],
                cwd=self.directory,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            try:
                code = process.wait(self.limit_s)
            except subprocess.TimeoutExpired:
                code = None
            finally:
                try:
                    os.killpg(process.pid, signal.SIGKILL)
                except ProcessLookupError:
                    pass
                process.wait()
            output.seek(0)
            text = output.read().decode("utf-8", "replace")
        return code, text.replace("\r\n", "\n").splitlines()


def execute_page(name, text, scratch):
    """Returns the report of a page."""
    report = Report()
    found, mistakes = blocks(text)
    report.mistakes = [f"{name}:{line}: {mistake}" for line, mistake in mistakes]
    for number, block in enumerate(found):
        if block.file:
            scratch.write(block.file, block.lines)
        if block.language != "sh":
            continue
        after = found[number + 1] if number + 1 < len(found) else None
        after = after if after and after.language == "text" else None
        place = f"{name}:{block.line}"
        if block.is_skipped:
            report.skipped.append(f"{place}: {block.lines[0] if block.lines else ''}")
            if after and not after.is_skipped:
                place = f"{name}:{after.line}"
                report.mistakes.append(f"{place}: the command is skipped, so write ```text skip")
            continue
        code_line = block.lines[-1] if block.lines else ""
        wanted = EXIT_CODE.search(code_line)
        wanted = int(wanted[1]) if wanted else 0
        started_s = processor_s()
        code, output = scratch.execute("\n".join(block.lines))
        report.times.append((processor_s() - started_s, place))
        report.executed += 1
        end = "\n".join(f"    {line}" for line in output[-20:])
        if code is None:
            limit = f"{scratch.limit_s:.0f} s"
            report.mistakes.append(f"{place}: the block does not end within {limit}\n{end}")
            continue
        if code != wanted:
            report.mistakes.append(f"{place}: exit code {code} instead of {wanted}\n{end}")
        if after and not after.is_skipped:
            report.compared += 1
            changes = difference(after.lines, output)
            if changes:
                shown = "\n".join(f"    {line}" for line in changes)
                place = f"{name}:{after.line}"
                report.mistakes.append(f"{place}: the output differs (- page, + program)\n{shown}")
        elif after:
            report.skipped.append(f"{name}:{after.line}: the output of line {block.line}")
    return report


def prepare(program, base, jobs):
    """Makes the directory that every page gets a copy of, unless it is there already."""
    digest = hashlib.sha256(program.read_bytes())
    digest.update("\n".join([*FILES, *PREPARED, CARGO]).encode())
    for name in FILES:
        for file in sorted((ROOT / name).rglob("*")):
            if file.is_file():
                digest.update(f"{file.relative_to(ROOT)}\0".encode() + file.read_bytes())
    key, keys = digest.hexdigest(), base.with_suffix(".key")
    if keys.exists() and keys.read_text() == key:
        return
    keys.unlink(missing_ok=True)
    if base.exists():
        shutil.rmtree(base)
    base.mkdir(parents=True)
    for name in FILES:
        ignored = shutil.ignore_patterns("__pycache__", "Cargo.toml", "*.rs")
        shutil.copytree(ROOT / name, base / name, ignore=ignored)
    for link in (".bin/brakecheck", "target/release/brakecheck"):
        (base / link).parent.mkdir(parents=True)
        (base / link).symlink_to(program)
    (base / ".bin/cargo").write_text(CARGO)
    (base / ".bin/cargo").chmod(0o755)

    def run(arguments):
        command = [str(program), *arguments.split()]
        done = subprocess.run(command, cwd=base, capture_output=True, text=True)
        if done.returncode != 0:
            raise SystemExit(f"docs/run.py: brakecheck {arguments} fails:\n{done.stderr}")

    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        list(pool.map(run, PREPARED))
    for directory in PREPARED_DIRECTORIES:
        if not (base / directory).is_dir():
            raise SystemExit(f"docs/run.py: brakecheck makes no {directory}")
    keys.write_text(key)


def execute(pages, program, work, jobs, limit_s):
    """Executes pages, given as pairs of name and text, and returns their report."""
    base = work / "base"
    prepare(program, base, jobs)

    def one(page):
        name, text = page
        scratch = Scratch(base, work / "pages" / name.replace("/", "+"), limit_s)
        for prepared in PREPARED_DIRECTORIES if name in BARE_PAGES else []:
            shutil.rmtree(scratch.directory / prepared)
        return execute_page(name, text, scratch)

    total = Report()
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for report in pool.map(one, pages):
            total.add(report)
            for mistake in report.mistakes:
                print(mistake, flush=True)
    return total


def processor_s():
    """Returns the processor time of all programs that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def bad_use(problem):
    print(f"docs/run.py: {problem}", file=sys.stderr)
    return 2


def main(arguments):
    parser = argparse.ArgumentParser(
        prog="docs/run.py", description="Execute the commands that the pages quote."
    )
    parser.add_argument("--brakecheck", type=Path, default=ROOT / "target/release/brakecheck")
    parser.add_argument("--work", type=Path, help="directory that is kept, for a faster next run")
    parser.add_argument("--jobs", type=int, default=1, help="pages at the same time")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds that a block may take")
    parser.add_argument("--times", action="store_true", help="print processor times, with --jobs 1")
    parser.add_argument("--skipped", action="store_true", help="print the skipped blocks")
    parser.add_argument("--self-test", action="store_true", help="plant mistakes and detect them")
    parser.add_argument("pages", nargs="*", metavar="PAGE", type=Path)
    given = parser.parse_args(arguments)
    if given.self_test:
        return self_test()
    program = given.brakecheck.resolve()
    if not os.access(program, os.X_OK) or not program.is_file():
        return bad_use(f"no program {given.brakecheck}")
    if given.jobs < 1:
        return bad_use("--jobs requires 1 or more")
    paths = given.pages or [page for pattern in PAGES for page in sorted(ROOT.glob(pattern))]
    pages = []
    for path in paths:
        if not path.is_file():
            return bad_use(f"no page {path}")
        path = path.resolve()
        name = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path
        pages.append((str(name).lstrip("/"), path.read_text(encoding="utf-8")))
    started_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="brakecheck-pages-") as temporary:
        work = (given.work or Path(temporary)).resolve()
        report = execute(pages, program, work, given.jobs, given.limit)
    if given.times:
        for used_s, place in sorted(report.times, reverse=True)[:20]:
            print(f"{used_s:8.1f} s  {place}")
    if given.skipped:
        print("\n".join(f"skipped {block}" for block in report.skipped))
    print(
        f"{len(pages)} pages: {report.executed} blocks executed, {report.compared} outputs "
        f"compared, {len(report.skipped)} blocks skipped, {len(report.mistakes)} mistakes, "
        f"{time.monotonic() - started_s:.0f} s, {processor_s():.0f} s of processor time"
    )
    if not report.executed:
        print("docs/run.py: no block was executed", file=sys.stderr)
        return 1
    return 1 if report.mistakes else 0


# The rest tests this program with a false brakecheck.

FALSE_PROGRAM = """#!/bin/sh
case "$1" in
train) mkdir -p "$4" ;;
search) mkdir -p crashes ;;
eval)
    [ "$2" = --starts ] || { echo "error: unexpected argument '$2'" >&2; exit 2; }
    echo "trained: 4$$.0 s of processor time, $$ decisions/s"
    echo "1/2 evaluating nominal: 3 of 9 after $$ s, about 7 s left" >&2
    echo "success $3 %"
    echo "more" >&2
    echo "kept in /tmp/x$$"
    ;;
gate) echo "it fails"; exit 1 ;;
hang) sleep 60 ;;
*) exit 2 ;;
esac
"""

RIGHT_PAGE = """# Page
```sh
brakecheck eval --starts 50
```
```text
trained: 48.0 s of processor time, 3337 decisions/s
success 50 %
…
kept in /tmp/abc
```
- A gate with `two.py`:
  ```python
  print("two")
  ```
  ```sh
  $B eval --starts 3 > three 2>&1
  cargo run --release -- eval --starts 4 >> three 2>&1
  grep success three
  python3 two.py
  ! test -e ../other
  $B gate   # exit 1
  ```
  ```text
  success 3 %
  success 4 %
  two
  it fails
  ```
```sh skip
exit 7
```
"""

# Texts of the right page, each with a mistake that takes its place.
PLANTED = [
    ("success 50 %\n…", "success 51 %\n…"),
    ("3337 decisions/s", "3337 episodes/s"),
    ("\n…\n", "\n"),
    ("success 50 %\n…\n", "…\nsuccess 50 %\n"),
    ("kept in /tmp/abc\n", "kept in /tmp/abc\nall is well\n"),
    ("\n  it fails", "\n  it passes"),
    ("--starts 50", "--start 50"),
    ("brakecheck eval --starts 50", "brakecheck evil --starts 50"),
    ("brakecheck eval --starts 50", "$C eval --starts 50"),
    ("brakecheck eval --starts 50", "brakecheck hang"),
    ("# exit 1", "# exit 2"),
    ("  $B gate   # exit 1", "  $B gate"),
    ('print("two")', 'print("three")'),
    ("`two.py`", "`other.py`"),
    ("grep success three", "false"),
    ("```sh\nbrakecheck", "```bash\nbrakecheck"),
    ("```sh skip", "```sh"),
    ("```sh skip", "```sh skipped"),
    ("exit 7\n```", "exit 7\n```\n```text\nout\n```"),
    ("exit 7\n```", "exit 7"),
]


def self_test():
    """Plants each mistake on a page, and fails unless it is detected."""
    with tempfile.TemporaryDirectory(prefix="brakecheck-pages-") as temporary:
        work = Path(temporary)
        program, page = work / "program", work / "page.md"
        program.write_text(FALSE_PROGRAM)
        program.chmod(0o755)

        def code_of(text, *paths):
            page.write_text(text, encoding="utf-8")
            arguments = ["--brakecheck", program, "--work", work / "work", "--limit", 2]
            output = io.StringIO()
            with redirect_stdout(output), redirect_stderr(output):
                code = main([str(it) for it in [*arguments, *(paths or [page])]])
            return code, output.getvalue()

        failures = []
        expected = "1 pages: 2 blocks executed, 2 outputs compared, 1 blocks skipped, 0 mistakes"
        code, output = code_of(RIGHT_PAGE)
        if code != 0 or expected not in output:
            failures.append(f"the right page fails with {code}:\n{output}")
        for right, wrong in PLANTED:
            assert RIGHT_PAGE.count(right) >= 1, right
            code, output = code_of(RIGHT_PAGE.replace(right, wrong, 1))
            if code != 1 or "page.md:" not in output:
                failures.append(f"{wrong!r} is not detected: {code}\n{output}")
        if code_of("# A page without commands\n")[0] != 1:
            failures.append("a page without commands passes")
        if code_of(RIGHT_PAGE, work / "absent.md")[0] != 2:
            failures.append("an absent page passes")
        program.write_text("#!/bin/sh\nexit 2\n")
        try:
            failures.append(f"a program that fails passes: {code_of(RIGHT_PAGE)}")
        except SystemExit:
            pass
    print("\n".join(failures) or f"{len(PLANTED) + 3} planted mistakes are detected")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
