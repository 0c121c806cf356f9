"""Sentences of a Markdown page: of paragraphs, items of lists, cells of tables and headings, without code."""

from __future__ import annotations

import re

_BLOCK = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
_EQUATION = re.compile(r"^ {4,}(?![-*\d]).*$", re.MULTILINE)
_START = re.compile(r"^ *(?:[-*] |\d+\. |#+ |> )", re.MULTILINE)


def sentences(page: str) -> list[str]:
    """The sentences in their order; a colon and a semicolon end one, inline code is one word."""
    text = _EQUATION.sub("\n", _BLOCK.sub("\n", page))
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", re.sub(r"`[^`]*`", "code", text))
    text = _START.sub("\n", re.sub(r"^\|.*\|$", lambda row: row[0].replace("|", "\n\n"), text, flags=re.MULTILINE))
    blocks = (re.sub(r"\s+", " ", block).strip() for block in re.split(r"\n\s*\n", text))
    return [sentence for block in blocks for sentence in re.split(r"(?<=[.!?:;])[\"')*_]*\s", block) if sentence]


def words(sentence: str) -> int:
    """Number of words: what has a letter or a digit in it."""
    return sum(bool(re.search(r"\w", word)) for word in sentence.split())
