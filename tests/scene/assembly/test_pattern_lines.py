"""Names of a sewing pattern in a scene: pins and seams by panel, edge and label, and open seams as strings."""

import json
from dataclasses import replace

import numpy as np
import pytest
from sewing_patterns import SQUARE, panel, skirt, specification, stitch

import clothsim
from clothsim import InputError, load_scene
from clothsim.mesh.cloth import PatternLines
from clothsim.physics.energies.key_values import selected_vertices
from clothsim.scene.assembly.scene_world import build


def scene_of(tmp_path, entries, effects=(), **keys):
    """The scene of a pattern with lines of TOML for its effects."""
    (tmp_path / "x_specification.json").write_text(json.dumps(entries), encoding="utf-8")
    table = {"mesh": "x_specification.json", "size": 0.05, "up": "y", **keys}
    lines = ["[cloth]", *(f"{key} = {json.dumps(value)}" for key, value in table.items()), "[effects.membrane]"]
    (tmp_path / "scene.toml").write_text("\n".join([*lines, "[effects.inertia]", *effects, ""]), encoding="utf-8")
    return load_scene(tmp_path / "scene.toml")


def labelled():
    """Two panels side by side that touch, the top of the left one labelled; the third is apart."""
    panels = {"left": panel(), "right": panel(SQUARE, translation=[10, 0, 0]), "pocket": panel(translation=[0, 0, 9])}
    panels["left"]["edges"][2]["label"] = "waist"
    sewn_edges = [stitch(("left", 1), ("right", 3)), stitch(("left", 0), ("pocket", 0), "right_wrong")]
    return specification(panels, sewn_edges)


def test_vertices_of_panel_edge_and_label(tmp_path):
    world = build(scene_of(tmp_path, labelled())).world
    cloth = world.cloths[0]
    at = cloth.positions + world.origin

    def of(**select):
        return at[selected_vertices("pins", world, select)]

    whole = of(panel="left")
    assert np.ptp(whole, axis=0) == pytest.approx([0.1, 0.0, 0.2], abs=1e-12)
    top = of(panel="left", edge=2)
    assert np.allclose(top[:, 2], 0.2)
    assert np.allclose(top[:, 0], [0.1, 0.05, 0.0])  # from its start to its end
    assert np.allclose(np.sort(of(label="waist")[:, 0]), [0.0, 0.05, 0.1])
    shared = [
        set(selected_vertices("pins", world, {"panel": name, "edge": k})) for name, k in (("left", 1), ("right", 3))
    ]
    assert shared[0] == shared[1]
    assert len(shared[0]) == 5


def test_pins_hold_an_edge(tmp_path):
    effects = ["[effects.gravity]", "[effects.pins]", 'select = { panel = "left", edge = 2 }']
    made = build(scene_of(tmp_path, labelled(), effects))
    assert len(made.constraints["pins"].at(0.0).vertices) == 3


@pytest.mark.parametrize(
    "select",
    [
        {"panel": "sleeve"},
        {"panel": "left", "edge": 9},
        {"panel": "left", "edge": 1.0},
        {"panel": "left", "edge": True},
        {"edge": 2},
        {"label": "hem"},
        {"label": ["waist"]},
        {"panel": "left", "label": "waist"},
    ],
)
def test_names_that_no_cloth_has(tmp_path, select):
    world = build(scene_of(tmp_path, labelled())).world
    with pytest.raises(InputError):
        selected_vertices("pins", world, select)


def test_open_seams_become_strings(tmp_path):
    effects = ["[effects.seams]", "pattern = { end = 0.5, stiffness = 20.0 }"]
    made = build(scene_of(tmp_path, labelled(), effects))
    seams = made.energies["seams"]
    assert [seam.name for seam in seams.seams] == ["pattern.cloth.left.0 to pocket.0"]  # the other one is welded
    assert (seams.seams[0].start, seams.seams[0].end, seams.seams[0].stitches) == (0.0, 0.5, 3)
    gaps = seams.lines(made.world.start())
    assert np.allclose(np.abs(gaps), [0, 0.09, 0], atol=1e-9)
    assert np.array_equal(np.unique(seams.stiffness), [20.0])


def test_a_seam_between_edges_by_name(tmp_path):
    lines = ["[[effects.seams.seam]]", 'from = { panel = "left", edge = 0 }', 'to = { panel = "pocket", edge = 0 }']
    by_name = build(scene_of(tmp_path, labelled(), lines)).energies["seams"]
    of_pattern = build(scene_of(tmp_path, labelled(), ["[effects.seams]", "pattern = {}"])).energies["seams"]
    x = build(scene_of(tmp_path, labelled())).world.start()
    assert np.allclose(by_name.lines(x), of_pattern.lines(x))
    assert by_name.value(x) == pytest.approx(of_pattern.value(x))


def test_two_panels_close_in_a_run(tmp_path):
    effects = ["[effects.damping]", "rate = 5.0", "[effects.seams]", "pattern = { end = 0.4 }"]
    scene = replace(scene_of(tmp_path, skirt(), effects), solver={"dt": 0.04}, run={"duration": 0.6})
    run = clothsim.simulate(scene)
    assert run.status == "completed"
    (pairs, others) = build(scene).world.cloths[0].lines.open_seams.values()
    joined = np.concatenate([pairs, others])
    gaps = [np.linalg.norm(np.diff(run.positions(k)[joined], axis=1)[:, 0], axis=1) for k in (0, -1)]
    assert gaps[0].min() > 0.19
    assert gaps[1].max() < 0.01


def pleats(angle=120.0):
    """Five strips in a zigzag that touch: panels turned about y to either side in turn, outer edges "mountain"."""
    width, panels, sewn_edges, at = 4.0, {}, [], np.zeros(2)
    corners = [[0, 0], [width, 0], [width, 8], [0, 8]]
    for k in range(5):
        turn = (angle / 2) * (1 if k % 2 else -1)
        made = panel(corners, translation=[at[0], 0, at[1]], rotation=[0, turn, 0])
        if k:
            made["edges"][3]["label"] = "mountain" if k % 2 else "valley"
            sewn_edges.append(stitch((f"s{k - 1}", 1), (f"s{k}", 3)))
        panels[f"s{k}"] = made
        at = at + width * np.array([np.cos(np.radians(turn)), -np.sin(np.radians(turn))])
    return specification(panels, sewn_edges)


CREASE = "[[effects.rest_angle.crease]]"


def test_creases_of_labels_are_those_of_their_edges(tmp_path):
    bending = ["[effects.bending]"]
    by_label = [CREASE, 'label = "mountain"', "angle_degrees = 60", CREASE, 'label = "valley"', "angle_degrees = -60"]
    by_edge = [
        line
        for k in range(1, 5)
        for line in (CREASE, f'panel = "s{k}"', "edge = 3", f"angle_degrees = {60 if k % 2 else -60}")
    ]
    first, second = (
        build(scene_of(tmp_path, pleats(), [*bending, *lines], size=0.02)).energies["rest_angle"]
        for lines in (by_label, by_edge)
    )
    assert len(first.numbers) == 4 * 4  # four creases of 8 cm, edges of 2 cm
    assert np.array_equal(np.sort(first.numbers), np.sort(second.numbers))
    of_world = build(scene_of(tmp_path, pleats(), bending, size=0.02))
    x = of_world.world.start() + 1e-3 * np.random.default_rng(0).standard_normal(of_world.world.start().shape)
    assert first.value(x) == pytest.approx(second.value(x), rel=1e-12)


@pytest.mark.parametrize("size", [0.005, 0.01, 0.02])
def test_creases_of_narrow_panels_cross_none_of_them(tmp_path, size):
    panels, sewn_edges = {}, []
    for k in range(4):  # strips of 1 x 20 cm, both long edges of the same label
        panels[f"s{k}"] = panel([[0, 0], [1, 0], [1, 20], [0, 20]], translation=[k, 0, 0])
        for edge in (1, 3):
            panels[f"s{k}"]["edges"][edge]["label"] = "fold"
        sewn_edges += [stitch((f"s{k - 1}", 1), (f"s{k}", 3))] if k else []
    lines = ["[effects.bending]", CREASE, 'label = "fold"', "angle_degrees = 30"]
    made = build(scene_of(tmp_path, specification(panels, sewn_edges), lines, size=size))
    assert made.energies["rest_angle"].counts_of_hinges == (3 * round(0.2 / size),)


def test_pleats_rest_at_the_angle_of_their_creases(tmp_path):
    angle = 120.0
    lines = ["[effects.bending]", "[effects.damping]", "rate = 40.0"]
    for label, sign in (("mountain", 1), ("valley", -1)):
        lines += [CREASE, f'label = "{label}"', f"angle_degrees = {sign * angle}"]
    scene = scene_of(tmp_path, pleats(angle), lines, size=0.02, bending_stiffness=1e-4)
    run = clothsim.simulate(replace(scene, solver={"dt": 0.02}, run={"duration": 0.1}))
    assert run.status == "completed"
    moved = np.abs(run.positions(-1) - run.positions(0)).max()
    flat = clothsim.simulate(replace(scene, effects={key: keys for key, keys in scene.effects.items()
                                                     if key != "rest_angle"}, run={"duration": 0.1}))  # fmt: skip
    assert moved < 1e-6
    assert np.abs(flat.positions(-1) - flat.positions(0)).max() > 1e-3


@pytest.mark.parametrize(
    "keys",
    [
        ['panel = "s0"', "edge = 0"],  # a border
        ['panel = "s0"'],
        ["edge = 3"],
        ['panel = "s1"', "edge = 3", 'label = "valley"'],
        ['label = "hem"'],
        ['panel = "s9"', "edge = 3"],
    ],
)
def test_creases_that_cannot_be(tmp_path, keys):
    with pytest.raises(InputError):
        build(scene_of(tmp_path, pleats(), ["[effects.bending]", CREASE, *keys, "angle_degrees = 20"]))


@pytest.mark.parametrize("keys", ["{ finish = 1.0 }", "{ start = 2.0 }", "1", "{ stiffness = -1.0 }"])
def test_strings_that_cannot_be(tmp_path, keys):
    with pytest.raises(InputError):
        build(scene_of(tmp_path, labelled(), ["[effects.seams]", f"pattern = {keys}"]))


def test_strings_without_a_pattern():
    scene = clothsim.Scene(cloth={"mesh": "rectangle"}, effects={"inertia": {}, "seams": {"pattern": {}}})
    with pytest.raises(InputError):
        build(scene)


def test_a_pattern_without_open_seams_needs_no_strings(tmp_path):
    entries = specification({"left": panel(), "right": panel(SQUARE, translation=[10, 0, 0])},
                            [stitch(("left", 1), ("right", 3))])  # fmt: skip
    made = build(scene_of(tmp_path, entries, ["[effects.seams]", "pattern = {}"]))
    assert "seams" in made.off


def test_welding_by_distance_keeps_the_names(tmp_path):
    apart = specification({"left": panel(), "right": panel(SQUARE, translation=[10.1, 0, 0])},
                          [stitch(("left", 1), ("right", 3))])  # fmt: skip
    open_ = build(scene_of(tmp_path, apart)).world.cloths[0]
    welded = build(scene_of(tmp_path, apart, weld=2e-3)).world.cloths[0]
    assert list(open_.lines.open_seams) == ["left.1 to right.3"]
    assert dict(welded.lines.open_seams) == {}
    left, right = welded.lines.edges["left", 1], welded.lines.edges["right", 3]
    assert np.array_equal(left, right[::-1])


def test_lines_under_another_numbering():
    lines = PatternLines({("a", 0): np.array([2, 1, 0])}, {"top": (("a", 0),)}, {"s": np.array([[0, 3], [1, 2]])})
    after = lines.renumbered(np.array([0, 1, -1, 0]))
    assert after.edges["a", 0].tolist() == [1, 0]
    assert after.labelled("top").tolist() == [0, 1]
    assert after.segments([("a", 0)]).tolist() == [[1, 0]]
    assert dict(after.open_seams) == {}
