"""The page of `brakecheck drive`, in a real browser."""

import json
import os
import re
import shutil
import signal
import subprocess
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect, sync_playwright

PROGRAM = os.environ["PROGRAM"]
WORLDS = Path(__file__).parents[2] / "worlds"


@pytest.fixture(scope="module")
def browser():
    with sync_playwright() as playwright:
        # Software rendering, since a test machine has no graphics card.
        options = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path=os.environ["CHROMIUM"], args=options)
        yield browser
        browser.close()


@contextmanager
def drive(browser, *arguments, cwd):
    """A page on a drive, which ends with the block."""
    command = [PROGRAM, "drive", *map(str, arguments), "--json"]
    program = subprocess.Popen(command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        mistakes = []
        page.on("pageerror", lambda error: mistakes.append(str(error)))
        page.on("console", lambda it: mistakes.append(it.text) if it.type == "error" else None)
        page.goto(json.loads(program.stdout.readline())["address"])
        expect(page.locator("#wheel")).to_have_text("You are at the wheel.")
        yield page
        assert not mistakes, mistakes
        page.close()
    finally:
        program.send_signal(signal.SIGINT)
        _, messages = program.communicate(timeout=20)
    assert program.returncode == 0, messages


def seconds(page: Page) -> float:
    return float(page.locator("#clock").inner_text().split()[0])


def speed(page: Page, agent: str) -> float:
    row = page.locator("#numbers tr", has_text=f"{agent}, speed")
    return float(row.locator("td").nth(1).inner_text().split()[0])


def wait_for_time(page: Page, at_least: float) -> None:
    # The page forbids evaluated text, so the browser cannot wait by itself.
    until = time.monotonic() + 30
    while seconds(page) < at_least:
        assert time.monotonic() < until, f"{seconds(page)} s of {at_least} s"
        time.sleep(0.02)


def test_keys_drive_the_car(browser, tmp_path):
    with drive(browser, "acc", "--plant", "rigid", cwd=tmp_path) as page:
        before = speed(page, "ego")
        page.keyboard.down("ArrowUp")
        page.keyboard.press("Space")
        wait_for_time(page, 1.5)
        page.keyboard.press("Space")
        page.keyboard.up("ArrowUp")
        expect(page.locator("#run")).to_contain_text("Go")
        assert speed(page, "ego") > before + 0.5
        # Back to a moment: the clock and the speed of then.
        at = seconds(page)
        page.keyboard.press("Comma")
        page.locator("#timeline").fill("1")
        expect(page.locator("#clock")).to_have_text("0.05 s")
        assert at > 0.05
        page.locator("#resume").click()
        page.keyboard.down("ArrowDown")
        wait_for_time(page, 1.0)
        page.keyboard.up("ArrowDown")
        assert speed(page, "ego") < before + 0.5, "another way on from there"


def test_a_crash_is_shown_kept_and_replayed(browser, tmp_path):
    with drive(browser, "acc", cwd=tmp_path) as page:
        for _ in range(30):
            page.keyboard.down("ArrowUp")
            page.locator("#speed").select_option("4")
            page.keyboard.press("Space")
            expect(page.locator("#verdict")).to_be_visible(timeout=30_000)
            page.keyboard.up("ArrowUp")
            expect(page.locator("#run")).to_contain_text("Go", timeout=30_000)
            if page.locator("#keep").is_enabled():
                break
            page.keyboard.press("n")
            expect(page.locator("#verdict")).to_be_hidden()
        words = page.locator("#verdict").inner_text()
        assert words.startswith("failed"), words
        margin = page.locator("#margins .number").first.inner_text()
        page.keyboard.press("k")
        expect(page.locator("#note")).to_contain_text("Kept as")
        name = re.search(r"Kept as (\S+\.ron)", page.locator("#note").inner_text())[1]
        page.screenshot(path=tmp_path / "crash.png")
    kept = tmp_path / name
    replay = [PROGRAM, "replay", str(kept), "--expect", "recorded", "--json"]
    replayed = subprocess.run(replay, capture_output=True, text=True, check=False)
    assert replayed.returncode == 0, replayed.stderr
    # The verdict in the page's words holds the robustness that the library gives.
    said = float(re.search(r"ρ (-?[0-9.]+)", words)[1])
    recorded = float(re.search(r"robustness: (-?[0-9.e+-]+),", kept.read_text())[1])
    assert abs(said - recorded) < 1e-3
    assert margin.startswith(("−", "-")), margin


def test_a_broken_world_shows_its_problem_and_a_mended_one_its_scene(browser, tmp_path):
    world = tmp_path / "mine.ron"
    shutil.copy(WORLDS / "acc.ron", world)
    text = world.read_text()
    with drive(browser, world, "--watch", cwd=tmp_path) as page:
        time.sleep(0.1)
        world.write_text(text.replace("horizon_s", "horizom_s", 1))
        problems = page.locator("#problems")
        expect(problems).to_be_visible(timeout=10_000)
        expect(problems).to_contain_text("horizom_s")
        time.sleep(0.1)
        world.write_text(text)
        expect(problems).to_be_hidden(timeout=10_000)
        expect(page.locator("#clock")).to_have_text("0.00 s")


def test_a_second_page_watches(browser, tmp_path):
    with drive(browser, "acc", cwd=tmp_path) as page:
        other = browser.new_page()
        other.goto(page.url)
        expect(other.locator("#wheel")).to_contain_text("You watch")
        expect(other.locator("#run")).to_be_disabled()
        page.keyboard.press("Period")
        expect(page.locator("#clock")).not_to_have_text("0.00 s")
        expect(other.locator("#clock")).to_have_text(page.locator("#clock").inner_text())
        other.close()
        page.keyboard.press("Period")


def test_real_time_is_kept_on_rigid_bodies(browser, tmp_path):
    with drive(browser, "acc", "--plant", "rigid", cwd=tmp_path) as page:
        page.evaluate(
            """() => { window.pictures = 0; const count = () => { window.pictures++; requestAnimationFrame(count); }; count(); }"""
        )
        begun, played = time.monotonic(), 0.0
        while time.monotonic() - begun < 20:
            page.keyboard.press("Space")
            started = time.monotonic()
            wait_for_time(page, 0.1)
            expect(page.locator("#run")).to_contain_text("Go", timeout=60_000)
            took, now = time.monotonic() - started, seconds(page)
            # Real time, within the time that the browser takes to show the end.
            assert took > 0.8 * now - 0.2
            played += now
            page.keyboard.press("n")
            expect(page.locator("#clock")).to_have_text("0.00 s")
        took = time.monotonic() - begun
        print(f"{page.evaluate('window.pictures') / took:.0f} pictures per second, {played:.1f} s of the world in {took:.1f} s")
        assert played > 0
