"""What a reader can do with the page besides moving its slider."""

import time

import pytest
from browser import MISSING, complaints, opened

pytestmark = pytest.mark.skipif(MISSING, reason="there is no Chromium with its driver")

_PICTURE = "return document.querySelector(arguments[0]).toDataURL()"
_ERRORS = "[data-part=error-chart] canvas"
_SCENE = "[data-part=mechanism] canvas"


@pytest.fixture(scope="module")
def driver(two_link_results):
    with opened(two_link_results / "report" / "index.html") as driver:
        yield driver
        assert not complaints(driver)


def picture(driver, place):
    return driver.execute_script(_PICTURE, place)


def test_the_legend_switches_curves_and_sets(driver):
    whole = picture(driver, _ERRORS)
    buttons = driver.find_elements("css selector", "[data-part=legend] button")
    assert len(buttons) > 3
    for button in buttons:
        button.click()
        assert button.get_attribute("aria-pressed") == "false"
        assert picture(driver, _ERRORS) != whole
        button.click()
        assert button.get_attribute("aria-pressed") == "true"
        assert picture(driver, _ERRORS) == whole


def test_a_point_is_named_and_a_click_goes_there(driver):
    from selenium.webdriver import ActionChains

    over = driver.find_element("css selector", "[data-part=error-chart] .u-over")
    driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", over)
    width, height = over.size["width"], over.size["height"]
    seen = set()
    for x in range(-width // 2 + 5, width // 2, width // 13):
        for y in range(-height // 2 + 5, height // 2, height // 10):
            ActionChains(driver, duration=0).move_to_element_with_offset(over, x, y).perform()
            spot = driver.find_element("css selector", "[data-part=error-spot]").text
            if " parameter" not in spot or spot in seen:
                continue
            seen.add(spot)
            ActionChains(driver, duration=0).click().perform()
            count = driver.find_element("css selector", "[data-part=count]").text
            noun = "parameter" if count == "1" else "parameters"
            assert spot.split(": ")[1].startswith(f"{count} {noun}, ")
            torque = driver.find_element("css selector", "[data-part=torque]").text
            assert torque.split(" / ")[0] in spot
    assert len(seen) > 5


def test_the_mechanism_plays_and_pauses(driver):
    place = driver.find_element("css selector", "[data-part=mechanism]")
    button, slider = (place.find_element("css selector", name) for name in ("button", "input"))
    assert button.text == "Play"
    before = slider.get_attribute("value")
    button.click()
    assert button.text == "Pause"
    until = time.monotonic() + 5
    while slider.get_attribute("value") == before:
        assert time.monotonic() < until, "nothing moves"
        time.sleep(0.02)
    button.click()
    stopped = picture(driver, _SCENE)
    time.sleep(0.2)
    assert picture(driver, _SCENE) == stopped


def test_the_mechanism_turns_by_keys(driver):
    from selenium.webdriver.common.keys import Keys

    canvas = driver.find_element("css selector", _SCENE)
    canvas.click()
    seen = [picture(driver, _SCENE)]
    for key in (Keys.ARROW_LEFT, Keys.ARROW_UP, "+"):
        canvas.send_keys(key)
        seen.append(picture(driver, _SCENE))
    assert len(set(seen)) == len(seen)
    for key in ("-", Keys.ARROW_DOWN, Keys.ARROW_RIGHT):
        canvas.send_keys(key)
    back = picture(driver, _SCENE)
    assert back == seen[0]


def test_the_command_is_copied(driver):
    driver.execute_cdp_cmd(
        "Browser.grantPermissions",
        {"permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"]},
    )
    button = driver.find_element("css selector", "[data-copy]")
    driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", button)
    button.click()
    read = "const done = arguments[0]; navigator.clipboard.readText().then(done, (e) => done(String(e)))"
    assert driver.execute_async_script(read) == button.get_attribute("data-copy")


def test_without_scripts_figures_and_tables_are_there(two_link_results):
    """The explorer and what leads to it are not."""
    with opened(two_link_results / "report" / "index.html", scripts=False) as driver:
        assert not driver.find_element("css selector", "#explorer").is_displayed()
        assert not driver.find_element("css selector", "nav a.live").is_displayed()
        figures = driver.find_elements("css selector", "figure img, figure svg")
        tables = driver.find_elements("css selector", "table")
        assert sum(one.is_displayed() for one in figures) > 5
        assert sum(one.is_displayed() for one in tables) > 2
        assert driver.find_element("css selector", ".parameters").is_displayed()
