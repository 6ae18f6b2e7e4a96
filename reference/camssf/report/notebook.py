"""Renders a result as one line of text and as a small piece of HTML for a notebook."""

from __future__ import annotations

from html import escape

from camssf.documents.basis_choice import band_in_words
from camssf.documents.document import Document
from camssf.report.names import camera_of, lamps_of, short
from camssf.report.picture import small_picture
from camssf.verdict.reasons import Verdict

STATUS = {"accepted": "#268a54", "doubtful": "#b07800", "refused": "#c8352b"}


def as_line(result: Document, verdict: Verdict) -> str:
    """`<Result of Nikon D5100, D55: accepted; ...>`, always on one line."""
    codes = ", ".join(dict.fromkeys(reason.code for reason in verdict.reasons))
    head = f"{camera_of(result)}, {lamps_of(result)}: {verdict.status}" + (f" ({codes})" if codes else "")
    basis = [] if result.answer is None else [f"basis {short(result.answer.basis)}"]
    return f"<Result of {'; '.join([head, *basis, *(f'{name} {value}' for name, value in numbers(result))])}>"


def as_html(result: Document, verdict: Verdict) -> str:
    """Verdict and reasons, the curves as SVG, the scores as a table. No script, no style sheet."""
    head = (
        f"<p><strong>{escape(camera_of(result))}</strong>, {escape(lamps_of(result))}: "
        f'<strong style="color:{STATUS[verdict.status]}">{verdict.status}</strong></p>'
    )
    reasons = "".join(
        f"<li><code>{escape(reason.code)}</code>: {escape(reason.message)} {escape(reason.advice)}</li>"
        for reason in verdict.reasons
    )
    rows = "".join(f"<tr><th scope='row'>{escape(a)}</th><td>{escape(b)}</td></tr>" for a, b in numbers(result))
    return (
        f'<div class="camssf-result">{head}{f"<ul>{reasons}</ul>" if reasons else ""}'
        f"{'' if result.answer is None else small_picture(result)}{f'<table>{rows}</table>' if rows else ''}</div>"
    )


def numbers(result: Document) -> list[tuple[str, str]]:
    """The main scores as pairs of name and text; empty without curves."""
    answer = result.answer
    if answer is None:
        return []
    scores, pairs = answer.scores, []
    if scores.rmse is not None:
        pairs.append(("RMSE against the truth, R G B", " ".join(f"{value:.4f}" for value in scores.rmse)))
    pairs.append(
        ("RMSRE of unseen patches, R G B", " ".join(f"{value:.2f}" for value in scores.rmsre_percent) + " %")
    )
    if answer.uncertainty is not None:
        pairs.append(("95 % band", band_in_words(answer.uncertainty)))
    pairs.append(("duality gap", f"{answer.proof.gap.max():.0e}"))
    return pairs
