"""The Python of the page docs/python.md works as printed."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python.md"
SNIPPETS = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def test_the_page_has_snippets():
    assert len(SNIPPETS) >= 2


@pytest.mark.parametrize("snippet", SNIPPETS)
def test_a_snippet_works_as_printed(snippet, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "svg")
    exec(snippet, {})
