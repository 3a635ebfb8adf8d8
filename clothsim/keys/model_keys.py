"""The section [[body]] of a body model: shape, pose and skeletal motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from clothsim.keys.key_table import KeyTable
from clothsim.keys.placed_keys import PlacedKeys
from clothsim.keys.schema import Key


@dataclass(frozen=True, kw_only=True)
class ClipKeys(KeyTable):
    """Skeletal motion of a body model: its clip, the part of it, and the way into it."""

    section: ClassVar[str] = "body.motion"

    clip: Annotated[
        str,
        Key('A clip: "walk" or "turn"; a .bvh file, an AMASS .npz file; or "own", the animation of the model\'s file'),
    ]
    animation: Annotated[str | None, Key("Name of the animation, with `own`", shown="the first")] = None
    scale: Annotated[
        float | None, Key("Metres for a unit of the clip", "m", above=0, shown="the ratio of the thighs")
    ] = None
    start: Annotated[float, Key("First time of the clip that is used", "s", least=0)] = 0.0
    end: Annotated[float | None, Key("Last time of the clip that is used", "s", above=0, shown="its end")] = None
    loop: Annotated[bool, Key("Repeat that part; the body goes on from where it is")] = False
    lead_in: Annotated[float, Key("Time from the pose of the body to the start of the clip", "s", least=0)] = 0.7
    keep_apart: Annotated[
        bool, Key("Turn shoulders and hips by the least angles that leave 1.2 % of the height between limbs and trunk")
    ] = False
    place: Annotated[
        Literal["start", "clip"] | None,
        Key("Begin where the body stands and looks, or where the clip begins", shown='"clip" with `own`, else "start"'),
    ] = None


@dataclass(frozen=True, kw_only=True)
class ModelTable(PlacedKeys):
    """A posed or moving body model: `model` in place of a mesh."""

    section: ClassVar[str] = "body"

    model: Annotated[
        str,
        Key('A body model: "mannequin"; a rigged .glb or .gltf; or an .npz with the keys of SMPL, in place of mesh'),
    ]
    shape: Annotated[
        Sequence[float] | Mapping[str, float] | None,
        Key("Measures of the mannequin or weights of morph targets by name; shape parameters of an .npz", shown="none"),
    ] = None
    pose: Annotated[
        str | Mapping[str, Any] | None,
        Key(
            "Pose at the start: of the mannequin a name; else rotation vectors by joint from rest",
            "degrees",
            shown="the rest pose",
        ),
    ] = None
    motion: Annotated[
        str | ClipKeys | Mapping[str, Any] | None,
        Key("Skeletal motion: the clip's name or a table", tables=(ClipKeys,), shown="none"),
    ] = None
    group: Annotated[str | None, Key("A skinned node of a .glb alone", shown="all")] = None
    up: Annotated[
        Literal["z", "y"] | None,
        Key("Axis of the model that points up; y is turned onto z", shown="z of the mannequin, else y"),
    ] = None  # type: ignore[assignment]
