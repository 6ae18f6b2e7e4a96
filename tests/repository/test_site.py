"""The documentation as a browser shows it: built strictly, and judged by axe-core in both colour schemes."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.support.axe import serious_faults
from tests.support.browser import Browser

ROOT = Path(__file__).parents[2]
SHOWN = ("index.html", "cli/index.html", "jvm/index.html", "reference/camssf/index.html")
"""A page of each kind: picture, tables and links, other languages' code, docstrings."""

pytestmark = pytest.mark.full


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("mkdocs", reason="mkdocs is not installed: the site is not built")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "-q", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(
        command, cwd=ROOT, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return folder


@pytest.mark.requirement("R-DOCS")
def test_the_home_page_leads_to_five_groups_and_the_repository(site: Path) -> None:
    text = (site / "index.html").read_text("utf-8")
    settings = yaml.safe_load((ROOT / "mkdocs.yml").read_text("utf-8"))
    assert len(settings["nav"]) == 5
    tabs = re.findall(r'<li class="md-tabs__item[^"]*">', text)
    assert len(tabs) == 5
    assert f'href="{settings["repo_url"]}"' in text
    assert (site / settings["theme"]["logo"]).read_bytes().startswith(b"<svg")
    assert settings["theme"]["logo"] in text
    assert re.search(r'<img alt="[^"]{20,}" src="images/[\w-]+\.png"', text)


@pytest.mark.parametrize(("page", "shown"), [
    ("verdict", "hardly more than a typical phone"), ("verdict", "ink-jet copy of the chart"),
    ("formats", "<code>white_reflectance</code>"),
    ("errors", "Too many samples are clipped"),
    ("errors/glare", "Usual causes"), ("traceability", "R-DOCS"), ("soup", "all arithmetic"),
    ("registry", "penalties of the fit"), ("passport", "valid from then on"), ("errors", "exit status"),
    ("tables", "Philips TL84"), ("real", "auto, no Nikon"),
    ("reference/errors", 'id="camssf.errors.Glare"'),
    ("cli", "Where the report goes"), ("paper", "non-negativity: wavelengths, clipped"),
])  # fmt: skip
def test_what_is_not_kept_is_on_the_site(page: str, shown: str, site: Path) -> None:
    """Pages and tables that tools/site_pages.py makes."""
    assert shown in (site / page / "index.html").read_text("utf-8")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("page", SHOWN)
def test_axe_finds_no_serious_fault_in_the_site(page: str, scheme: str, site: Path, browser: Browser) -> None:
    browser.open((site / page).as_uri())
    assert serious_faults(browser, scheme) == []
    if page == "index.html":  # without our styles and scripts it finds the theme's
        plain = (site / page).with_name(f"plain-{scheme}.html")  # beside the page, so that the others are found
        text = (site / page).read_text("utf-8")
        plain.write_text(re.sub(r"<(script|link)[^>]*assets/site\.(js|css)[^>]*>", "", text), "utf-8")
        browser.open(plain.as_uri())
        assert "aria-hidden-focus" in {fault[0] for fault in serious_faults(browser, scheme)}
