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
from typing import Any, TypeAlias

from tools.closure import UNSTATED, closure
from tools.pages import markdown_table

ROOT = Path(__file__).parents[1]
KNOWN = Path(__file__).parent / "soup.json"
HEAD = ("package", "version", "licence", "purpose; known faults")
INDIRECT = "others"
"""The purpose of what only other dependencies need."""
NOT_BUILT = "This site was built without the SBOMs that `mvn -f android-bindings verify` writes."
Found: TypeAlias = Mapping[str, tuple[str, str]]
"""Version and licence by name."""


def python_found() -> Found:
    """Python's dependencies in this environment."""
    return {each.name: (each.version, each.licence) for each in closure()}


def kotlin_found(folder: Path = ROOT / "android-bindings") -> Found:
    """Kotlin's dependencies from the SBOMs of the shipped artifacts; empty if there are none."""
    found: dict[str, tuple[str, str]] = {}
    for path in sorted((folder / "packaging" / "target" / "repository").glob("**/*-cyclonedx.json")):
        for each in json.loads(path.read_text("utf-8"))["components"]:
            if each.get("group") != "org.camssf" and each["name"] != "android-all":
                found[f"{each['group']}:{each['name']}"] = (each["version"], _licence(each))
    return dict(sorted(found.items()))


def read_known() -> dict[str, dict[str, dict[str, str]]]:
    """The entries of tools/soup.json: by language, then by the dependency's name."""
    return dict(json.loads(KNOWN.read_text("utf-8")))


def _licence(component: Mapping[str, Any]) -> str:
    said = [
        str(each.get("expression") or each["license"].get("id") or each["license"]["name"])
        for each in component.get("licenses", [])
    ]
    return " OR ".join(said) or UNSTATED


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


def table(found: Found, known: Mapping[str, Mapping[str, str]]) -> str:
    """The table, then what only others need; bundled software is listed with the licence."""
    rows, others = [], []
    for name, (version, licence) in found.items():
        versions = known.get(name, {})
        if versions.get("for") == INDIRECT:
            others.append(f"{name} {version} ({licence})")
            continue
        whole = licence + (f"; bundles {versions['bundles']}" if "bundles" in versions else "")
        fault = versions.get("known", "none")
        fault = "" if fault == "none" else f"; **known:** {fault}"
        rows.append((name, version, whole, f"{versions.get('for', '')}{fault}"))
    return f"{markdown_table(HEAD, rows)}\n\nNeeded only by these: {', '.join(others)}."


def python_table() -> str:
    """The table of Python's dependencies in this environment."""
    return table(python_found(), read_known()["python"])


def kotlin_table() -> str:
    """The table of Kotlin's dependencies, or what to do where the artifacts are not built."""
    found = kotlin_found()
    return table(found, read_known()["kotlin"]) if found else NOT_BUILT


def main() -> int:
    """Compare tools/soup.json with what is installed and built; returns 1 if there are faults."""
    known, wrong, counts = read_known(), [], []
    for language, found in (("python", python_found()), ("kotlin", kotlin_found())):
        if found:
            wrong += faults(found, known[language])
        counts.append(f"{len(found)} of {language}" if found else f"{language} not built")
    for each in wrong:
        print(each, file=sys.stderr)
    print(f"soup: {', '.join(counts)}, {len(wrong)} faults")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
