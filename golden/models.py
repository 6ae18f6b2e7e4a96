"""Runs the golden cases on the shipped models: `python -m golden.models`; exit status 1 if one fails."""

from __future__ import annotations

import sys

from golden import reading
from golden.forms import GoldenError
from golden.running import by_model, findings


def main() -> int:
    """Run every case and print which fail and by how much."""
    passed, failed = 0, 0
    for path in reading.paths():
        try:
            case = reading.read_case(path)
            if not by_model(case):
                continue
            broken = [finding for finding in findings(case, "onnx") if not finding.holds]
            wrong = [f"{finding.limit}: {finding.measured:.2e} > {finding.bound:.0e}" for finding in broken]
        except GoldenError as error:
            wrong = [str(error)]
        for fault in wrong:
            print(f"  FAILED {path.parent.name}/{path.stem}: {fault}")
        passed, failed = passed + (not wrong), failed + bool(wrong)
    print(f"{passed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
