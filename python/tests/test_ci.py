"""Files for other people's CI: their schemas, and each shell step with the program on PATH."""

import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from importlib.metadata import version
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
#: The program and the tools beside the interpreter of the tests.
BIN = str(Path(sys.executable).parent)

EGO = """
import brakecheck

def timid(percept):
    leader = percept.leader()
    return -6.0 if leader and leader.headway_m < 3 * percept.own.speed_mps else 0.0

brakecheck.serve_ego(timid)
"""


def blocks():
    """The YAML of the page, by the file that its first line names."""
    page = (ROOT / "docs/guide/ci.md").read_text(encoding="utf-8")
    found = re.findall(r"^```yaml\n# (\S+).*?\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    return dict(found)


def shell(script, cwd, **given):
    """Runs a step as the services do: errors and broken pipes end it."""
    env = {**os.environ, "PATH": f"{BIN}:/usr/bin:/bin", **given}
    return subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script],
        cwd=cwd, env=env, capture_output=True, text=True,
    )


@pytest.fixture()
def project(tmp_path, kept):
    """A user's repository: an ego, a kept crash and a world."""
    (tmp_path / "crashes").mkdir()
    for file in kept.glob("acc-nominal-0001.*"):
        (tmp_path / "crashes" / file.name).write_bytes(file.read_bytes())
    (tmp_path / "my_ego.py").write_text(EGO)
    (tmp_path / "worlds").mkdir()
    (tmp_path / "worlds/mine.ron").write_text((ROOT / "worlds/acc.ron").read_text())
    return tmp_path


def cases(file):
    suites = ElementTree.parse(file).getroot()
    return [suites.attrib[key] for key in ("tests", "failures")]


@pytest.mark.parametrize(
    ("schema", "name"),
    [
        ("github-actions", "action.yml"),
        ("github-workflows", ".github/workflows/ci.yml"),
        ("github-workflows", ".github/workflows/release.yml"),
        ("github-workflows", ".github/workflows/brakecheck.yml"),
        ("gitlab-ci", ".gitlab-ci.yml"),
    ],
)
def test_files_follow_the_schemas_of_the_services(schema, name, tmp_path):
    file = ROOT / name
    if not file.exists():
        file = tmp_path / "file.yml"
        file.write_text(blocks()[name])
    check = [f"{BIN}/check-jsonschema", "--builtin-schema", f"vendor.{schema}", str(file)]
    done = subprocess.run(check, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def action(project, inputs):
    """Plays the shell steps of the action with its inputs; the last of them."""
    described = yaml.safe_load((ROOT / "action.yml").read_text())
    values = {f"inputs.{name}": it.get("default", "") for name, it in described["inputs"].items()}
    values |= {f"inputs.{name}": value for name, value in inputs.items()}
    values |= {
        "github.action_path": str(ROOT), "github.server_url": "file://", "runner.os": "Linux",
        "github.action_repository": "nowhere", "runner.arch": "X64", "runner.temp": str(project),
    }
    assert set(inputs) <= set(described["inputs"])
    files = {name: str(project / name) for name in ("GITHUB_PATH", "GITHUB_STEP_SUMMARY")}
    for step in described["runs"]["steps"]:
        if "run" not in step:
            continue
        env = {
            name: re.sub(r"\$\{\{ (.*?) \}\}", lambda it: values[it[1]], text)
            for name, text in step["env"].items()
        }
        done = shell(step["run"], project, **env, **files)
        if done.returncode != 0:
            break
    return done


def test_the_action_replays_crashes_and_keeps_junit(project):
    workflow = yaml.safe_load(blocks()[".github/workflows/brakecheck.yml"])
    steps = workflow["jobs"]["crashes"]["steps"]
    (used,) = [step for step in steps if "brakecheck@" in step.get("uses", "")]
    installed = [step["run"] for step in steps if "run" in step]
    assert all(shell(run, project).returncode == 0 for run in installed if "pip" not in run)
    done = action(project, used["with"])
    assert done.returncode == 0, done.stdout + done.stderr
    assert cases(project / "brakecheck-results/junit.xml") == ["1", "0"]
    assert "acc-nominal-0001" in (project / "GITHUB_STEP_SUMMARY").read_text()


def test_the_action_fails_with_the_code_of_the_program(project):
    done = action(project, {"arguments": "crashes"})
    assert done.returncode == 1, done.stdout + done.stderr
    assert cases(project / "brakecheck-results/junit.xml") == ["1", "1"]
    assert action(project, {"arguments": "nowhere"}).returncode == 2
    assert "use replay or gate" in action(project, {"verb": "eval", "arguments": "x"}).stdout
    done = action(project, {"arguments": "'my crashes' $(touch executed)"})
    assert done.returncode == 2 and "my crashes" in done.stderr
    assert not (project / "executed").exists()
    # The words before the quote would be a command of their own: it would replay all crashes.
    done = action(project, {"arguments": "crashes -- python3 'my ego.py"})
    assert done.returncode == 2 and "unmatched quote" in done.stdout, done.stdout + done.stderr


def test_a_page_that_fails_hides_no_result(project):
    done = action(project, {"arguments": "crashes", "report": "nowhere"})
    assert done.returncode == 1, done.stdout + done.stderr
    assert cases(project / "brakecheck-results/junit.xml") == ["1", "1"]
    passing = {"arguments": "crashes -- python3 my_ego.py", "report": "nowhere"}
    done = action(project, passing)
    assert done.returncode == 2, done.stdout + done.stderr
    assert cases(project / "brakecheck-results/junit.xml") == ["1", "0"]


def test_the_action_installs_the_binary_of_its_release_if_its_sum_is_right(tmp_path):
    (install, *_) = yaml.safe_load((ROOT / "action.yml").read_text())["runs"]["steps"]
    name = f"brakecheck-{version('brakecheck')}-x86_64-unknown-linux-gnu"
    release = tmp_path / f"v{version('brakecheck')}"
    (release / name).mkdir(parents=True)
    (release / name / "brakecheck").write_text("#!/bin/sh\necho installed\n")
    (release / name / "brakecheck").chmod(0o755)
    pack = f"tar -czf {name}.tar.gz {name} && shasum -a 256 *.tar.gz > SHA256SUMS"
    assert shell(pack, release).returncode == 0
    (tmp_path / "temporary").mkdir()
    given = {
        "ACTION": str(ROOT), "RELEASES": f"file://{tmp_path}", "RUNNER": "Linux-X64",
        "TEMPORARY": str(tmp_path / "temporary"), "GITHUB_PATH": str(tmp_path / "path"),
        # Without the program of the tests.
        "PATH": "/usr/bin:/bin",
    }
    done = shell(install["run"], tmp_path, **given)
    assert done.returncode == 0, done.stdout + done.stderr
    program = Path((tmp_path / "path").read_text().strip()) / "brakecheck"
    assert subprocess.run([program], capture_output=True, text=True).stdout == "installed\n"
    (release / f"{name}.tar.gz").write_bytes(b"another")
    assert shell(install["run"], tmp_path, **given).returncode != 0


def test_the_action_gates_an_ego_and_writes_the_page(project, run):
    gated = {
        "verb": "gate", "report": run.path, "results": "out",
        "arguments": f"{run.path} --baseline-ego nominal --ego 'firm gains' --starts 20",
    }
    done = action(project, gated)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    assert cases(project / "out/junit.xml")[0] != "0"
    assert "<html" in (project / "out/report.html").read_text()


def test_the_job_of_gitlab_runs(project):
    job = yaml.safe_load(blocks()[".gitlab-ci.yml"])["crashes"]
    done = shell("\n".join(job["script"]), project)
    assert done.returncode == 0, done.stdout + done.stderr
    assert cases(project / job["artifacts"]["reports"]["junit"]) == ["1", "0"]


def test_the_parts_of_a_campaign_are_merged(project):
    jobs = yaml.safe_load(blocks()["parts.gitlab-ci.yml"])
    (project / "campaign.ron").write_text(
        'Campaign(name: "parts", worlds: [(file: "acc", plant: Kinematic)],\n'
        "    ados: [Neutral, Held, Search(switches: 0)], starts: Drawn(count: 12))\n"
    )
    total = jobs["part"]["parallel"]
    for index in range(1, total + 1):
        given = {"CI_NODE_INDEX": str(index), "CI_NODE_TOTAL": str(total)}
        done = shell("\n".join(jobs["part"]["script"]), project, **given)
        assert done.returncode == 0, done.stdout + done.stderr
    # Artifacts of the parts are there, and nothing else.
    done = shell("\n".join(jobs["merge"]["script"]), project)
    assert done.returncode == 0, done.stdout + done.stderr
    assert len((project / "plan/merged/rows.jsonl").read_text().splitlines()) == 3 * 12


def test_pre_commit_checks_worlds(project):
    tool = [f"{BIN}/pre-commit"]
    hooks = ROOT / ".pre-commit-hooks.yaml"
    assert subprocess.run([*tool, "validate-manifest", str(hooks)]).returncode == 0
    git = "git -c user.name=me -c user.email=me@localhost -c init.defaultBranch=main"
    # The hooks in a repository of their own: `try-repo` clones what it is given.
    source = project / "source"
    source.mkdir()
    (source / hooks.name).write_text(hooks.read_text())
    made = shell(f"{git} init -q . && {git} add -A && {git} commit -qm hooks", source)
    assert made.returncode == 0, made.stderr
    assert shell(f"{git} init -q . && {git} add worlds crashes", project).returncode == 0
    tried = f"pre-commit try-repo {source} brakecheck-check --all-files --verbose"
    cache = {"PRE_COMMIT_HOME": str(project / "cache")}
    done = shell(tried, project, **cache)
    assert done.returncode == 0 and "Passed" in done.stdout, done.stdout + done.stderr
    broken = project / "worlds/mine.ron"
    broken.write_text(broken.read_text().replace("Vehicle(", "Vehicel(", 1))
    done = shell(f"{git} add worlds; {tried}", project, **cache)
    assert done.returncode == 1 and "Vehicel" in done.stdout, done.stdout + done.stderr


def test_the_job_of_kubernetes_makes_a_partition_per_index(project):
    text = (ROOT / "examples/kubernetes/campaign.yaml").read_text()
    job = yaml.safe_load(text)
    spec = job["spec"]
    (container,) = spec["template"]["spec"]["containers"]
    (count,) = [it["value"] for it in container["env"] if it["name"] == "PARTITIONS"]
    assert (job["apiVersion"], job["kind"]) == ("batch/v1", "Job")
    assert spec["completions"] == int(count) and spec["completionMode"] == "Indexed"
    (project / "campaign.ron").write_text(
        'Campaign(name: "k", worlds: [(file: "acc", plant: Kinematic)],\n'
        "    ados: [Neutral, Held], starts: Drawn(count: 16))\n"
    )
    plan = str(project / "plan")
    assert shell(f"brakecheck campaign plan campaign.ron -o {plan} --piece-s 0.01", project).returncode == 0
    command = container["command"]
    assert command[:2] == ["sh", "-c"]
    for index in range(int(count)):
        given = {"PLAN": plan, "PARTITIONS": count, "JOB_COMPLETION_INDEX": str(index)}
        done = shell(command[2], project, **given)
        assert done.returncode == 0, done.stderr
    assert shell(f"brakecheck campaign merge {plan}", project).returncode == 0


def test_a_campaign_is_made_by_workers_of_dask(project):
    (project / "campaign.ron").write_text(
        'Campaign(name: "dask", worlds: [(file: "acc", plant: Kinematic)],\n'
        "    ados: [Training(seeds: 1, decisions: 1000), Held], starts: Drawn(count: 20))\n"
    )
    example = ROOT / "python/examples/dask_campaign.py"
    done = shell(f"{sys.executable} {example} campaign.ron plan", project)
    assert done.returncode == 0 and "SHA-256" in done.stdout, done.stdout + done.stderr
    assert len((project / "plan/merged/rows.jsonl").read_text().splitlines()) == 2 * 20


def test_archives_of_releases_have_the_licences(tmp_path):
    release = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text())
    (pack,) = [it for it in release["jobs"]["binaries"]["steps"] if it.get("name") == "Pack"]
    for name in ("README.md", "LICENSE", "THIRD_PARTY.txt", "CHANGELOG.md"):
        (tmp_path / name).write_text("text")
    program = tmp_path / "target/some/dist/brakecheck"
    program.parent.mkdir(parents=True)
    # It writes a manual page and completions.
    program.write_text('#!/bin/sh\n[ "$1" = man ] && mkdir -p "$3" || echo completions\n')
    program.chmod(0o755)
    done = shell(pack["run"], tmp_path, NAME="archive", TARGET="some", RUNNER_OS="Linux")
    assert done.returncode == 0, done.stderr
    packed = shell("tar -tzf dist/archive.tar.gz", tmp_path).stdout.split()
    assert {"archive/brakecheck", "archive/LICENSE", "archive/THIRD_PARTY.txt"} <= set(packed)
