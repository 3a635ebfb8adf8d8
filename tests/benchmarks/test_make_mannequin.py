"""Template of the mannequin: the shipped file equals the generated one."""

import numpy as np

from clothsim.mesh.generators.mannequin.generator import template
from tests.benchmarks.make_mannequin import body_field, make_template, write_template


def test_the_shipped_template_is_what_the_maker_makes():
    shipped, made = template(), make_template()
    np.testing.assert_array_equal(shipped.triangles, made.triangles)
    np.testing.assert_allclose(shipped.positions, made.positions, rtol=0, atol=1e-9)
    np.testing.assert_allclose(shipped.weights, made.weights, rtol=0, atol=1e-9)


def test_a_written_template_has_the_same_bits(tmp_path):
    write_template(tmp_path / "template.npz")
    made = make_template()
    with np.load(tmp_path / "template.npz") as file:
        for name in ("positions", "triangles", "weights"):
            np.testing.assert_array_equal(file[name], getattr(made, name))


def test_the_vertices_are_on_the_implicit_surface():
    assert np.abs(body_field(template().positions)[0]).max() < 2e-4
