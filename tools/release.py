"""Makes a release in out/release, or without a key rehearses one: `python -m tools.release [--key FINGERPRINT]`.

Sdist, wheel, SBOM and the signed Maven bundle go to out/release/dist. Then each is installed from a
folder that plays the package index, into an empty environment or project, and runs the first page that a user reads.
A rehearsal signs with a throwaway key, and takes Maven's artefacts of the last `mvn verify` if they are there.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

from benchmarks.shared import command_parser
from camssf.version import __version__
from tools import sbom
from tools.tutorials import outputs

ROOT = Path(__file__).parents[1]
OUT = ROOT / "out" / "release"
DIST, INDEX, CENTRAL = OUT / "dist", OUT / "index", OUT / "central"
BINDINGS = ROOT / "android-bindings"
EXTRA = "notebook"
"""What the first tutorial installs in addition to the package."""
ERROR = "from camssf import Result; print(Result.load('out/result.json').scores.rmse.max())"


def run(*command: str | Path, cwd: Path = ROOT, variables: Mapping[str, str] | None = None) -> str:
    """A command's output, in an environment without this checkout's Python.

    Raises:
        SystemExit: the command failed; with the end of what it printed.
    """
    inherited = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=cwd, env=inherited | dict(variables or {}), capture_output=True, text=True)
    if done.returncode:
        printed = "".join((done.stdout + done.stderr).splitlines(keepends=True)[-40:])
        raise SystemExit(f"{' '.join(words)} failed in {cwd}:\n{printed}")
    return done.stdout


def environment(name: str) -> Path:
    """The bin folder of a new, empty environment."""
    run(sys.executable, "-m", "venv", OUT / name)
    return OUT / name / "bin"


def build_python() -> None:
    """Sdist, wheel and SBOM.

    Raises:
        SystemExit: the wheel does not hold each file of the packages, and nothing else.
    """
    workshop = environment("workshop")
    run(workshop / "pip", "install", "-q", "-c", ROOT / "constraints.txt", "hatchling")
    run(workshop / "python", "-m", "hatchling", "build", "-d", DIST)
    folders = (*(ROOT / "reference").glob("camssf*"), ROOT / "export" / "camssf_onnx")
    paths = [path for folder in folders for path in folder.rglob("*") if path.is_file() and path.suffix != ".pyc"]
    (wheel,) = DIST.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
        licences = {Path(name).name for name in archive.namelist() if ".dist-info/licenses/" in name}
    if odd := packed ^ {path.relative_to(ROOT).as_posix().partition("/")[2] for path in paths}:
        raise SystemExit(f"Only in the wheel or only in packages: {', '.join(sorted(odd))}. See pyproject.toml.")
    if licences != {"LICENSE", "NOTICE"}:
        raise SystemExit("The wheel is without LICENSE or NOTICE. Look at license-files in pyproject.toml.")
    sbom.main(["-o", str(DIST / f"camssf-{__version__}-cyclonedx.json")])


def try_python() -> None:
    """Wheel and sdist with pip alone that sees nothing but the folder; README's demo, then the first tutorial.

    Raises:
        SystemExit: the demo's curves are not those of its phone.
    """
    shutil.copytree(DIST, INDEX, ignore=shutil.ignore_patterns("*.json", "*.zip"))
    (wheel,) = DIST.glob("*.whl")
    pip = (OUT / "workshop" / "bin" / "pip", "download", "-q", "-d", INDEX, "-c", ROOT / "constraints.txt")
    run(*pip, f"{wheel}[{EXTRA}]", "hatchling")
    alone = {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(INDEX)}
    (demo,) = re.findall(r"(?<=bin/camssf) (demo -o out/)$", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE)
    for name, words in {"wheel": (f"camssf[{EXTRA}]",), "sdist": ("--no-binary", "camssf", "camssf")}.items():
        programs, place = environment(name), OUT / f"{name}-tried"
        run(programs / "pip", "install", "-q", *words, variables=alone)
        place.mkdir()
        run(programs / "camssf", *demo.split(), cwd=place)
        error = float(run(programs / "python", "-c", ERROR, cwd=place))
        if not 0 < error < 0.1:
            raise SystemExit(f"The curves of the {name}'s demo are {error:.3f} off its phone's.")
    programs, page = OUT / "wheel" / "bin", ROOT / "docs" / "tutorials" / "first-phone.md"
    (OUT / "tutorial").mkdir()
    outputs(page.read_text("utf-8"), OUT / "tutorial", str(programs / "python"), str(programs))


def build_kotlin(key: str | None) -> None:
    """The signed bundle of what `mvn verify` leaves, unpacked into the folder that plays Maven Central."""
    mvn = ("mvn", "--batch-mode", "--no-transfer-progress", "-f", BINDINGS)
    if key is not None or not (BINDINGS / "packaging" / "target" / "repository" / "org" / "camssf").is_dir():
        run(*mvn, "verify", "-Papk")
    sign = (*mvn, "-N", "antrun:run@bundle", f"-Drelease.out={DIST}")
    if key is not None:
        run(*sign, f"-Drelease.key={key}")
    else:
        with tempfile.TemporaryDirectory(prefix="gpg") as folder:  # the path of the agent's socket must be short
            home, unlocked = {"GNUPGHOME": folder}, ("--batch", "--pinentry-mode", "loopback", "--passphrase", "")
            try:
                run("gpg", *unlocked, "--quick-gen-key", "rehearsal", variables=home)
                run(*sign, "-Drelease.key=rehearsal", "-Drelease.rehearsal=true", variables=home)
            finally:
                run("gpgconf", "--kill", "all", variables=home)
    shutil.rmtree(DIST / "signed")
    (bundle,) = DIST.glob("*-bundle.zip")
    with zipfile.ZipFile(bundle) as archive:
        archive.extractall(CENTRAL)


def try_kotlin() -> None:
    """docs/jvm.md in an empty project, word for word, but that its repository is the folder."""
    page = ("-m", "full", "tests/kotlin/test_recipes.py", "-k", "new_jvm_project")
    run(sys.executable, "-m", "pytest", "-q", "-n", "0", *page, variables={"CAMSSF_REPOSITORY": str(CENTRAL)})


def main() -> None:
    """Run the command; exits with 1 and a message if a step failed."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--key", metavar="FINGERPRINT", help="one of gpg's secret keys; without it, a rehearsal")
    key = parser.parse_args().key
    if key is not None and subprocess.run(["gpg", "--list-secret-keys", key], capture_output=True).returncode:
        raise SystemExit(f"gpg has no secret key {key}; `gpg --list-secret-keys` shows those it has.")
    steps = {
        "sdist, wheel, SBOM": build_python,
        "both from a folder, with README's demo and the first tutorial": try_python,
        "Maven bundle": lambda: build_kotlin(key),
        "docs/jvm.md with the bundle": try_kotlin,
    }
    shutil.rmtree(OUT, ignore_errors=True)
    DIST.mkdir(parents=True)
    for name, step in steps.items():
        print(f"{name} ...", flush=True)
        step()
    print(*sorted(path.relative_to(ROOT) for path in DIST.iterdir()), sep="\n")
    what = "release: the files to upload are" if key else "rehearsal: nothing is to be uploaded of what is"
    print(f"{__version__}, {what} in {DIST.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
