"""Pictures and movies; VTK, pyvista and embreex are imported only for drawing.

`picture.draw` writes one PNG, `movie.movie` an MP4 or GIF. A surface goes through `surface_look` (normals, colours),
is seen through a `camera`, drawn by `vtk_scene` or `ray_caster`, and gets the background and legend of its `styles`.
"""

from typing import TYPE_CHECKING

from clothsim.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from clothsim.render.colour_scale import Quantity
    from clothsim.render.marks import draw_marks
    from clothsim.render.movie import movie as write_movie
    from clothsim.render.movie import movie_file
    from clothsim.render.pattern_drawing import draw_pattern, laid_out
    from clothsim.render.picture import draw, picture_setup, rendered
    from clothsim.render.surface_look import WIDTHS, Surface

__getattr__, __dir__, __all__ = lazy_names(__name__)
