"""What the tests of the fleet begin with: a registry, a desk for batches, and what `camssf registry` says."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from camssf import cli
from camssf.documents.forms import from_plain, to_plain
from camssf.documents.schema import schema
from camssf_fleet.documents import DeletionDocument, DriftDocument, SpreadDocument, VerificationDocument
from camssf_fleet.registry import Registry
from tests.support.desk import Desk

FORMS = {
    "camssf-spread/1": SpreadDocument, "camssf-drift/1": DriftDocument,
    "camssf-verification/1": VerificationDocument, "camssf-deletion/1": DeletionDocument,
}  # fmt: skip


@pytest.fixture
def one(tmp_path: Path) -> Registry:
    return Registry(tmp_path / "phones", new=True)


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path)


class Said:
    """What the `registry` commands of a test say."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self.capsys = capsys

    def __call__(self, *words: object, status: int = 0) -> tuple[str, str]:
        """Output and message of a command."""
        self.capsys.readouterr()
        assert cli.main(["registry", *map(str, words)]) == status, self.capsys.readouterr().err
        out, err = self.capsys.readouterr()
        return out, " ".join(err.split())

    def document(self, *words: object, status: int = 0) -> dict[str, Any]:
        """The document printed, held to its type, which reads it, and to its schema."""
        plain: dict[str, Any] = json.loads(self(*words, status=status)[0])
        form = FORMS[plain["format"]]
        assert to_plain(from_plain(plain, form, "it", "")) == plain
        jsonschema.Draft202012Validator(schema(form)).validate(plain)
        return plain


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Said:
    return Said(capsys)
