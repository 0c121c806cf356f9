"""Sentences of the pages are short: one idea each, of paragraphs, items of lists, cells of tables and headings."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
SENTENCE_WORDS = 25
"""Greatest number of words of a sentence."""
_BLOCK = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
_EQUATION = re.compile(r"^ {4,}(?![-*\d]).*$", re.MULTILINE)
_START = re.compile(r"^ *(?:[-*] |\d+\. |#+ |> )", re.MULTILINE)


def sentences(page: str) -> list[str]:
    """The sentences in their order; a colon and a semicolon end one, inline code is one word."""
    text = _EQUATION.sub("\n", _BLOCK.sub("\n", page))
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", re.sub(r"`[^`]*`", "code", text))
    text = _START.sub("\n\n", re.sub(r"^\|.*\|$", lambda row: row[0].replace("|", "\n\n"), text, flags=re.MULTILINE))
    blocks = (re.sub(r"\s+", " ", block).strip() for block in re.split(r"\n\s*\n", text))
    return [sentence for block in blocks for sentence in re.split(r"(?<=[.!?:;])[\"')*_]*\s", block) if sentence]


def word_count(sentence: str) -> int:
    """Number of words: what has a letter or a digit in it."""
    return sum(bool(re.search(r"\w", word)) for word in sentence.split())


def test_lists_tables_and_headings_end_sentences() -> None:
    page = "# One\n\nTwo words, 0.5 m. Next: `a b c` (ends).\nStill\n\n- item\n- second\n\n| a | b c |\n\n    x = y\n"
    found = [sentence for sentence in sentences(page) if word_count(sentence)]
    assert found == ["One", "Two words, 0.5 m.", "Next:", "code (ends).", "Still", "item", "second", "a", "b c"]


@pytest.mark.parametrize("page", PAGES, ids=[page.relative_to(ROOT).as_posix() for page in PAGES])
def test_sentences_are_short(page: Path) -> None:
    assert [one for one in sentences(page.read_text("utf-8")) if word_count(one) > SENTENCE_WORDS] == []
