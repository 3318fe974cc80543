"""A report of a small study, and a browser to look at it."""

import shutil

import pytest

from commands import swept

WORDS = ["filter=baseline,jerk", "adaptation=none,mtf", "disturbance=none,multipath_single_axis", "seeds=2"]

CHROMIUM = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--no-first-run", "--window-size=1500,1200"),
)

WIDE = {"width": 1500, "height": 1200, "deviceScaleFactor": 1, "mobile": False}


@pytest.fixture(scope="session")
def sweep(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    done = swept(*WORDS, "dataset.duration_s=60", "report=true", "figures=all", "workers=2", cwd=folder)
    return folder / "results" / "adhoc", done


@pytest.fixture(scope="session")
def report(sweep):
    return sweep[0] / "report.html"


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    pytest.importorskip("selenium", reason="selenium is not there; pip install 'jerkbench[test]'")
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("chromium and its driver are not there (Debian: chromium chromium-driver)")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for word in CHROMIUM:
        options.add_argument(word)
    options.add_argument(f"--user-data-dir={tmp_path_factory.mktemp('chromium')}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    with webdriver.Chrome(options=options, service=Service(driver)) as opened:
        yield opened


@pytest.fixture
def opened(browser, report):
    """The report on a wide screen, whatever screen the test before had: Chromium resizes its page with a delay."""
    from selenium.webdriver.support.ui import WebDriverWait

    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", WIDE)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})
    browser.get(report.as_uri())
    WebDriverWait(browser, 60).until(lambda page: page.execute_script("return innerWidth") == WIDE["width"])
    return browser
