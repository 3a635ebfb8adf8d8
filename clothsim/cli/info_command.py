"""`clothsim scenes`, `keys`, `fabrics` and `completion`: what comes with the package."""

import argparse
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import shtab

from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.base.text import text_table
from clothsim.cli import COMMANDS, parser_of_all
from clothsim.cli.arguments import add_output_options, add_overwrite, refuse_output
from clothsim.cli.report import DONE, Report

_SCENES = """\
List the example scenes. `clothsim run NAME` simulates one, unless a file has that name.

  clothsim scenes --json
  clothsim run sphere
"""
_KEYS = """\
List the sections of a scene file, or the keys of one with type, default, unit, range and meaning.

  clothsim keys solver
  clothsim keys effects.gravity
"""
_FABRICS = """\
List the named fabrics, show all values of one, or draw a drape of each.

  clothsim fabrics denim
  clothsim fabrics --swatches fabrics.png
"""
_COMPLETION = """\
Print a script that completes commands, options, their choices, names of scenes and fields, and files.

  clothsim completion bash > ~/.local/share/bash-completion/completions/clothsim
  clothsim completion zsh > ~/.zsh/_clothsim      # a folder of $fpath
  clothsim completion fish > ~/.config/fish/completions/clothsim.fish
"""


def add_to(commands: Any) -> None:
    """Add the commands to the parser."""
    scenes = commands.add_parser("scenes", description=_SCENES)
    add_output_options(scenes, json="as JSON: {name: {file, headline, missing}}", handler=_scenes)
    keys = commands.add_parser("keys", description=_KEYS)
    keys.add_argument(
        "section", nargs="?", metavar="SECTION", help="solver, cloth, gravity, rectangle, ... (default: all)"
    )
    keys.add_argument("--json-schema", action="store_true", help="print the JSON schema, for editors")
    keys.add_argument("--markdown", action="store_true", help="print the reference page")
    add_output_options(keys, json="as JSON: {section: {summary, keys}}", handler=_keys)
    fabrics = commands.add_parser("fabrics", description=_FABRICS)
    fabrics.add_argument("name", nargs="?", metavar="NAME", help="all values of this fabric, with their sources")
    fabrics.add_argument(
        "--swatches", type=Path, metavar="PNG", help="a picture of a Cusick drape of each (or of NAME)"
    )
    add_overwrite(fabrics)
    add_output_options(fabrics, json="as JSON in SI units: {name: {values, sources}}", handler=_fabrics)
    completion = commands.add_parser("completion", description=_COMPLETION)
    completion.add_argument("shell", choices=("bash", "zsh", "fish", "tcsh"), help="the shell")
    completion.add_argument("--debug", action="store_true", help="show tracebacks")
    completion.set_defaults(handler=_completion)


def _scenes(arguments: argparse.Namespace) -> Report:
    scenes = engine.example_scenes()
    fields, lines = ("file", "headline", "missing"), []
    width = max(len(each.name) for each in scenes)
    for each in scenes:
        needs = f" (needs {', '.join(name.rsplit('/', 1)[-1] for name in each.missing)})" if each.missing else ""
        lines.append(f"{each.name:<{width}}  {each.headline}{needs}")
    document = {each.name: {key: getattr(each, key) for key in fields} for each in scenes}
    return Report(document, "\n".join([*lines, f"\n{scenes[0].file.parent}"]))


def _keys(arguments: argparse.Namespace) -> Report | int:
    if arguments.section and (arguments.json_schema or arguments.markdown):
        raise InputError("--json-schema and --markdown print all sections.", "Leave the section out.")
    if arguments.json_schema:
        print(engine.reference_text("json"))
        return DONE
    if arguments.markdown:
        print(engine.reference_text("markdown"), end="")
        return DONE
    text = overview() if arguments.section is None else keys_of_section(arguments.section)
    return Report(engine.reference(arguments.section), text)


WIDTH = 100
"""Columns of the keys of a scene."""


def overview() -> str:
    """The sections with the number of their keys and their summary."""
    parts = [
        _wrapped(f"{name}  ({len(section['keys'])})", section["summary"])
        for name, section in engine.reference().items()
    ]
    return "\n".join(parts)


def keys_of_section(name: str) -> str:
    """The keys of a section, or of all whose name holds `name` as a word; "solver.dt" is one key."""
    parts = []
    for section, content in engine.reference(name).items():
        head = f"[{section}]" if "=" not in section else section
        rows = []
        for key, columns in content["keys"].items():
            unit = "" if columns["unit"] in ("", "-") else f" [{columns['unit']}]"
            facts = ", ".join(filter(None, [columns["type"], columns["range"]]))
            default = f" = {columns['default']}" if columns["default"] not in ("", "-") else ""
            rows.append(_wrapped(f"{key}{default}{unit}", f"{facts}. {columns['meaning']}"))
        summary = textwrap.fill(f"{head}: {content['summary']}", WIDTH)
        parts.append("\n".join([summary, "", *rows]) if rows else f"{summary}\nIt takes no keys.")
    return "\n\n".join(parts)


def _wrapped(head: str, text: str) -> str:
    """A head, and a text indented below it, in WIDTH columns."""
    lines = textwrap.wrap(head, WIDTH, subsequent_indent="      ", break_long_words=False)
    return "\n".join([*lines, textwrap.fill(text, WIDTH, initial_indent="    ", subsequent_indent="    ")])


_VALUES = {
    "density": ("kg/m2", 1.0),
    "thickness": ("mm", 1e3),
    "warp_stiffness": ("N/m", 1.0),
    "weft_stiffness": ("N/m", 1.0),
    "shear_stiffness": ("N/m", 1.0),
    "thread_poisson_ratio": ("", 1.0),
    "warp_extension": ("%", 1e2),
    "weft_extension": ("%", 1e2),
    "bending_warp": ("uN m", 1e6),
    "bending_weft": ("uN m", 1e6),
    "bending_bias": ("uN m", 1e6),
    "youngs_modulus": ("MPa", 1e-6),
    "poisson_ratio": ("", 1.0),
    "bending_stiffness": ("uN m", 1e6),
    "friction": ("", 1.0),
}
"""Rows of `clothsim fabrics NAME`: the scene's key, its unit, and the factor from SI."""


def _fabrics(arguments: argparse.Namespace) -> Report:
    name, file = arguments.name, arguments.swatches
    if name is not None:
        engine.fabric_named("NAME", name)
    if file is not None:
        if file.suffix.lower() != ".png":
            raise InputError(f"--swatches is {str(file)!r}.", "A picture ends in .png.")
        refuse_output(file, arguments)
        note = engine.draw_swatches([name] if name is not None else list(engine.FABRICS), file)
        return Report({"file": str(file), "note": note}, f"{file}. {note}")
    names = list(engine.FABRICS) if name is None else [name]
    document = {}
    for each in names:
        named = engine.FABRICS[each]
        document[each] = {
            "made_of": named.made_of,
            "values": {key: getattr(named.fabric, key) for key in _VALUES},  # in SI units, null where no source has one
            "sources": dict(named.sources),
            "compared": asdict(named.compared),
        }
    return Report(document, table(names) if name is None else sheet(name))


def table(names: Sequence[str]) -> str:
    """The fabrics in lines: weight, thickness, stiffness along warp and weft and in shear, bending, source."""
    header = (
        "fabric",
        "g/m2",
        "mm",
        "warp N/m",
        "weft N/m",
        "shear N/m",
        "bending uN m",
        "measured by",
        "% at 490 N/m",
        "estimated",
    )
    rows = []
    for named in (engine.FABRICS[name] for name in names):
        fabric = named.fabric
        numbers = (
            f"{1e3 * fabric.density:.0f}",
            f"{1e3 * fabric.thickness:.2f}",
            f"{fabric.stiffness_along_warp:,.0f}",
            f"{fabric.stiffness_along_weft:,.0f}",
            f"{fabric.stiffness_in_shear:,.0f}",
            f"{1e6 * fabric.bending_stiffness:.1f}",
        )
        extensions = f"{100 * fabric.extension_along_warp:.3g}, {100 * fabric.extension_along_weft:.3g}"
        estimated = dict.fromkeys("bending" if "bending" in key else key.split("_")[-1] for key in named.estimated)
        shown = ", ".join(estimated) if len(estimated) <= 3 else "all but bending"
        rows.append((fabric.name, *numbers, named.measured_by, extensions, shown))
    lines = text_table(header, rows)
    return f"{lines}\n\nThe extensions along warp and weft act with [effects.strain_limit]."


def sheet(name: str) -> str:
    """All values of a fabric, a line each, with the source of each."""
    named, rows = engine.FABRICS[name], []
    for key, (unit, factor) in _VALUES.items():
        value = getattr(named.fabric, key)
        if value is not None:
            rows.append((key, f"{factor * value:.4g}", unit, named.sources[key]))
    silent = [key for key in _VALUES if getattr(named.fabric, key) is None]
    lines = [f"{named.fabric.name}: {named.made_of}", text_table(("value", "", "unit", "source"), rows)]
    lines.append(f"{named.measured_by}: {named.fabric.source}.")
    if silent:
        lines.append(f"No source gives: {', '.join(silent)}.")
    beside = named.compared
    drape = f"Drapes to {beside.coefficient:.0f} % by `clothsim test {name} --size {beside.size:g}mm`"
    if beside.published:
        drape += " (published: {:g} to {:g} %)".format(*beside.published)
    lines.append(
        f"{drape}; {beside.stiffer_than} % of {beside.of} fabrics of like weight bend more easily (Feng 2022)."
    )
    return "\n\n".join(lines)


def _completion(arguments: argparse.Namespace) -> int:
    print(script(arguments.shell))
    return DONE


def script(shell: str) -> str:
    """The script for a shell: commands, options, choices, names of scenes, fabrics, fields and sections, files."""
    words = {
        "scene": [each.name for each in engine.example_scenes()],
        "fabric": list(engine.FABRICS),
        "field": [
            "plain",
            "stretch",
            *re.findall(r'"(\w+)"', engine.reference("run.fields")["run"]["keys"]["fields"]["type"]),
        ],
        "section": list(engine.reference()),
    }
    parser = parser_of_all()
    _complete_names(parser, {name: [each for each in known if " " not in each] for name, known in words.items()})
    functions = {"bash": _BASH, "zsh": _ZSH}.get(shell, "")
    preamble = "\n".join(functions.format(name=name, words=" ".join(words[name])) for name in words if functions)
    return str(shtab.complete(parser, shell, preamble=preamble))


_BASH = "_clothsim_{name}() {{ compgen -W '{words}' -- $1; _shtab_compgen_files $1; }}"
_ZSH = "_clothsim_{name}() {{ _alternative 'names:{name}:({words})' 'files:file:_files' }}"
NAMES = {
    "scene": "scene",
    "target": "scene",
    "fabric": "fabric",
    "name": "fabric",
    "field": "field",
    "section": "section",
}
"""What completes an argument, by its name in the parser."""


def _complete_names(parser: argparse.ArgumentParser, words: Mapping[str, Sequence[str]]) -> None:
    """Let names complete the arguments that take them, files those that take a path."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, each in action.choices.items():
                _complete_names(each, words)
                if name in COMMANDS:  # shtab leaves out commands without a help
                    action._choices_actions.append(action._ChoicesPseudoAction(name, (), COMMANDS[name].summary))
        elif action.nargs != 0 and action.dest in NAMES and action.option_strings != ["--target"]:
            kind = NAMES[action.dest]
            fish = f"{' '.join(words[kind])} {shtab.FILE['fish']}"
            own = {"bash": f"_clothsim_{kind}", "zsh": f"_clothsim_{kind}", "fish": fish}
            action.complete = {**shtab.FILE, **own}  # type: ignore[attr-defined]
        elif action.type is Path:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
