"""Arguments of the commands: parser, values, losses."""

import argparse
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import clothsim
from clothsim import engine, gradients, patterns
from clothsim.base.errors import InputError
from clothsim.base.file_writing import refuse_replacing
from clothsim.base.inputs import did_you_mean

if TYPE_CHECKING:
    from clothsim import Loss, Scene
    from clothsim.engine import World
    from clothsim.patterns import PatternMesh

VECTORS = ("--view", "--up", "--range")
LENGTHS = {"mm": 1e-3, "um": 1e-6, "cm": 1e-2, "in": 0.0254, "m": 1.0}
"""Units of a length [m], the longer names first."""
UNITS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}


class MissingError(InputError):
    """An argument that a command needs is not given."""


class Parser(argparse.ArgumentParser):
    """An ArgumentParser whose errors are InputErrors; `remedies` for options that it does not take."""

    def __init__(self, **keywords: object) -> None:
        settings = {"formatter_class": argparse.RawDescriptionHelpFormatter, "allow_abbrev": False, **keywords}
        super().__init__(**settings)  # type: ignore[arg-type]
        self.remedies: dict[str, str] = {}

    def error(self, message: str) -> NoReturn:
        """Raise InputError with argparse's message as a sentence."""
        kind = MissingError if "arguments are required" in message else InputError
        raise kind(f"{message[:1].upper()}{message[1:]}.", f"See `{self.prog} --help`.")

    def parsed(self, words: Sequence[str]) -> argparse.Namespace:
        """The values of a command line; InputError for a word that its command does not take."""
        try:
            values, unknown = self.parse_known_args(words)
        except MissingError:
            known = {option for action in self._of(words)._actions for option in action.option_strings}
            unknown = [word for word in words if re.match(r"--\w", word) and word.partition("=")[0] not in known]
            if not unknown:  # else the one that is missing may be meant
                raise
        if unknown:
            command = self._of(words)
            of_options = [word for word in unknown if re.match(r"-[^\d.]", word)]
            given = of_options[0] if of_options else ""
            name, _, value = given.partition("=")
            if given and not value and len(unknown) > len(of_options):  # its value may have been taken for a name
                value = next((word for word in words[words.index(given) + 1 :] if word not in of_options), "")
            actions = [action for action in command._actions if not isinstance(action, Renamed)]
            options = [option for action in actions for option in action.option_strings if option.startswith("--")]
            long = [option for option in options if name.startswith("--") and option.startswith(name)]
            hint = (
                f"Did you mean {long[0]!r}?"
                if long
                else did_you_mean(name, options, 0.7)
                if name.startswith("--")
                else ""
            )
            key = nearest_key(name.lstrip("-").replace("-", "_")) if name and "--set" in options and not hint else ""
            if key:
                hint = f"Write it as --set {key}={value or '...'}."
            where = f"`{command.prog}` does not take {' '.join(of_options or unknown)}."
            hint = command.remedies.get(name, hint)
            raise InputError(where, hint or f"`{command.prog} --help` lists what it takes.")
        return values

    def _of(self, words: Sequence[str]) -> "Parser":
        """The parser of the command in some words."""
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                named = next((k for k, word in enumerate(words) if word in action.choices), None)
                return self if named is None else action.choices[words[named]]._of(words[named + 1 :])
        return self


def nearest_key(name: str) -> str:
    """The path of the key of a scene that an option such as --dt means; empty where there is none.

    Examples
    --------
    >>> nearest_key("dt"), nearest_key("fabric"), nearest_key("gpu")
    ('solver.dt', 'cloth.fabric', '')
    """
    sections = {section: content["keys"] for section, content in engine.reference().items()}
    found = [
        section
        for section, keys in sections.items()
        if re.fullmatch(r"(effects\.)?\w+", section) and name in keys and "list of tables" not in keys[name]["type"]
    ]
    return f"{found[0]}.{name}" if found else ""


class Renamed(argparse.Action):
    """An earlier word of an option: it does the same, names the new one on stderr, and is not in the help."""

    def __init__(self, option_strings: list[str], dest: str, now: str, **keywords: Any) -> None:
        super().__init__(option_strings, dest, default=argparse.SUPPRESS, help=argparse.SUPPRESS, **keywords)
        self.now = now

    def __call__(
        self, parser: object, namespace: argparse.Namespace, values: object, option: str | None = None
    ) -> None:
        """Set the value."""
        print(f"{option} is now {self.now}.", file=sys.stderr)
        setattr(namespace, self.dest, self.const if self.nargs == 0 else values)


def add_output_options(
    command: argparse.ArgumentParser,
    json: str,
    quiet: str = "",
    handler: Callable[[argparse.Namespace], object] | None = None,
) -> None:
    """Add --json, --debug and, where its help is given, --quiet to a command, and the function that runs it."""
    if quiet:
        command.add_argument("--quiet", action="store_true", help=quiet)
    command.add_argument("--json", action="store_true", help=json)
    command.add_argument("--debug", action="store_true", help="show tracebacks")
    if handler is not None:
        command.set_defaults(handler=handler)


def add_set(command: argparse.ArgumentParser, help: str = "change a key of the scene") -> None:
    """Add --set, which `scene_of` reads, to a command."""
    command.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help=help)


def add_overwrite(command: argparse.ArgumentParser, help: str = "replace files that exist") -> None:
    """Add --overwrite, which `refuse_replacing` needs, to a command."""
    command.add_argument("--overwrite", action="store_true", help=help)


def refuse_output(file: Path, arguments: argparse.Namespace, *inputs: object) -> None:
    """InputError for an output file without a folder, that is one of the inputs, or is there without --overwrite."""
    if not file.resolve().parent.is_dir():
        raise InputError(f"There is no directory {file.parent}.", "Create it first, or choose another with -o.")
    refuse_replacing([file], arguments.overwrite, inputs)


def refuse_empty(words: Sequence[str]) -> None:
    """InputError for an empty word after an option: a variable of the shell that is not set."""
    for option, word in zip(words, words[1:], strict=False):
        if not word and option.startswith("-"):
            raise InputError(f"{option} is empty.", "Give it a value: a variable of the shell may not be set.")


def join_vectors(words: Sequence[str]) -> list[str]:
    """`--view -1,0,0` as `--view=-1,0,0`, as argparse would take the value for an option."""
    joined: list[str] = []
    for word in words:
        if joined and joined[-1] in VECTORS and re.match(r"-[\d.]", word):
            joined[-1] = f"{joined[-1]}={word}"
        else:
            joined.append(word)
    return joined


PRINT_RESOLUTION = 300.0
"""Dots per inch of a size in millimetres that names none."""


def as_printed_size(text: str) -> tuple[tuple[int, int], float]:
    """Width and height in pixels, and the dots per inch, of "85x64mm", "85x64mm@600" or "1280x960" (0 of pixels)."""
    match = re.fullmatch(r"(\d{1,5})[x,](\d{1,5})(?:(mm)(?:@(\d{2,4}))?)?", text.strip().lower())
    if not match:
        remedy = "Give WIDTHxHEIGHT in pixels, such as 1280x960, or in millimetres, such as 85x64mm or 85x64mm@600."
        raise InputError(f"--size is {text!r}.", remedy)
    width, height = int(match[1]), int(match[2])
    if match[3] is None:
        return (width, height), 0.0
    resolution = float(match[4] or PRINT_RESOLUTION)
    return (round(width * resolution / 25.4), round(height * resolution / 25.4)), resolution


def as_limits(option: str, text: str) -> tuple[float, float]:
    """Two numbers of "0.9,1.1"; whether they are a range is checked where it is used."""
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(f"{option} is {text!r}.", "Give two numbers, such as 0.9,1.1.") from error
    return low, high


def as_direction(
    option: str, text: str, remedy: str = "Give three numbers, such as 1,-2,0.5."
) -> tuple[float, ...] | str:
    """Three numbers of "1,0,2"; "x", "y", "z" and "auto" as they are."""
    if text in ("x", "y", "z", "auto"):
        return text
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(f"{option} is {text!r}.", remedy) from error
    return x, y, z


def as_positive_number(option: str, text: str, remedy: str = "Give a positive number.") -> float:
    """A positive finite number."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number < float("inf"):
        raise InputError(f"{option} is {text!r}.", remedy)
    return number


def as_scale(option: str, text: str | None) -> float | None:
    """Metres per unit of a file; None where there is no text."""
    remedy = "Give metres per unit of the file, such as 0.001 where it is in millimetres."
    return None if text is None else as_positive_number(option, text, remedy)


def as_count(option: str, text: str, least: int = 1) -> int:
    """A whole number from `least`."""
    if not re.fullmatch(r"\d{1,9}", text) or int(text) < least:
        raise InputError(f"{option} is {text!r}.", f"Give a whole number from {least}.")
    return int(text)


def as_seconds(option: str, text: str) -> float:
    """Seconds of "90", "90s", "1.5min" or "2h"."""
    match = re.fullmatch(r"(\d{1,9}(?:\.\d{1,9})?)\s*(s|min|h|)", text.strip())
    if not match or float(match[1]) == 0:
        raise InputError(f"{option} is {text!r}.", "Give a time, such as 90s, 10min or 1h.")
    return float(match[1]) * UNITS[match[2]]


def as_range(option: str, text: str) -> tuple[int, int]:
    """Two whole numbers of "0:15656"."""
    match = re.fullmatch(r"(\d{1,9}):(\d{1,9})", text)
    if not match:
        raise InputError(f"{option} is {text!r}.", "Give the first vertex and the one after the last, such as 0:15656.")
    return int(match[1]), int(match[2])


def as_length(name: str, text: str, example: str = "1mm") -> float:
    """A positive length with its unit [m]: "1mm", "0.5 mm", "2cm", "38in", "1e-3" (m); example: for the remedy.

    Examples
    --------
    >>> as_length("--error", "1mm"), as_length("--error", "2e-3")
    (0.001, 0.002)
    """
    unit = next((unit for unit in LENGTHS if text.strip().lower().endswith(unit)), "")
    number = text.strip().lower().removesuffix(unit).strip()
    try:
        return float(f"{as_positive_number(name, number) * LENGTHS.get(unit, 1.0):.12g}")
    except InputError as error:
        raise InputError(f"{name} {text!r} is not a positive length.", f"Write it as {name} {example}.") from error


def as_frame(text: str) -> int:
    """The number of a frame; -1 for "last"."""
    if text == "last":
        return -1
    if not re.fullmatch(r"-?\d{1,9}", text):
        raise InputError(f"--frame is {text!r}.", "Give the number of a frame, or last.")
    return int(text)


LOSSES = {
    "height": "mean height of the cloth [m]",
    "hem": "mean height of the side of its border that hangs lowest [m]",
    "silhouette": "area of its shadow on the ground [m2]",
    "girth=HEIGHT": "length of its cut with the plane z = HEIGHT [m]",
    "target=FILE": "mean squared distance to a drape: a mesh, points (.xyz) or a run [m2]",
}
"""Losses by the form in which they are given."""

_VALUES: dict[str, Callable[[str], float | Path] | None] = {
    "height": None,
    "hem": None,
    "silhouette": None,
    "girth": float,
    "target": Path,
}
"""What stands behind the "=" of each."""


def loss_of(text: str, world: "World", option: str = "--loss") -> "Loss":
    """Return the loss that a text such as "girth=0.8" names. InputError, with the option's name, for another text."""
    name, _, value = (part.strip() for part in text.partition("="))
    if name not in _VALUES or bool(value) != (_VALUES[name] is not None):
        raise InputError(f"{option} {text!r} is not a loss.", f"Give {', '.join(LOSSES)}.")
    kind = _VALUES[name]
    if kind is Path and not Path(value).exists():
        raise InputError(f"{option} {text}: there is no file {value}.", "Name a mesh, points (.xyz) or a run.")
    try:
        return gradients.named_loss(name, world, None if kind is None else kind(value))
    except ValueError as error:
        raise InputError(f"{option} {text}: {value!r} is not a height.", "Write it as girth=0.8, in metres.") from error


def words(option: str, text: str, example: str = "youngs_modulus,bending_stiffness") -> list[str]:
    """Return the names of a list such as "youngs_modulus,bending_stiffness". InputError where there is none."""
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise InputError(f"{option} names nothing.", f"Give some, such as {option} {example}.")
    return names


MOST_HALVINGS = 4
"""Divisions of the mesh of a dressed garment that are tried: of 2 mm where it was sewn at 32 mm."""


def meshed(file: Path, size: str, scene: "Scene") -> "PatternMesh":
    """Return the mesh of a pattern file with a size such as "2cm", divided as often as the dressed cloth of a scene."""
    pattern, spacing = patterns.read_specification(file), as_length("--size", size, "2cm")
    counts = [len(keys.mesh.triangles) for keys in scene.cloths if hasattr(keys.mesh, "triangles")]
    whole = mesh = patterns.mesh_pattern(pattern, spacing)
    for halvings in range(1, MOST_HALVINGS + 1):
        if len(mesh.triangles) in counts:
            return mesh
        try:
            mesh = patterns.mesh_pattern(pattern, spacing, halvings)
        except InputError:  # no panel is as large
            break
        for _ in range(halvings):
            mesh, _parents = mesh.halved()
    return mesh if len(mesh.triangles) in counts else whole


def scene_of(arguments: argparse.Namespace, or_run: bool = False) -> "Scene":
    """Return the scene of a file or of an installed name with the keys of --set; or_run: of a run's directory too."""
    path = arguments.scene
    scene = clothsim.open_run(path).scene if or_run and path.is_dir() else clothsim.load_scene(path)
    return engine.override(scene, *arguments.set)


def assigned_number(text: str) -> tuple[str, float]:
    """Key and number of "bending_stiffness=1e-5"; the scene checks both."""
    key, _, value = text.partition("=")
    try:
        return key.strip().removeprefix("cloth."), float(value)
    except ValueError as error:
        raise InputError(f"--set is {text!r}.", "Write it as --set bending_stiffness=1e-5.") from error
