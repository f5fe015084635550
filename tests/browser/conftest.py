"""The browser of the pages' tests."""

import os

import pytest
from playwright.sync_api import sync_playwright


@pytest.fixture(scope="session")
def browser():
    with sync_playwright() as playwright:
        # Software rendering, since a test machine has no graphics card. The page around the
        # scene is put together without it, which is twice as fast.
        software = ["--disable-gpu-compositing", "--use-gl=angle", "--use-angle=swiftshader"]
        options = ["--no-sandbox", "--enable-unsafe-swiftshader", *software]
        browser = playwright.chromium.launch(executable_path=os.environ["CHROMIUM"], args=options)
        yield browser
        browser.close()
