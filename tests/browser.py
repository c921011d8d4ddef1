"""A page in a real browser."""

import shutil
from contextlib import contextmanager

CHROMIUM = shutil.which("chromium")
DRIVER = shutil.which("chromedriver")
MISSING = CHROMIUM is None or DRIVER is None
_OPTIONS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--hide-scrollbars",
)  # fmt: skip


@contextmanager
def opened(page, *, width=1280, height=800, place="", dark=False, scripts=True):
    """A window with a page in it, ready to be used.

    Args:
        page: The file.
        width: Of the window, px.
        height: Of the window, px.
        place: What follows the # of the address.
        dark: Whether the reader prefers dark pages.
        scripts: Whether those of the page run.
    """
    from selenium import webdriver
    from selenium.webdriver.support.ui import WebDriverWait

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for word in _OPTIONS:
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options, webdriver.ChromeService(DRIVER))
    try:
        screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
        driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": not scripts})
        driver.get(f"file://{page}{place and '#' + place}")
        ready = "return document.getElementById('explorer').dataset.ready === 'true'"
        if scripts:
            WebDriverWait(driver, 20, 0.02).until(lambda d: d.execute_script(ready))
        yield driver
    finally:
        driver.quit()


def complaints(driver):
    """What went wrong in the console."""
    return [entry["message"] for entry in driver.get_log("browser") if entry["level"] == "SEVERE"]
