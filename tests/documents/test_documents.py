"""The reader and the writer of documents, "camssf/2": nothing is lost, and every fault is named by its place."""

import json
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, get_args, get_type_hints

import jsonschema
import pytest

from camssf.calibration import attempt
from camssf.documents import forms
from camssf.documents.document import ADVICE, document_bytes, read_document
from camssf.documents.schema import described, schema
from camssf.errors import InvalidArgument
from camssf.result import Result
from camssf_colour.document import ColourDocument
from camssf_colour.picture_document import PictureDocument
from camssf_colour.spectrum_document import SpectrumDocument
from tests.support.documents import document, refused, unnamed, unplaced

SYNTHETIC: dict[str, Callable[[], Result]] = {
    "one shot": document, "two shots": lambda: document("D55", "A"), "an unnamed light": unnamed, "refused": refused,
    "refused, measured": lambda: refused(shots=True), "refused, not placed": unplaced,
    "unread, of an unnamed light": lambda: attempt("none.dng"),
}  # fmt: skip


def shuffled(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: shuffled(value[key]) for key in sorted(value, reverse=True)}
    return [shuffled(entry) for entry in value] if isinstance(value, list) else value


@pytest.mark.parametrize("make", SYNTHETIC.values(), ids=SYNTHETIC)
def test_what_is_written_is_read_and_written_as_it_was(make: Callable[[], Result], tmp_path: Path) -> None:
    data = document_bytes(make())
    (tmp_path / "result.json").write_bytes(data)
    again = read_document(tmp_path / "result.json", Result)
    assert document_bytes(again) == data
    turned = forms.from_plain(shuffled(json.loads(data)), Result, "x.json", ADVICE)
    assert document_bytes(turned) == data  # its hash holds for whatever order of the keys
    assert data.endswith(b"}\n")


def test_old_forms_odd_names_and_huge_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Faults of the content: test_forms.py; others of a file: test_names.py, test_streams.py, test_wrong_uses.py."""
    path = tmp_path / "result.json"
    path.write_text('{"format": "camssf-patches/1"}')
    with pytest.raises(InvalidArgument, match=r"result\.json.* measure or calibrate the photos anew"):
        read_document(path, Result)
    with pytest.raises(InvalidArgument, match="cannot be read"):
        read_document("a\0b", Result)
    monkeypatch.setattr(forms, "LARGEST", 100)
    path.write_bytes(b" " * 101)
    with pytest.raises(InvalidArgument, match="larger than 100 bytes"):
        read_document(path, Result)


def parts(hint: Any) -> set[Any]:
    """The dataclasses that a type holds, at any depth, but for those of a form of their own."""
    if isinstance(hint, type) and is_dataclass(hint):
        hints = get_type_hints(hint, include_extras=True)
        inner = () if hasattr(hint, "from_plain") else [hints[name] for name in forms.fields_of(hint)]
        return {hint}.union(*map(parts, inner))
    return set().union(*map(parts, get_args(hint)))


@pytest.mark.parametrize("document", [Result, ColourDocument, SpectrumDocument, PictureDocument])
def test_the_schema_says_what_each_field_holds(document: type) -> None:
    jsonschema.Draft202012Validator.check_schema(schema(document))
    for kind in parts(document):
        if not hasattr(kind, "from_plain"):
            named = {entry.name for entry in fields(kind)} & set(forms.fields_of(kind))
            assert named <= described(kind)[1].keys(), kind


@pytest.mark.full
def test_what_is_written_is_what_the_schema_says() -> None:
    judge = pytest.importorskip("jsonschema_rs").validator_for(schema(Result))
    for make in SYNTHETIC.values():
        judge.validate(json.loads(document_bytes(make())))
