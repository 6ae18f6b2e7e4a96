"""What Gradle reads of android-bindings: the module metadata, and the sample app's build files.

Gradle is not available here: what it would do with these files is not shown. The metadata are held to the format's
published specification and to the POMs, after `mvn -f android-bindings verify`; the build files to each other.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import jsonschema
import pytest

ROOT = Path(__file__).parents[2]
BINDINGS = Path(os.environ.get("CAMSSF_BINDINGS", ROOT / "android-bindings"))
REPOSITORY = BINDINGS / "packaging" / "target" / "repository" / "org" / "camssf"
SAMPLE = ROOT / "android-bindings" / "sample"
PARENT = ET.parse(ROOT / "android-bindings" / "pom.xml").getroot()
POM = {"m": "http://maven.apache.org/POM/4.0.0"}
MODULES = ["bom", "camera2", "camerax", "colour", "core", "finder", "model", "model-gaussian", "passport", "testing"]

published = pytest.mark.skipif(not REPOSITORY.is_dir(), reason="no repository (mvn -f android-bindings verify)")
pytestmark = pytest.mark.full


def entity(required: dict[str, Any], optional: dict[str, Any]) -> dict[str, Any]:
    """An object with these values and no others."""
    return {
        "type": "object",
        "properties": required | optional,
        "required": list(required),
        "additionalProperties": False,
    }


def array(of: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": of}


TEXT = {"type": "string", "minLength": 1}
ATTRIBUTES = {"type": "object", "additionalProperties": {"type": ["string", "boolean", "integer"]}}
CAPABILITIES = array(entity({"group": TEXT, "name": TEXT, "version": TEXT}, {}))
VERSION = entity(
    {},
    {"requires": TEXT, "prefers": TEXT, "strictly": TEXT, "rejects": array(TEXT), "forSubgraph": {"type": "boolean"}},
)
CONSTRAINT = {"version": VERSION, "reason": TEXT, "attributes": ATTRIBUTES}
DEPENDENCY = CONSTRAINT | {
    "excludes": array(entity({"group": TEXT, "module": TEXT}, {})),
    "requestedCapabilities": CAPABILITIES,
    "inheritConstraints": {"type": "boolean"},
}
FILE = entity(
    {"name": TEXT, "url": TEXT, "size": {"type": "integer", "minimum": 1}},
    {name: {"type": "string", "pattern": "^[0-9a-f]+$"} for name in ("sha1", "md5", "sha256", "sha512")},
)
VARIANT = entity(
    {"name": TEXT},
    {
        "attributes": ATTRIBUTES,
        "dependencies": array(entity({"group": TEXT, "module": TEXT}, DEPENDENCY)),
        "dependencyConstraints": array(entity({"group": TEXT, "module": TEXT}, CONSTRAINT)),
        "files": array(FILE),
        "capabilities": CAPABILITIES,
    },
)
GRADLE = entity({"version": TEXT, "buildId": TEXT}, {})
COMPONENT = entity({"group": TEXT, "module": TEXT, "version": TEXT}, {"url": TEXT, "attributes": ATTRIBUTES})
SCHEMA = entity(
    {"formatVersion": {"const": "1.1"}, "component": COMPONENT, "variants": array(VARIANT)},
    {"createdBy": entity({}, {"gradle": GRADLE})},
)
"""All values of the specification of version 1.1 (gradle/gradle, design documents) but `available-at`, since no
module here lies elsewhere. Attributes of a component, integers among attributes and SHA-2 are not in its text, but in
what Gradle itself writes."""


def read(module: str) -> tuple[dict[str, Any], ET.Element, Path]:
    """The metadata, the POM and the folder of a module."""
    (metadata,) = (REPOSITORY / f"camssf-{module}").glob("*/*.module")
    pom = ET.parse(metadata.with_suffix(".pom")).getroot()
    return json.loads(metadata.read_text("utf-8")), pom, metadata.parent


def text(of: ET.Element, name: str) -> str:
    found = of.find(f"m:{name}", POM)
    assert found is not None
    return found.text or ""


@published
def test_every_published_module_has_metadata() -> None:
    assert sorted(path.name.removeprefix("camssf-") for path in REPOSITORY.iterdir()) == MODULES


@published
@pytest.mark.requirement("R-RELEASE")
@pytest.mark.parametrize("module", MODULES)
def test_metadata_have_the_specified_form_and_say_what_the_pom_says(module: str) -> None:
    metadata, pom, folder = read(module)
    jsonschema.Draft202012Validator(SCHEMA).validate(metadata)
    assert next(iter(metadata)) == "formatVersion"
    # Gradle reads a .module only if the POM holds this comment.
    (file,) = folder.glob("*.pom")
    assert "<!-- do_not_remove: published-with-gradle-metadata -->" in file.read_text("utf-8")
    component = metadata["component"]
    assert [component[key] for key in ("group", "module", "version")] == [
        text(pom, name) for name in ("groupId", "artifactId", "version")
    ]
    variants = {each["attributes"]["org.gradle.usage"]: each for each in metadata["variants"]}
    assert len({each["name"] for each in metadata["variants"]}) == len(metadata["variants"]) == 2
    for usage, scopes in {"java-api": {"compile"}, "java-runtime": {"compile", "runtime"}}.items():
        wanted = {
            (text(each, "groupId"), text(each, "artifactId")): text(each, "version").strip("[]")
            for each in pom.findall("m:dependencies/m:dependency", POM)
            if text(each, "scope") in scopes
        }
        found = {
            (each["group"], each["module"]): each["version"]["requires"] for each in variants[usage]["dependencies"]
        }
        assert found == wanted
        for file in variants[usage]["files"]:
            content = (folder / file["url"]).read_bytes()
            assert (len(content), hashlib.sha256(content).hexdigest()) == (file["size"], file["sha256"])
        assert len(variants[usage]["files"]) == (module != "bom")
        elements = variants[usage]["attributes"].get("org.gradle.libraryelements")
        assert elements == {"bom": None, "camera2": "aar"}.get(module, "jar")


@published
@pytest.mark.requirement("R-RELEASE")
@pytest.mark.parametrize(
    ("module", "artifacts"),
    [
        ("core", {"onnxruntime", "onnxruntime-android"}),
        ("camera2", {"onnxruntime-android"}),
        ("bom", {"onnxruntime", "onnxruntime-android"}),
    ],
)
def test_another_onnx_runtime_is_against_the_metadata(module: str, artifacts: set[str]) -> None:
    only = text(PARENT, "properties/m:onnxruntime.version")
    metadata, _, _ = read(module)
    runtime = next(each for each in metadata["variants"] if each["attributes"]["org.gradle.usage"] == "java-runtime")
    found = {
        each["module"]: each["version"]["strictly"]
        for each in runtime["dependencies"] + runtime["dependencyConstraints"]
        if each["group"] == "com.microsoft.onnxruntime"
    }
    assert found == dict.fromkeys(artifacts, only)


def test_the_samples_build_files_agree() -> None:
    """Each library and plugin that the build names is in the catalogue, which has the versions of this build."""
    catalogue = tomllib.loads((SAMPLE / "gradle" / "libs.versions.toml").read_text("utf-8"))
    build = (SAMPLE / "build.gradle.kts").read_text("utf-8")
    named = {name.replace(".", "-") for name in re.findall(r"\(libs\.([a-z0-9.]+)\)", build) if "plugins" not in name}
    assert named == set(catalogue["libraries"])
    assert set(re.findall(r"alias\(libs\.plugins\.([a-z]+)\)", build)) == set(catalogue["plugins"])
    refs = [each["version"]["ref"] for each in (catalogue["libraries"] | catalogue["plugins"]).values()]
    assert set(refs) == set(catalogue["versions"])
    assert catalogue["versions"]["camssf"] == text(PARENT, "version")
    assert catalogue["versions"]["camerax"] == text(PARENT, "properties/m:camerax.version")


def test_the_samples_wrapper_is_gradles_own() -> None:
    """The jar's hash is the one that Gradle publishes for 8.14.3, which the properties fetch by its hash."""
    wrapper = SAMPLE / "gradle" / "wrapper"
    published = "7d3a4ac4de1c32b59bc6a4eb8ecb8e612ccd0cf1ae1e99f66902da64df296172"
    assert hashlib.sha256((wrapper / "gradle-wrapper.jar").read_bytes()).hexdigest() == published
    properties = (wrapper / "gradle-wrapper.properties").read_text("utf-8")
    assert "/gradle-8.14.3-bin.zip\ndistributionSha256Sum=" in properties
    assert os.access(SAMPLE / "gradlew", os.X_OK)
