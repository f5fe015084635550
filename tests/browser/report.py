"""The page of `brakecheck report`, in a real browser, from its file."""

import json
import os
import re
import subprocess

import pytest
from playwright.sync_api import Page, expect

PROGRAM = os.environ["PROGRAM"]
STARTS = 150


def run(*arguments) -> str:
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A page with crashes and a sweep, and the sweep itself."""
    here = tmp_path_factory.mktemp("report")
    trained, rows, page = here / "run", here / "rows.json", here / "page.html"
    run("train", "acc", "-o", trained, "--plant", "kinematic", "--decisions", 20_000, "--starts", 20)
    swept = run("sweep", trained, "--over", "ego.time_gap_s=0.5..2.5:3", "--starts", 60, "--json")
    rows.write_text(swept)
    run("report", trained, "-o", page, "--starts", STARTS, "--rows", rows)
    return page, json.loads(swept)["swept"]


@pytest.fixture
def page(browser, report):
    page = browser.new_page(viewport={"width": 1280, "height": 900}, reduced_motion="reduce")
    mistakes, asked = [], []
    page.on("pageerror", lambda error: mistakes.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(report[0].as_uri())
    yield page
    assert not mistakes, mistakes
    # One file, and nobody is asked for anything.
    assert asked == [report[0].as_uri()], asked
    page.close()


def test_a_slider_reads_the_results_of_a_sweep(page, report):
    swept = report[1]
    card = page.locator(".lookup", has_text="failing starts over time_gap_s")
    slider = card.locator("input")
    for at, point in enumerate(swept["points"]):
        if at:
            slider.focus()
            slider.press("ArrowRight")
        expect(card.locator("output")).to_have_text(f"{point['value']:g}")
        said = card.locator(".said").inner_text()
        value, failing, starts, share = re.search(r"= (\S+): (\d+) of (\d+) starts fail, (\d+) %", said).groups()
        assert (float(value), int(failing), int(starts)) == (point["value"], point["failing"], point["starts"])
        assert abs(int(share) - 100 * point["failing"] / point["starts"]) <= 0.5
        row = card.locator("tbody tr").nth(at)
        expect(row).to_contain_text(f"{point['failing']} of {point['starts']}")
        expect(card.locator(".estimate.chosen")).to_have_count(1)


# Every place of the two sliders of a card: words, mark and table.
ALL_CELLS = """(card) => {
  const [x, y] = card.querySelectorAll("input"), rows = [...card.querySelectorAll("tbody tr")].reverse();
  const read = [];
  for (let up = 0; up <= y.max; up++) for (let across = 0; across <= x.max; across++) {
    x.value = across; y.value = up;
    y.dispatchEvent(new Event("input"));
    const chosen = [...card.querySelectorAll(".chosen")];
    read.push({
      said: card.querySelector(".said").textContent, cell: rows[up].querySelectorAll("td")[across].textContent,
      marked: chosen.map((it) => it.dataset.cell), sign: chosen[0].querySelector("text")?.textContent ?? "",
      at: `${across},${up}`,
    });
  }
  return read;
}"""


def test_sliders_over_the_start_read_counts_and_say_unknown(page):
    unknown = 0
    for card in page.locator(".lookup", has=page.locator(".cells")).all():
        known = 0
        for place in card.evaluate(ALL_CELLS):
            assert place["marked"] == [place["at"]], place
            if place["cell"] == "unknown":
                assert place["said"].startswith("unknown") and "%" not in place["said"], place
                assert place["sign"] == "?", place
                unknown += 1
            else:
                failing, starts = map(int, re.match(r"(\d+)/(\d+) \[", place["cell"]).groups())
                words = "start fails" if starts == 1 else "starts fail"
                assert place["said"].startswith(f"{failing} of {starts} {words}"), place
                assert starts > 0 and place["sign"] == "", place
                known += starts
        assert 100 < known <= STARTS, "every start is in one cell"
    # With as many cells some are empty, and a share of 0 of 0 is no share.
    assert unknown > 0
    card = page.locator(".lookup").first
    card.locator("[data-cell='0,0']").click()
    assert [it.input_value() for it in card.locator("input").all()] == ["0", "0"], "a click moves the sliders"


def clock(page: Page) -> float:
    return float(page.locator(".clock").first.inner_text().split()[0])


def test_the_player_plays_pauses_steps_scrubs_and_obeys_keys(page):
    film = page.locator(".film").first
    data = json.loads(film.get_attribute("data-film"))
    times, end = data["t"], data["t"][-1]
    film.locator(".deck input").fill("0")
    assert clock(page) == 0
    film.locator(".on").click()
    assert abs(clock(page) - times[1]) < 0.006
    film.locator(".screen").focus()
    for key, at in [(".", 2), ("ArrowRight", 3), (",", 2), ("ArrowLeft", 1), ("Home", 0), ("End", -1)]:
        page.keyboard.press(key)
        assert abs(clock(page) - times[at]) < 0.006, key
    film.locator(".back").click()
    assert abs(clock(page) - times[-2]) < 0.006
    film.locator(".screen").focus()
    page.keyboard.press("Home")
    for words in ["½×", "¼×", "⅒×", "2×", "1×"]:
        page.keyboard.press("s")
        expect(film.locator(".rate")).to_have_text(words)
    page.keyboard.press("Space")
    expect(film.locator(".play")).to_have_text("❚❚")
    page.wait_for_timeout(500)
    page.keyboard.press("Space")
    expect(film.locator(".play")).to_have_text("▶")
    assert 0.1 < clock(page) < end
    moment = clock(page)
    page.wait_for_timeout(300)
    assert clock(page) == moment


def test_without_javascript_the_tables_say_the_same(browser, report):
    file, swept = report
    plain = browser.new_context(java_script_enabled=False)
    page = plain.new_page()
    page.goto(file.as_uri())
    expect(page.locator(".sliders").first).to_be_hidden()
    expect(page.locator(".deck").first).to_be_hidden()
    card = page.locator(".lookup", has_text="failing starts over time_gap_s")
    expect(card.locator("tbody tr")).to_have_count(len(swept["points"]))
    page.locator(".lookup summary").first.click()
    expect(page.locator(".cells").first).to_be_visible()
    plain.close()
