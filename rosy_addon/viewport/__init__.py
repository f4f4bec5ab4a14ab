"""The live view: fields are drawn over a 3D view at every redraw, and nothing is baked.

The picture of a view is composited over what Blender has drawn, where the surfaces are in front.
Handlers only note which data has changed; everything is read when Blender draws. While the view
changes, the picture may be a preview at reduced size. When the view is at rest, the final picture is
rendered in slices of time, one slice per redraw.

    view3d         queries about Blender's 3D views, and redraws
    app_handlers   functions that Blender calls, such as after an undo
    layers         the meshes of view layers, and reference renders, as they were read last
    flow_clock     the clock by which streaks drift
    overlays       dots at singularities, arrowheads and messages, drawn over the pictures
    progressive    previews and final pictures, within a time budget
    session        handlers, timers and drawing; `start` and `stop`
    brush_mouse    points under the mouse for the tool *Comb Field*
"""
