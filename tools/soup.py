"""Run-time dependencies, versions, licences, known faults, as the site shows them: `python -m tools.soup`.

Python's come from the installed metadata, Kotlin's from the SBOMs that `mvn -f android-bindings verify` writes. The
purpose of a dependency, what its wheel bundles, and its known faults are in tools/soup.json; a missing or superfluous
entry there, no licence or the GPL make the command exit with 1. Without SBOMs it leaves Kotlin out.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path

from tools.pages import markdown_table
from tools.sbom import UNSTATED, Found, closure

ROOT = Path(__file__).parents[1]
NOT_BUILT = "This site was built without the SBOMs that `mvn -f android-bindings verify` writes."


def kotlin_found() -> Found:
    """Kotlin's dependencies from the SBOMs of the shipped artifacts; empty if there are none."""
    found: dict[str, tuple[str, str]] = {}
    for path in sorted((ROOT / "android-bindings/packaging/target/repository").glob("**/*-cyclonedx.json")):
        for each in json.loads(path.read_text("utf-8"))["components"]:
            if each.get("group") != "org.camssf" and each["name"] != "android-all":
                licences = [
                    str(one.get("expression") or one["license"].get("id") or one["license"]["name"])
                    for one in each.get("licenses", [])
                ]
                found[f"{each['group']}:{each['name']}"] = (each["version"], " OR ".join(licences) or UNSTATED)
    return dict(sorted(found.items()))


LANGUAGES = {"python": closure, "kotlin": kotlin_found}
"""What finds the dependencies: Python's in this environment."""


def read_known() -> dict[str, dict[str, dict[str, str]]]:
    """The entries of tools/soup.json: by language, then by the dependency's name."""
    return dict(json.loads(Path(__file__).with_suffix(".json").read_text("utf-8")))


def faults(found: Found, known: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Missing and superfluous entries of tools/soup.json, and licences that a closed app may not ship."""
    missing = [f"{name}: add its purpose and known faults to tools/soup.json." for name in found if name not in known]
    licences = [
        f"{name}: its licence is {licence}."
        for name, (_, licence) in found.items()
        if licence == UNSTATED or re.search(r"(?<!L)GPL", licence)
    ]
    superfluous = [f"{name} in tools/soup.json is no dependency." for name in known if name not in found]
    return missing + licences + superfluous


def table(language: str) -> str:
    """The table, then what only others need; bundled software is listed with the licence."""
    found, known = LANGUAGES[language](), read_known()[language]
    if not found:
        return NOT_BUILT
    rows, others = [], []
    for name, (version, licence) in found.items():
        entry = {"for": "", "known": "none"} | known.get(name, {})
        if entry["for"] == "others":  # only other dependencies need it
            others.append(f"{name} {version} ({licence})")
            continue
        whole = licence + (f"; bundles {entry['bundles']}" if "bundles" in entry else "")
        fault = "" if entry["known"] == "none" else f"; **known:** {entry['known']}"
        rows.append((name, version, whole, entry["for"] + fault))
    head = ("package", "version", "licence", "purpose; known faults")
    return f"{markdown_table(head, rows)}\n\nNeeded only by these: {', '.join(others)}."


def main() -> int:
    """Compare tools/soup.json with what is installed and built; returns 1 if there are faults."""
    known, wrong, counts = read_known(), [], []
    for language, find in LANGUAGES.items():
        if found := find():
            wrong += faults(found, known[language])
        counts.append(f"{len(found)} of {language}" if found else f"{language} not built")
    for each in wrong:
        print(each, file=sys.stderr)
    print(f"soup: {', '.join(counts)}, {len(wrong)} faults")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
