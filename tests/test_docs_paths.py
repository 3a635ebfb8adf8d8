"""Paths, links and imports that the documentation and the comments name: each is there."""

import ast
import re
from importlib import import_module
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).parents[1]
DOCS = sorted((ROOT / "docs").rglob("*.md"))
OUTSIDE = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
NOTES = [page for page in DOCS if page.parent.name == "notes"]
"""History: names of tests and programs as they were."""
LIVING = [page for page in (*DOCS, *OUTSIDE) if page not in NOTES]
PLANNED = {"clothsim/physics/energies/trampoline.py"}
"""Files that a page has its reader write."""


def text_of(file):
    return file.read_text(encoding="utf-8")


def named_paths(text, tops):
    """Paths below one of some folders that a text names; placeholders, as NAME, end one."""
    return set(re.findall(rf"(?<![\w./~-])(?:{tops})/[a-z0-9_/.]*[a-z0-9_]", text))


@pytest.mark.parametrize(("pages", "tops"), [(LIVING, "clothsim|transfer|tests"), (NOTES, "clothsim|transfer")])
def test_paths_that_pages_name_are_there(pages, tops):
    named = {(page.name, path) for page in pages for path in named_paths(text_of(page), tops)}
    assert len(named) > 3
    assert {(page, path) for page, path in named if path not in PLANNED and not (ROOT / path).exists()} == set()


def test_relative_links_of_pages_lead_to_files():
    missing = {
        (page.name, link)
        for page in (*DOCS, *OUTSIDE, ROOT / "CHANGELOG.md")
        for link in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text_of(page))
        if "://" not in link and link != "../reference/scene.md" and not (page.parent / link).exists()
    }
    assert missing - {("index.md", "reference/scene.md")} == set()


def test_pages_that_sources_name_are_there():
    sources = [file for top in ("clothsim", "transfer", "tests") for file in (ROOT / top).rglob("*.py")]
    named = {(file.name, path) for file in sources for path in re.findall(r"docs/[\w/]+\.md", text_of(file))}
    assert len(named) > 20
    assert {(name, path) for name, path in named if not (ROOT / path).is_file()} == set()


def imports_of(page):
    """(module, names) of the imports of the package in the code of a page."""
    for block in re.findall(r"```python\n(.*?)```", text_of(page), re.DOTALL):
        for line in re.findall(r"^(?:from clothsim|from transfer)\S* import .*", block, re.MULTILINE):
            (statement,) = ast.parse(line).body
            yield statement.module, [alias.name for alias in statement.names]


@pytest.mark.parametrize("page", [page for page in DOCS if any(imports_of(page))], ids=lambda page: page.stem)
def test_imports_in_the_code_of_a_page_have_their_names(page):
    for module, names in imports_of(page):
        for name in names:
            assert hasattr(import_module(module), name), f"{module}.{name}"


def test_programs_that_pages_run_are_there():
    programs = {
        (page.name, program)
        for page in LIVING
        for program in re.findall(r"python -m ((?:tests|clothsim)[\w.]*\w)", text_of(page))
    }
    assert len(programs) > 10
    folders = {(page, program): ROOT / program.replace(".", "/") for page, program in programs}
    assert {
        key
        for key, folder in folders.items()
        if not folder.with_suffix(".py").is_file() and not (folder / "__main__.py").is_file()
    } == set()


STILL_PALETTISED = {
    "character_blender.png",
    "dress_fabrics.png",
    "dress_graded.png",
    "dress_sheet.png",
    "export_blender.png",
    "hard_cases.png",
    "viewer.png",
    *(f"gallery/{scene.stem}.png" for scene in (ROOT / "scenes").glob("*.toml")),
}
"""Older pictures with a palette; one that is drawn again leaves the list."""


def test_pictures_are_in_true_colour():
    pictures = ROOT / "docs/pictures"
    modes = {str(file.relative_to(pictures)): Image.open(file).mode for file in pictures.rglob("*.png")}
    assert len(modes) > 20
    assert {name for name, mode in modes.items() if mode == "P"} - STILL_PALETTISED == set()


def test_pictures_of_the_readme_are_small():
    shown = re.findall(r"\]\((docs/pictures/examples/[^)]+)\)", text_of(ROOT / "README.md"))
    assert len(shown) == 8
    assert max((ROOT / name).stat().st_size for name in shown) < 150_000
