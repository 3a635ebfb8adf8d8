"""Generated parts of the site: the scene reference from the schema, TeX as MathML (no script from elsewhere)."""

import html
import re

from latex2mathml.converter import convert
from mkdocs.structure.files import File

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_files(files, config):
    """Add the pages that are generated from the package."""
    from clothsim.scene.reference import markdown

    files.append(File.generated(config, "reference/scene.md", content=markdown()))
    return files


def on_page_content(content, **_):
    """TeX formulas as MathML, which browsers draw by themselves."""
    return FORMULA.sub(
        lambda found: convert(html.unescape(found[3]), display="inline" if found[2] == "(" else "block"), content
    )
