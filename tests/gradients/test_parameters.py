"""Derivatives by the numbers of a scene, bodies, pins and the rest shape, against differences of runs (G-2)."""

from dataclasses import replace

import numpy as np
import pytest
from adjoint_cases import (
    BALL,
    CONTACT,
    ELASTIC,
    FALLING,
    FRICTION,
    KAPPA,
    Case,
    best_error,
    falling_scene,
)

from clothsim.base.errors import InputError
from clothsim.gradients.parameters import affected_effects, value_at, with_value
from clothsim.scene.assembly.scene_world import build

BAR = 1e-6


@pytest.fixture(scope="module")
def case():
    return Case(falling_scene(ELASTIC | CONTACT | FRICTION))


FABRIC = "youngs_modulus", "poisson_ratio", "density", "thickness"


@pytest.mark.parametrize("path", [f"cloth.{key}" for key in FABRIC] + ["effects.friction.coefficient"])
def test_fabric_and_friction(case, path):
    assert case.error(path) < BAR


def test_bending(case):
    assert case.error("cloth.bending_stiffness", (3e-2, 1e-2)) < BAR  # linear, and .003 of the loss


@pytest.fixture(scope="module")
def soft():
    own = {"bending_stiffness": 1e-3, "bending_slope": -1e-4, "rest_curvature_warp": 2.0}
    return Case(falling_scene(ELASTIC | {"bending": {"short_waves": 1.0}}, FALLING | own))


@pytest.mark.parametrize("key", ["bending_slope", "rest_curvature_warp", "rest_curvature_weft", "bending_stiffness"])
def test_slope_and_curl(soft, key):
    assert soft.error(f"cloth.{key}", (4e-2, 2e-2, 1e-2, 1e-3)) < BAR


def test_gravity_and_the_start_of_the_cloth(case):
    assert case.error("effects.gravity.acceleration") < BAR
    assert case.error("cloth.position", (1e-6, 1e-7)) < BAR


def test_shift_and_size_of_a_body(case):
    assert case.error("body.ball.radius", (1e-6, 1e-7)) < BAR
    moved = with_value(case.scene, "body.position", np.zeros(3))
    direction = np.array([0.3, -0.5, 1.0])
    found = float(case.gradient["body.ball.position"] @ direction)
    error = best_error(found, lambda h: case.loss(with_value(moved, "body.position", h * direction)), (1e-6, 1e-7))
    assert error < BAR


def test_turn_of_a_body(case):
    direction = np.array([0.7, 0.2, -0.4])
    place = lambda h: replace(case.scene, body=BALL | {"rotation_degrees": (np.degrees(h) * direction).tolist()})  # noqa: E731
    found = float(case.gradient["body.turn"] @ direction)
    assert best_error(found, lambda h: case.loss(place(h)), (1e-5, 1e-6)) < 10 * BAR


def test_rest_shape_along_a_field(case):
    from clothsim.gradients.gradient import _displaced
    from clothsim.mesh.world import make_world
    from clothsim.scene.assembly.scene_world import build_effects

    world = case.run.session.built.world
    field = np.zeros(world.cloths[0].rest_positions.shape)
    field[:, :2] = np.random.default_rng(3).standard_normal((len(field), 2))

    def loss(h):
        varied = replace(make_world([_displaced(world.cloths[0], h * field)], world.bodies), origin=world.origin)
        return case.loss(built=build_effects(case.scene, varied))

    assert best_error(case.gradient.rest_along(field), loss, (1e-5, 1e-6)) < BAR


def test_contact_weights_follow_the_rest_shape(case, monkeypatch):
    """The wrong formula: weights of contact pairs not differentiated."""
    field = np.zeros(case.run.session.built.world.cloths[0].rest_positions.shape)
    field[:, :2] = np.random.default_rng(3).standard_normal((len(field), 2))
    right = case.gradient.rest_along(field)
    monkeypatch.setattr("clothsim.gradients.gradient.Variation", _without_contact)
    assert abs(case.gradient.rest_along(field) - right) > 10 * BAR * abs(right)


def _without_contact(build, step, stencil, affected):
    from clothsim.gradients.parameters import Variation

    return Variation(build, step, stencil, tuple(name for name in affected if name not in CONTACT))


MODELS = {
    "midedge": {"bending": {}},
    "short waves": {"bending": {"short_waves": 1.0}},
    "quadratic": {"bending": {"model": "quadratic"}},
    "orthotropic": {"membrane": {"material": "orthotropic"}},
    "pairs": {"membrane": {"elements": "pairs"}},
    "fibres": {"fibres": {"warp": 200.0}},
    "springs": {"springs": {"spring": [{"select": [0, 3], "stiffness": 5.0}]}},
    "elastic band": {"elastic_bands": {"band": [{"select": "left", "stiffness": 5.0, "length_ratio": 0.8}]}},
    "cord": {"cords": {"cord": [{"select": "left", "stiffness": 5.0, "length_ratio": 0.8}]}},
    "air": {"air": {"wind": [3.0, 0.0, 1.0]}},
    "vortex": {"air": {"wind": {"kind": "vortex", "circulation": 3.0, "core": 0.5, "velocity": (1.0, 2.0, 0.5)}}},
    "gusts": {"air": {"wind": {"kind": "gust", "velocity": [3.0, 0.0, 1.0], "period": 0.05}, "lift": 0.6}},
    "strain limit": {"strain_limit": {"limit": 1.02, "begins": 0.0}},
    "creases": {"rest_angle": {"crease": [{"vertices": [12, 13, 14, 15, 16, 17], "angle_degrees": 30.0}]}},
    "clamped edge": {"pins": {"select": "left", "clamp": True, "motion": {"velocity": [0.0, 0.2, -0.3]}}},
    "pressure": {"pressure": {"value": 5.0}},
    "damping": {"damping": {"rate": 2.0, "stiffness": 2e-3, "strain_rate": 0.02}},
}
NUMBERS = {
    "fibres": "effects.fibres.warp",
    "springs": "effects.springs.spring[0].stiffness",
    "elastic band": "effects.elastic_bands.band[0].length_ratio",
    "cord": "effects.cords.cord[0].length_ratio",
    "air": "effects.air.drag",
    "vortex": "effects.air.wind.circulation",
    "gusts": "effects.air.wind.velocity",
    "strain limit": "effects.strain_limit.limit",
    "creases": "effects.rest_angle.crease[0].angle_degrees",
    "clamped edge": "effects.pins.motion.velocity",
    "pressure": "effects.pressure.value",
    "damping": "effects.damping.strain_rate",
    "orthotropic": "cloth.poisson_ratio",
}


@pytest.mark.parametrize("name", MODELS)
def test_every_model_of_membrane_bending_and_loads(name):
    made = Case(falling_scene(ELASTIC | CONTACT | MODELS[name]), lengths=(0.02,) * 3)
    path = NUMBERS.get(name, "cloth.bending_stiffness" if "bending" in MODELS[name] else "cloth.youngs_modulus")
    assert made.error(path, (1e-2, 1e-3, 1e-4, 1e-5)) < BAR
    assert made.chain.start_error(made.chain.adjoints(), "velocities", "gradient", (3e-6, 3e-7)) < BAR


def test_pins_and_forces():
    sheet = FALLING | {"velocity": [0.0, 0.0, 0.0], "position": [0.0, 0.0, 0.0]}
    effects = ELASTIC | {"pins": {"select": [0, 5, 30]}, "springs": {"spring": [{"select": [17], "stiffness": 1e-9}]}}
    made = Case(falling_scene(effects, sheet, body=()), lengths=(0.02,) * 3)
    gradient, start = made.gradient, made.chain.start
    assert gradient["pins"].shape == (3, 3)
    rows, shift = gradient.pinned, np.random.default_rng(4).standard_normal((3, 3))
    moved = {int(row): each for row, each in zip(rows, shift, strict=True)}
    integrator = made.chain.integrator

    class Shifted(type(integrator.constraints["pins"])):
        size = 0.0

        def at(self, time):
            target = super().at(time)
            offset = np.array([moved[int(row)] for row in target.vertices])
            return replace(target, positions=target.positions + self.size * offset)

    def loss(h):
        pins = Shifted(integrator.constraints["pins"].groups)
        object.__setattr__(pins, "size", h)
        return made.chain.loss(start, replace(integrator, constraints={"pins": pins}))

    assert best_error(float(np.vdot(gradient["pins"], shift)), loss, (1e-5, 1e-6)) < BAR
    # a spring of stiffness k to a distant place is a force
    far = 1e9 * np.array([0.0, 0.6, 0.8])
    spring = {"select": [17], "stiffness": 1e-9, "to": far.tolist(), "rest_length": 0.0}

    def pulled(h):
        own = effects | {"springs": {"spring": [spring | {"stiffness": 1e-9 * (1 + h)}]}}
        return made.loss(falling_scene(own, sheet, body=()))

    weak = Case(falling_scene(effects | {"springs": {"spring": [spring]}}, sheet, body=()), lengths=(0.02,) * 3)
    force = float(weak.gradient["force"][17] @ (1e-9 * far))
    assert best_error(force, pulled, (1e-3, 1e-4)) < 1e-5


def test_paths():
    scene = falling_scene()
    world = build(scene).world
    assert value_at(scene, world, "cloth.density") == pytest.approx(world.cloths[0].fabric.density)
    assert value_at(scene, world, "effects.gravity.acceleration").tolist() == [0.0, 0.0, -9.81]
    assert with_value(scene, "body.ball.radius", np.array(0.2)).bodies[0]["radius"] == 0.2
    assert value_at(scene, world, "effects.body_contact.stiffness") == KAPPA
    assert affected_effects("cloth.density", ("inertia", "body_contact", "friction")) == ("inertia",)
    for path in ("cloth.mesh", "effects.air.drag", "cloth.colour", "density", "effects.body_contact.d_hat"):
        with pytest.raises(InputError):
            value_at(scene, world, path)
    woven = {key: value for key, value in FALLING.items() if key != "youngs_modulus"} | {"fabric": "denim"}
    woven = falling_scene(cloth=woven)
    with pytest.raises(InputError):
        value_at(woven, build(woven).world, "cloth.youngs_modulus")
