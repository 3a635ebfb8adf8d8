"""A towel that hangs, its scene, and a picture of a longer one: towel.toml and views.toml."""

import json

import numpy as np
from PIL import Image
from sewing_patterns import panel, specification
from views import looking, seen

from clothsim import load_scene
from clothsim.gradients.run import traced
from clothsim.gradients.scene_of_pattern import shaped_scene
from clothsim.mesh.refinement import refined

SCENE = """
[cloth]
mesh = "towel_specification.json"
size = 0.05
youngs_modulus = 4e4
rotation_degrees = [90, 0, 0]
[effects.membrane]
[effects.bending]
model = "hinge"
[effects.gravity]
[effects.pins]
select = "top"
[solver]
linear = "superlu"
dt = 0.05
[run]
duration = 0.1
frames_per_second = 20
"""
HEIGHT = 0.2


def write_towel(folder):
    """Write a towel of 0.2 m, its scene, and a picture of one that is 6 % longer."""
    (folder / "towel_specification.json").write_text(json.dumps(specification({"towel": panel()})))
    (folder / "towel.toml").write_text(SCENE)
    trace = traced(
        shaped_scene(load_scene(folder / "towel.toml")).with_numbers({"pattern.towel.height": 1.06 * HEIGHT})
    )
    x, triangles = trace.cloth_positions(), trace.session.built.world.triangles
    weights, fine = refined(triangles, len(x), 2)
    camera = looking((0.1, -0.7, 0.05), x.mean(axis=0), focal=220.0, size=(160, 120))
    mask = seen(camera, (weights @ x)[fine])[0] == 0
    Image.fromarray(np.where(mask, 255, 0).astype(np.uint8)).save(folder / "mask.png")
    keys = {"focal": camera.focal, "principal": camera.principal, "rotation": camera.rotation}
    keys["position"] = np.asarray(camera.position)
    lines = [f"{key} = {value.tolist()}" for key, value in keys.items()]
    view = ["[[view]]", 'name = "from here"', "width = 160", "height = 120", *lines, 'mask = "mask.png"']
    (folder / "views.toml").write_text("\n".join(view))
