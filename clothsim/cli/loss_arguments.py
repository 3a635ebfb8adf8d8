"""Losses on the command line: a name, and its value behind "="."""

from pathlib import Path
from typing import TYPE_CHECKING

from clothsim.errors import InputError

if TYPE_CHECKING:
    from clothsim.adjoint.losses import Loss
    from clothsim.mesh.world import World

LOSSES = {
    "height": "mean height of the cloth [m]",
    "silhouette": "area of its shadow on the ground [m2]",
    "girth=HEIGHT": "length of its cut with the plane z = HEIGHT [m]",
    "target=FILE": "mean squared distance to a drape: a mesh, points (.xyz) or a run [m2]",
}
"""Losses by the form in which they are given."""


def loss_of(text: str, world: "World") -> "Loss":
    """Return the loss that a text such as "girth=0.8" names. InputError for another text."""
    from clothsim.adjoint.losses import Girth, Height, Silhouette
    from clothsim.adjoint.targets import target_loss

    name, _, value = (part.strip() for part in text.partition("="))
    if name == "height" and not value:
        return Height()
    if name == "silhouette" and not value:
        return Silhouette()
    if name == "girth" and value:
        try:
            return Girth(float(value))
        except ValueError as error:
            raise InputError(f"--loss {text}: {value!r} is no height.", "Write it as girth=0.8, in metres.") from error
    if name == "target" and value:
        return target_loss(Path(value), world)
    raise InputError(f"--loss {text!r} is no loss.", f"Give {', '.join(LOSSES)}.")


def words(option: str, text: str) -> list[str]:
    """Return the names of a list such as "youngs_modulus,bending_stiffness". InputError where there is none."""
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise InputError(f"{option} names nothing.", f"Give some, such as {option} youngs_modulus,bending_stiffness.")
    return names
