"""The self-test APK as Android reads it, made by `mvn -f android-bindings verify -Papk`."""

import os
import re
import shutil
import struct
import subprocess
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BINDINGS = Path(os.environ.get("CAMSSF_BINDINGS", ROOT / "android-bindings"))
APK = BINDINGS / "selftest" / "target" / "camssf-selftest.apk"
PAGE = 16384
TOOLS = ("mvn", "aapt", "zipalign", "apksigner")

pytestmark = [pytest.mark.full, pytest.mark.requirement("R-ANDROID")]
if missing := [tool for tool in TOOLS if shutil.which(tool) is None]:
    pytest.skip(f"there is no {', '.join(missing)}: no APK is packed or read", allow_module_level=True)


def entry_starts(apk: Path, suffix: str) -> dict[str, tuple[int, int]]:
    """The compression and the first byte of the data of each entry with this suffix."""
    starts = {}
    with zipfile.ZipFile(apk) as archive, apk.open("rb") as file:
        for entry in archive.infolist():
            if entry.filename.endswith(suffix):
                file.seek(entry.header_offset + 26)
                name, extra = struct.unpack("<HH", file.read(4))
                starts[entry.filename] = entry.compress_type, entry.header_offset + 30 + name + extra
    return starts


def test_natives_are_stored_at_pages_of_16_kib(tmp_path: Path) -> None:
    """The build's own packing, of stand-ins: no registry here has the phone's ONNX Runtime."""
    natives = {
        f"lib/{abi}/lib{name}.so" for abi in ("arm64-v8a", "x86_64") for name in ("onnxruntime", "onnxruntime4j_jni")
    }
    for number, name in enumerate(sorted(natives)):
        (tmp_path / "native" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "native" / name).write_bytes(bytes(10_000 + 777 * number))
    for archive, member in (("resources.apk", "AndroidManifest.xml"), ("classes.zip", "classes.dex")):
        with zipfile.ZipFile(tmp_path / archive, "w", zipfile.ZIP_DEFLATED) as written:
            written.writestr(member, member * 100)
    apk = tmp_path / "packed.apk"
    settings = [f"-Dout={tmp_path}", f"-Dapk={apk}"]
    done = subprocess.run(
        ["mvn", "--batch-mode", "-N", "-f", str(BINDINGS), "antrun:run@pack", *settings],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    starts = entry_starts(apk, ".so")
    assert set(starts) == natives
    assert all(kind == zipfile.ZIP_STORED and start % PAGE == 0 for kind, start in starts.values()), starts


def test_the_built_apk_is_what_an_app_is() -> None:
    if not APK.is_file():
        pytest.skip("no jar, no APK (mvn -f android-bindings verify -Papk): it is not read back")
    read = ["aapt", "dump", "xmltree", str(APK), "AndroidManifest.xml"]
    manifest = subprocess.run(read, capture_output=True, text=True, check=True).stdout
    flags = dict(re.findall(r"A: android:(\w+)\(\w+\)=\(type 0x12\)(0x\w+)", manifest))
    assert flags["extractNativeLibs"] == flags["allowBackup"] == "0x0"
    assert "largeHeap" not in manifest
    assert set(re.findall(r"android\.permission\.\w+", manifest)) == {"android.permission.CAMERA"}
    starts = entry_starts(APK, ".so") | entry_starts(APK, "resources.arsc")
    assert "resources.arsc" in starts
    assert all(kind == zipfile.ZIP_STORED and start % PAGE == 0 for kind, start in starts.values()), starts
