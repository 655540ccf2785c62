"""The built documentation in a real browser, opened from disk; `bash docs/build.sh` builds it."""

import re

import pytest
from tools import ROOT

from hpcsweep.commands.cli import COMMANDS

pytestmark = pytest.mark.browser
SITE = ROOT / "docs" / "_build" / "html"
BROKEN = "() => [...document.images].filter(i => !(i.complete && i.naturalWidth)).map(i => i.src)"
NOT_SET = """() => [...document.querySelectorAll('.math')]
    .filter(m => !m.querySelector('mjx-container')).length"""


def pages():
    assert (SITE / "index.html").exists(), "bash docs/build.sh builds the pages"
    found = sorted(SITE.glob("**/*.html"))
    return [page for page in found if not {"_static", "_modules"} & set(page.parts)]


def complaints_of(browser, path) -> list[str]:
    """Open a page; return what it prints or asks the network for, and what it does not show."""
    page = browser.new_page()
    found = []
    page.on("console", lambda message: found.append(message.text))
    page.on("pageerror", lambda error: found.append(str(error)))
    page.on(
        "request",
        lambda request: (
            request.url.startswith(("file:", "data:")) or found.append(f"asks for {request.url}")
        ),
    )
    page.goto(path.as_uri(), wait_until="load")
    if page.query_selector(".math"):
        page.evaluate("() => window.MathJax.startup.promise")
        if page.evaluate(NOT_SET):
            found.append("has formulas that are not set")
    page.evaluate("() => Promise.all([...document.images].map(i => i.decode().catch(() => 0)))")
    found += [f"lacks {source}" for source in page.evaluate(BROKEN)]
    page.close()
    return found


def test_every_page_opens_without_a_network(browser):
    assert {path.name: said for path in pages() if (said := complaints_of(browser, path))} == {}


def test_links_between_pages_lead_somewhere():
    lost = []
    for path in pages():
        for target in re.findall(r'href="([^"]+)"', path.read_text()):
            if re.match(r"[a-z]+:", target) or target.startswith("#"):
                continue
            name, _, anchor = target.partition("#")
            file = path.parent / name.partition("?")[0]
            if not file.exists() or (anchor and f'id="{anchor}"' not in file.read_text()):
                lost.append((path.name, target))
    assert lost == []


def test_the_gallery_has_every_example_with_what_it_prints_and_draws():
    scripts = {path.stem for path in (ROOT / "docs" / "gallery").glob("[0-9]*.py")}
    built = {path.stem for path in (SITE / "auto_gallery").glob("[0-9]*.html")}
    assert scripts == built
    assert len(scripts) >= 10
    for name in scripts:
        text = (SITE / "auto_gallery" / f"{name}.html").read_text()
        assert "sphx-glr-script-out" in text or "_images/" in text, name


def test_the_help_of_every_command_is_there():
    text = (SITE / "generated" / "command-line.html").read_text()
    assert [name for name in COMMANDS if f'id="{name}"' not in text] == []
