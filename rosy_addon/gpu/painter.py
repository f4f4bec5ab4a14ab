"""Bodies and a camera to a finished picture, by the processor or by the card."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..compositor.compose import composing
from ..compositor.look import Look
from ..compositor.picture import Picture
from ..compositor.shading import Light
from ..compositor.tone import Rendered, check_tone
from ..errors import DeviceError
from ..progress import Work, part
from ..projection.camera import Camera
from ..projection.gbuffer import Body, GBuffer
from ..projection.project import check_bodies, projecting, raise_nothing_in_view
from .card import Card
from .device import blender_device

#: What draws pictures: the names, and what a user reads of them.
DEVICES = {
    "cpu": ("Processor", "The same pixels on every machine"),
    "gpu": ("Graphics Card", "Faster; single pixels differ from card to card"),
    "auto": ("Automatic", "The graphics card where there is one, or else the processor"),
}

#: What `projecting` does, or does not again where it has been done.
Projecting = Callable[[Sequence[Body], Camera, str], Work[GBuffer]]


def find_card(device: str, look: Look) -> Card | None:
    """The card that is to draw a look; None if the processor is.

    Parameters
    ----------
    device : {"cpu", "gpu", "auto"}
    look : Look

    Raises
    ------
    DeviceError
        If it has to be a card, and there is none or it does not draw this look.
    """
    if device == "cpu":
        return None
    try:
        if look.method == "members":
            raise DeviceError(
                "the graphics card follows each streamline from member to member; it does not draw "
                "the method 'members'"
            )
        return Card(blender_device())
    except DeviceError:
        if device == "gpu":
            raise
    return None


def painting(
    card: Card | None,
    bodies: Sequence[Body],
    camera: Camera,
    look: Look,
    lights: Sequence[Light] = (),
    projecting: Projecting = projecting,
    rendered: Rendered | None = None,
) -> Work[Picture]:
    """The picture of bodies.

    Parameters
    ----------
    card : Card or None
        From `find_card`.
    bodies : sequence of Body
    camera : Camera
        Of `look.supersampling` times the size of the picture each way.
    look : Look
    lights : sequence of Light
    projecting : function
        The processor's first half.
    rendered : Rendered, optional
        For a look whose tone is that of a picture.

    Returns
    -------
    Picture
        From a card, without layers.

    Raises
    ------
    RosyError
        As `project.projecting`; if the tone is to come from what is not there; if the card does not
        take the shaders, or such a size.
    """
    check_tone(look, [body.tone for body in bodies], rendered)
    if card is None:
        gbuffer = yield from part(projecting(bodies, camera, look.display), 0.0, 0.4)
        return (yield from part(composing(gbuffer, look, lights, rendered), 0.4, 1.0))
    check_bodies(bodies, camera, look.display)
    placed = card.place(bodies, look.display)
    texture = yield from card.drawing(placed, camera, look, lights, rendered=rendered)
    side = look.supersampling
    rgba = card.read(texture, camera.width // side, camera.height // side)
    if not rgba[..., 3].any():
        raise_nothing_in_view(bodies, camera)
    return Picture(rgba, ())
