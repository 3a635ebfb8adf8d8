"""Pictures and movies; VTK, pyvista and embreex are imported only for drawing.

`picture.draw` writes one PNG, `movie.movie` an MP4 or GIF. A surface goes through `mesh_look` (normals, colours), is
seen through a `camera`, drawn by `vtk_scene` or `ray` over the `backdrop`, and gets its `legend`.
"""
