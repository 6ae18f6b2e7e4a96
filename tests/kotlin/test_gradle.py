"""What Gradle reads of android-bindings: the module metadata, and the sample app's build files.

Gradle is not available here: what it would do with these files is not shown. The metadata are held to the POMs and to
the files that they name, after `mvn -f android-bindings verify`.
"""

import hashlib
import json
import os
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
BINDINGS = Path(os.environ.get("CAMSSF_BINDINGS", ROOT / "android-bindings"))
REPOSITORY = BINDINGS / "packaging" / "target" / "repository" / "org" / "camssf"
SAMPLE = ROOT / "android-bindings" / "sample"
PARENT = ET.parse(ROOT / "android-bindings" / "pom.xml").getroot()
POM = {"m": "http://maven.apache.org/POM/4.0.0"}
MODULES = ["bom", "camera2", "camerax", "colour", "core", "finder", "model", "model-gaussian", "passport", "testing"]

published = pytest.mark.skipif(not REPOSITORY.is_dir(), reason="no jar (mvn -f android-bindings verify)")
pytestmark = pytest.mark.full


def read(module: str) -> tuple[dict[str, Any], ET.Element, Path]:
    """The metadata, the POM and the folder of a module."""
    (metadata,) = (REPOSITORY / f"camssf-{module}").glob("*/*.module")
    pom = ET.parse(metadata.with_suffix(".pom")).getroot()
    return json.loads(metadata.read_text("utf-8")), pom, metadata.parent


def text(of: ET.Element, name: str) -> str:
    found = of.find(f"m:{name}", POM)
    return found.text or ""


@published
@pytest.mark.requirement("R-RELEASE")
@pytest.mark.parametrize("module", MODULES)
def test_metadata_have_the_specified_form_and_say_what_the_pom_says(module: str) -> None:
    metadata, pom, folder = read(module)
    assert next(iter(metadata.items())) == ("formatVersion", "1.1")
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


def test_the_samples_wrapper_is_gradles_own() -> None:
    """The jar's hash is the one that Gradle publishes for 8.14.3, which the properties fetch by its hash."""
    wrapper = SAMPLE / "gradle" / "wrapper"
    published = "7d3a4ac4de1c32b59bc6a4eb8ecb8e612ccd0cf1ae1e99f66902da64df296172"
    assert hashlib.sha256((wrapper / "gradle-wrapper.jar").read_bytes()).hexdigest() == published
    properties = (wrapper / "gradle-wrapper.properties").read_text("utf-8")
    assert "/gradle-8.14.3-bin.zip\ndistributionSha256Sum=" in properties
    assert os.access(SAMPLE / "gradlew", os.X_OK)
