"""Pages: links, files, keys, columns, code and sentences."""

import ast
import re
import shlex
import shutil
import sys
import tomllib
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path
from pkgutil import resolve_name

import pytest
from checks import compiled_only, in_ci

from stseg.commands.main import COMMANDS, _app
from stseg.config import Config
from stseg.config.keys import values
from stseg.io.calibrations.formats import FORMATS as CALIBRATIONS
from stseg.io.exports.formats import FORMATS as EXPORTS
from stseg.io.recording.recording import SOURCE_KINDS
from stseg.io.recording.rigs import parse_rig
from stseg.io.runfile import layout
from stseg.io.runfile.reading.run_reader import Run
from stseg.trackers import TRACKERS

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "tools"))

import configuration_page  # noqa: E402

DOCS = ROOT / "docs"
LONG = DOCS / "python.md"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
DEVELOPMENT = DOCS / "development"
DEVELOPMENT_WORDS = 7_000
"""Greatest number of words of all pages for developers."""
README, INPUTS, OUTPUTS = (
    (ROOT / page).read_text("utf-8") for page in ("README.md", "docs/inputs.md", "docs/outputs.md")
)
EQUATIONS = {"KS09": 8, "HW12": 28, "KD06": 7, "DP06": 12}
"""Number of equations of each paper."""
NAMES = [page.relative_to(ROOT).as_posix() for page in PAGES]
KEYS = dict(values(Config()))
SECTIONS = {key.partition(".")[0] for key in KEYS}


def heading_ids(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    titles = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_links_lead_somewhere(page: Path) -> None:
    for link in re.findall(r"\]\((?!https?:)([^)]+)\)", page.read_text("utf-8")):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        assert not anchor or anchor in heading_ids(target), link


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_files_commands_and_keys_named_exist_and_no_commit(page: Path) -> None:
    text = page.read_text("utf-8")
    assert set(re.findall(r"(?:`|^)stseg (\w+)\b", text, re.MULTILINE)) <= {*COMMANDS, "COMMAND"}
    for path in re.findall(r"\b(?:stseg|io|tools|tests|docs)/[\w./*-]*\w\.(?:py|md|json|toml)\b", text):
        assert any(ROOT.glob(path)) or path in _EXAMPLES, path
    named = re.findall(rf"`((?:{'|'.join(SECTIONS)})\.[a-z_.]*[a-z_])", text) + re.findall(r"--set ([\w.]+)=", text)
    for key in named:
        assert key in KEYS or any(known.startswith(f"{key}.") for known in KEYS), key
    assert not re.findall(r"\b(?=[0-9a-f]*[a-f])(?=[0-9a-f]*[0-9])[0-9a-f]{7,40}\b", text)


def test_what_pages_say_of_a_run_file_in_python_exists() -> None:
    named = {name for page in PAGES for name in re.findall(r"\brun\.([a-z_]{4,})", page.read_text("utf-8"))}
    known = {*dir(Run), *(field.name for field in fields(Run))}
    assert len(named) > 10 and named - {"html"} <= known


_EXAMPLES = {"stseg/foreground/median.py", "stseg/trackers/nearest.py", "io/exports/NAME.py", "io/calibrations/NAME.py"}
"""Files that the page on contributing invents."""


def test_rooms_are_drawn_and_pages_for_developers_short() -> None:
    page = (DOCS / "development" / "architecture.md").read_text("utf-8")
    rooms = {folder.name for folder in (ROOT / "stseg").iterdir() if any(folder.glob("*.py"))}
    assert {*rooms, "io"} <= set(re.findall(r"\w+", page.partition("```text")[2].partition("```")[0]))
    words = [word for page in DEVELOPMENT.glob("*.md") for word in page.read_text("utf-8").split()]
    assert sum(bool(re.search(r"\w", word)) for word in words) <= DEVELOPMENT_WORDS


def test_the_readme_leads_to_every_page_and_ci_runs_its_tests() -> None:
    reached, waiting = set[Path](), [ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        if page not in reached:
            reached.add(page)
            links = re.findall(r"\]\((?!https?:)([^)#]+\.md)", page.read_text("utf-8"))
            waiting += [(page.parent / link).resolve() for link in links]
    assert set(PAGES) <= reached
    (command,) = re.findall(r"^python3 -m venv .* (-m pytest .*)$", README, re.MULTILINE)
    assert f'"$bin/python" {command} -m' in (ROOT / ".ci" / "run").read_text("utf-8")


ARCHITECTURE = (DEVELOPMENT / "architecture.md").read_text("utf-8")
_EQUATIONS = re.findall(r"^\| (\w+) \| ([^|]+) \| [^|]+ \| ([^|]+) \|$", ARCHITECTURE, re.MULTILINE)


@pytest.mark.parametrize(("paper", "equation", "where"), [row for row in _EQUATIONS if row[0] in EQUATIONS])
def test_the_function_of_an_equation_exists(paper: str, equation: str, where: str) -> None:
    names = re.findall(r"`([\w.]+)`", where)
    assert names or where.startswith("not used"), (paper, equation)
    assert all(resolve_name(name) is not None for name in names)


@pytest.mark.parametrize("paper", EQUATIONS)
def test_every_equation_of_a_paper_has_a_row(paper: str) -> None:
    listed = set[int]()
    for equation in (equation for name, equation, _ in _EQUATIONS if name == paper and equation[0].isdigit()):
        for part in equation.split(", "):
            first, _, last = part.partition(" to ")
            listed |= set(range(int(first), int(last or first) + 1))
    assert listed == set(range(1, EQUATIONS[paper] + 1))


def test_keys_are_those_of_the_configuration_and_a_rig_is_shown() -> None:
    page = configuration_page.PAGE.read_text("utf-8")
    assert page == configuration_page.rewritten(page), "python tools/configuration_page.py writes it anew"
    assert all(f"| `{name}` |" in page for name in TRACKERS)
    (text,) = re.findall(r"```toml\n(format.*?)```", INPUTS, re.DOTALL)
    recording = parse_rig(text, ROOT / "room.toml")
    assert [camera.name for camera in recording.rig.cameras] == ["cam1", "cam2"]
    assert {source.source.kind for source in recording.sources} <= set(SOURCE_KINDS)
    assert all(f"| `{kind}` |" in INPUTS for kind in SOURCE_KINDS)
    assert {"x", "y", "polygon", "frame_rate"} <= set(tomllib.loads(text)["scene"])


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_cameras_shown_are_as_rig_files_have_them(page: Path) -> None:
    whole = re.findall(r"```toml\n(format.*?)```", INPUTS, re.DOTALL)[0]
    head, camera = whole.partition("[[camera]]")[0], whole.rpartition("[[camera]]")[2]
    for block in re.findall(r"```toml\n(source.*?)```", page.read_text("utf-8"), re.DOTALL):
        text = f"{head}[[camera]]{camera.partition('source =')[0]}{block}"
        (source,) = parse_rig(text, ROOT / "room.toml").sources
        assert source.source.kind in SOURCE_KINDS


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_keys_of_the_rig_file_named_exist(page: Path) -> None:
    readers = "".join(path.read_text("utf-8") for path in (ROOT / "io" / "recording").rglob("*.py"))
    known = {*re.findall(r'"(\w+)"', readers), *(key.rpartition(".")[2] for key in KEYS)}
    assert set(re.findall(r"`(\w+) = ", page.read_text("utf-8"))) <= known


def test_arrays_columns_and_formats_are_described() -> None:
    for field in layout.FIELDS:
        assert re.search(rf"^ +.*\b{field.name}\b", OUTPUTS, re.MULTILINE)
    for name, dtype in layout.table_types(1).items():
        (row,) = re.findall(rf"^\| `/{name}`.*$", OUTPUTS, re.MULTILINE)
        assert set(dtype.names or ()) <= set(re.findall(r"\w+", row.partition("|")[2]))
    assert all(f"| `{name}` |" in OUTPUTS for name in EXPORTS)
    rigs = (DOCS / "rigs.md").read_text("utf-8")
    assert all(f"`{name}`" in rigs for name in CALIBRATIONS)


_CODE = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def blocks(page: Path, language: str) -> list[str]:
    return [text for name, text in _CODE.findall(page.read_text("utf-8")) if name == language]


def lacking(code: str) -> set[str]:
    """Libraries that a block imports and that are not installed."""
    nodes = list(ast.walk(ast.parse(code)))
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    return {name for name in {name.partition(".")[0] for name in names} if find_spec(name) is None}


def commands(page: Path) -> list[list[str]]:
    """The calls of stseg in a page's shell blocks, without those that stand for others."""
    found = []
    for block in blocks(page, "sh"):
        for line in block.replace("\\\n", " ").splitlines():
            tokens = shlex.split(line, comments=True)
            if tokens[:1] == ["stseg"] and not {"...", "COMMAND", "FORMAT"} & set(tokens):
                end = next((k for k, token in enumerate(tokens) if token in ("|", "&&", "&", ";", ">")), len(tokens))
                found.append(tokens[1:end])
    return found


@pytest.fixture(scope="module")
def folder(rig_path: Path, undisturbed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording and its run under the names that pages give them."""
    place = tmp_path_factory.mktemp("docs")
    shutil.copytree(rig_path.parent, place, dirs_exist_ok=True)
    shutil.copy(undisturbed, place)
    (place / "RUN.h5").symlink_to(place / "run.h5")
    return place


@compiled_only
@pytest.mark.parametrize(
    "page", [*(p for p in PAGES if blocks(p, "python") and p != LONG), *in_ci(LONG)], ids=lambda page: page.name
)
def test_python_blocks_run(page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names: dict[str, object] = {}
    for number, code in enumerate(blocks(page, "python")):
        if not lacking(code):
            exec(compile(code, f"{page.name}, block {number}", "exec"), names)


@pytest.mark.parametrize("page", [p for p in PAGES if commands(p)], ids=lambda page: page.name)
def test_commands_parse(page: Path) -> None:
    for tokens in commands(page):
        _app(tokens).parse_args(tokens, exit_on_error=False, print_error=False)


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


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CHANGELOG.md"], ids=[*NAMES, "CHANGELOG.md"])
def test_sentences_are_short(page: Path) -> None:
    assert [one for one in sentences(page.read_text("utf-8")) if word_count(one) > SENTENCE_WORDS] == []
