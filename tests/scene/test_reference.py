"""Reference page: every accepted key is documented, and every documented key is accepted."""

import inspect
import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from clothsim import InputError, Scene
from clothsim.cli import main
from clothsim.keys.fabric import Fabric
from clothsim.keys.generator_keys import GENERATOR_KEYS
from clothsim.keys.mesh_keys import ClothTable
from clothsim.keys.schema import choices, keys_of, type_in_words
from clothsim.keys.settings import Solver
from clothsim.keys.typed_effects import TYPED_EFFECTS
from clothsim.mesh.generators.table import GENERATORS
from clothsim.scene.effects import EFFECTS, Effect
from clothsim.scene.reference import COLUMNS, json_schema, markdown, row, sections
from clothsim.solve.linear.linear_solvers import SOLVERS

UNITS = {
    "-", "1", "m", "s", "s, m", "m/s", "m/s2", "1/s", "1/m", "kg/m2", "kg/m3", "Pa", "N/m", "N s/m", "1, N/m",
    "N", "N m", "N m2", "N m/m", "degrees", "degrees/s", "m2/s",
}  # fmt: skip
KEYS = [
    pytest.param(section.name, key, id=f"{section.name}.{key.name}")
    for section in sections().values()
    for key in section.keys.values()
]


OURS = [
    param
    for param in KEYS
    if (name := re.match(r"effects\.(\w+)", param.values[0])) is None or name[1] in TYPED_EFFECTS
]
"""Without the keys of effects of a user's own, which need no docstring."""


@pytest.mark.parametrize(("section", "key"), OURS)
def test_a_key_has_type_default_unit_and_meaning(section, key):
    assert key.key.unit in UNITS
    assert len(key.key.meaning.split()) >= 1
    assert key.key.meaning[0].isupper()
    assert not key.key.meaning.endswith(".")
    name, kind, default, *_ = row(key)
    assert name
    assert kind
    assert default


@pytest.mark.parametrize("name", GENERATORS)
def test_a_generator_takes_its_keys(name):
    parameters = inspect.signature(GENERATORS[name]).parameters.values()
    assert [parameter.annotation for parameter in parameters] == [GENERATOR_KEYS[name]]
    assert set(GENERATORS) == set(GENERATOR_KEYS)


def test_the_keys_of_a_fabric_are_those_of_the_class():
    reported = {"name", "source", "friction"}
    assert set(inspect.signature(Fabric).parameters) - reported <= set(keys_of(ClothTable))


@pytest.mark.parametrize("name", EFFECTS)
def test_the_keys_of_an_effect_are_its_builders(name):
    assert set(sections()[f"effects.{name}"].keys) == set(EFFECTS[name].keys())


def accepted(scene):
    """True where the names of its keys are known, whatever their values."""
    try:
        Scene(**scene)
    except InputError as error:
        return "has no key" not in str(error)
    return True


@pytest.mark.parametrize(("section", "key"), KEYS)
def test_what_is_documented_is_accepted(section, key):
    cloth, value = {"mesh": "rectangle"}, key.default if key.default is not inspect.Parameter.empty else 0
    if "=" in section and section.startswith("mesh"):
        scene = {"cloth": {"mesh": section.split('"')[1], key.name: value}}
    elif section in ("cloth", "cloth or body of a file"):
        scene = {"cloth": {"mesh": "sheet.obj"} | {key.name: value}}
    elif section == "cloth of a sewing pattern":
        scene = {"cloth": {"mesh": "x_specification.json"} | {key.name: value}}
    elif section.startswith("body"):
        table = {"frames": "a*.obj"} if section == "body, animated" else {"mesh": "sphere"}
        table = {"model": "mannequin"} if section.endswith("of a model") else table
        table |= {"motion": {key.name: value}} if section.startswith("body.motion") else {key.name: value}
        scene = {"cloth": cloth, "body": table}
    elif section.startswith("rigid."):
        nested = section.removeprefix("rigid.")
        keys = {key.name: value}
        scene = {"cloth": cloth, "rigid": {"mesh": "sphere", nested: keys if nested == "joint" else [keys]}}
    elif section.startswith("effects."):
        _, name, *nested = re.split(r"[.,]", section)
        keys = {key.name: value}
        if nested:
            keys = {
                nested[0]: keys if nested[0] in ("wind", "pattern") else [keys if len(nested) == 1 else {"from": keys}]
            }
        scene = {"cloth": cloth, "effects": {name: keys}}
    else:
        scene = {"cloth": cloth, section: {key.name: value}}
    assert accepted(scene)


def test_each_table_that_a_key_takes_has_a_section():
    described = {section.summary for section in sections().values()}
    tables = {table for section in sections().values() for key in section.keys.values() for table in key.key.tables}
    assert len(tables) > 10
    assert {inspect.cleandoc(table.__doc__).splitlines()[0] for table in tables} <= described


def test_the_page_has_a_row_for_each_key():
    page = markdown()
    assert sum(line.startswith("| `") for line in page.splitlines()) == len(KEYS)
    for section in sections().values():
        for name in section.keys:
            assert f"| `{name}` |" in page
    tables = [line for line in page.splitlines() if line.startswith("|")]
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in tables} == {len(COLUMNS) + 1}


def test_an_effect_of_a_users_own_is_documented_by_its_docstring(monkeypatch, tmp_path):
    (tmp_path / "trampoline_of_mine.py").write_text(
        "def build(world, *, strength: float = 1.0, level: float = 0.0, bare=3):\n"
        '    """Vertices drawn to a level.\n\n    Parameters\n    ----------\n    strength : float [1/s2]\n'
        '        Stiffness for each mass.\n    level : float [m]\n        Height of the bed.\n    """\n'
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(EFFECTS, "trampoline", Effect("trampoline_of_mine:build", "drawn to a level"))
    section = sections()["effects.trampoline"]
    assert row(section.keys["bare"]) == ("bare", "any", "3", "-", "", "")
    assert row(section.keys["strength"]) == ("strength", "number", "1", "1/s2", "", "Stiffness for each mass.")
    assert section.keys["level"].key.unit == "m"
    assert json_schema()["properties"]["effects"]["properties"]["trampoline"]["properties"]["level"]


KINDS = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float)}


def fits(value, schema):  # noqa: PLR0911
    """A check of those parts of JSON schema that ours uses."""
    if "anyOf" in schema:
        rest = {key: part for key, part in schema.items() if key != "anyOf"}
        return any(fits(value, one) for one in schema["anyOf"]) and (not rest or fits(value, rest))
    if set(schema) == {"required"}:
        return set(schema["required"]) <= set(value)
    kind = schema.get("type")
    if kind is None:
        return value in schema.get("enum", [value])
    if not isinstance(value, KINDS[kind]) or (isinstance(value, bool) and kind != "boolean"):
        return False
    if kind == "object" and "properties" in schema:
        inner = schema["properties"]
        known = set(value) <= set(inner) and set(schema.get("required", ())) <= set(value)
        return known and all(fits(one, inner[key]) for key, one in value.items())
    if kind == "array":
        size = schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", np.inf)
        return size and all(fits(entry, schema.get("items", {})) for entry in value)
    if kind not in ("integer", "number"):
        return True
    least, above = schema.get("minimum", -np.inf), schema.get("exclusiveMinimum", -np.inf)
    return above < value <= schema.get("maximum", np.inf) and value >= least


class TestJsonSchema:
    @pytest.mark.parametrize(
        "path", sorted((Path(__file__).parents[2] / "scenes").glob("*.toml")), ids=lambda path: path.stem
    )
    def test_the_scenes_fit_it(self, path):
        scene, schema = tomllib.loads(path.read_text()), json_schema()
        for name, section in scene.items():
            assert fits(section, schema["properties"][name]), name
        assert fits(scene, schema)

    @pytest.mark.parametrize(
        "scene",
        [
            {},
            {"cloth": {}},
            {"cloth": {"mesh": "rectangle", "cels": [2, 2]}},
            {"cloth": {"mesh": "rectangle"}, "solver": {"dt": 0}},
            {"cloth": {"mesh": "rectangle"}, "solver": {"integrator": "euler"}},
            {"cloth": {"mesh": "rectangle"}, "effects": {"gravity": {"acceleration": 9.81}}},
            {"cloth": {"mesh": "rectangle"}, "effects": {"springs": {"spring": [{"select": "left"}]}}},
        ],
    )
    def test_what_is_wrong_does_not(self, scene):
        assert not fits(scene, json_schema())


class TestCommand:
    def test_it_lists_all_sections(self, capsys):
        assert main(["keys"]) == 0
        lines = capsys.readouterr().out.splitlines()
        heads = [line for line in lines if not line.startswith(" ")]
        assert [head.rpartition("  (")[0] for head in heads] == list(sections())

    @pytest.mark.parametrize(
        ("name", "shown"),
        [("solver", "tolerance"), ("effects.gravity", "m/s2"), ("gravity", "m/s2"), ("rectangle", "diagonals"),
         ("solver.dt", "0.01"), ("dt", "0.01"), ("gravity.acceleration", "-9.81"), ("inertia", "no keys")],
    )  # fmt: skip
    def test_it_prints_a_section_or_a_key(self, capsys, name, shown):
        assert main(["keys", name]) == 0
        assert shown in capsys.readouterr().out

    @pytest.mark.parametrize(
        ("name", "right"),
        [("gravty", "'gravity'"), ("effects.gravty", "'effects.gravity'"), ("solvr", "'solver'"),
         ("effects.air.wnd", "'effects.air.wind"), ("solver.tolerence", "'solver.tolerance'"),
         ("tolerence", "[solver]"), ("rectangel", "'rectangle'"),
         ("nonsense", "clothsim keys"), ("", "clothsim keys"), ("....", "clothsim keys")],
    )  # fmt: skip
    def test_an_unknown_name_is_answered_with_the_nearest_section_or_key(self, capsys, name, right):
        assert main(["keys", name]) == 2
        sentence, remedy = capsys.readouterr().err.splitlines()
        assert repr(name) in sentence
        assert right in remedy

    @pytest.mark.parametrize("name", ["nonsense", "qwertz", "x"])
    def test_a_name_near_none_is_taken_for_none(self, capsys, name):
        assert main(["keys", name]) == 2
        remedy = capsys.readouterr().err.splitlines()[1]
        others = set(sections()) | {word for section in sections() for word in section.split(".")}
        assert not others & set(remedy.replace("'", " ").replace("?", " ").split()) - {"sections"}

    def test_it_prints_schema_and_page(self, capsys):
        assert main(["keys", "--json-schema"]) == 0
        assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(json_schema()))
        assert main(["keys", "--markdown"]) == 0
        assert capsys.readouterr().out == markdown()
        assert main(["keys", "solver", "--markdown"]) == 2


def test_the_linear_solvers_are_those_of_the_table():
    assert choices(keys_of(Solver)["linear"].annotation) == ("auto", *SOLVERS)


def test_types_are_words():
    words = {type_in_words(key.annotation, key.key) for section in sections().values() for key in section.keys.values()}
    assert "number" in words
    assert all("typing" not in word and "<" not in word for word in words)
