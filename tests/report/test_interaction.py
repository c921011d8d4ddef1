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
    pressed = [button.get_attribute("aria-pressed") for button in buttons]
    sets = [button.get_attribute("class") == "set" for button in buttons]
    assert sum(p == "true" for p, s in zip(pressed, sets, strict=True) if not s) <= 3, (
        "heuristics at first"
    )
    assert sum(p == "true" for p, s in zip(pressed, sets, strict=True) if s) == 1
    for button, before in zip(buttons, pressed, strict=True):
        button.click()
        assert button.get_attribute("aria-pressed") != before
        assert picture(driver, _ERRORS) != whole
        button.click()
        assert button.get_attribute("aria-pressed") == before
        assert picture(driver, _ERRORS) == whole


def part(driver, name):
    return driver.find_element("css selector", f"[data-part={name}]")


def step_to(driver, row):
    driver.execute_script(
        "const s = document.querySelector('[data-part=n]'); s.value = arguments[0]; s.dispatchEvent(new Event('input'));",
        row,
    )


def test_two_models_stand_side_by_side(driver):
    step_to(driver, 2)
    assert not part(driver, "versus").is_displayed()
    part(driver, "pin").click()
    step_to(driver, 4)
    rows = [
        [cell.text for cell in row.find_elements("css selector", "th, td")]
        for row in part(driver, "versus").find_elements("css selector", "tr")
    ]
    assert [name.partition(":")[2] for name in rows[0][1:]] == ["5", "3"]
    values = {row[0]: row[1:] for row in rows[1:]}
    assert values["parameters"] == ["5", "3"]
    assert values["operations, inverse dynamics"][0] == part(driver, "inverse").text
    alone = [
        0 if text == "none" else len(text.split()) for text in values["parameters of one alone"]
    ]
    assert alone[0] - alone[1] == 2
    assert "Stop comparing" in part(driver, "pin").text
    part(driver, "pin").click()
    assert not part(driver, "versus").is_displayed()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("abc", "is not a positive number"),
        ("-2", "is not a positive number"),
        ("0", "is not a positive"),
    ],
)
def test_a_tolerance_that_cannot_be_is_said(driver, text, said):
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.ui import Select

    Select(part(driver, "heuristic")).select_by_visible_text("qr")
    step_to(driver, 0)
    field = part(driver, "tolerance")
    field.clear()
    field.send_keys(text + Keys.TAB)
    assert said in part(driver, "no-such").text
    assert part(driver, "count").text == "1"


def test_a_tolerance_that_no_model_keeps_is_said(measured_results):
    from selenium.webdriver.common.keys import Keys

    with opened(measured_results / "results" / "report" / "index.html") as driver:
        part(driver, "tolerance").send_keys("0.001" + Keys.TAB)
        assert "is within 0.001 %; the least error is" in part(driver, "no-such").text


def test_a_link_unfolds_what_it_leads_to(driver):
    section = driver.find_element("id", "mechanism")
    assert section.get_attribute("open") is None
    driver.find_element("css selector", "nav a[href='#mechanism']").click()
    assert section.get_attribute("open") is not None


def test_the_page_is_short_and_figures_are_whole(two_link_results):
    page = two_link_results / "report" / "index.html"
    with opened(page) as driver:
        assert driver.execute_script("return document.documentElement.scrollHeight") <= 9 * 800
    with opened(page, width=390) as driver:
        wide = driver.execute_script(
            "document.querySelectorAll('details').forEach((d) => { d.open = true; });"
            "return [...document.querySelectorAll('figure img')].map((i) => i.getBoundingClientRect().right)"
        )
        assert len(wide) > 5
        assert max(wide) <= 390


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
    driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", button)
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
        for summary in driver.find_elements("css selector", "details.part:not([open]) > summary"):
            summary.click()
        assert sum(one.is_displayed() for one in figures) > 5
        assert sum(one.is_displayed() for one in tables) > 2
        assert driver.find_element("css selector", ".parameters").is_displayed()
