"""Hatching: the tone that is asked for, lines along the field, and streaks that stay where they are."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from rosy_addon.compositor.anchored import identities, surface_noise
from rosy_addon.compositor.colour import from_hex, to_display, to_linear
from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.flow import planar_flow
from rosy_addon.compositor.hatching import family_shares, ink_statistics
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.presets import load_preset, preset_names
from rosy_addon.compositor.shading import diffuse
from rosy_addon.field.generate import axis_field
from rosy_addon.field.surface import Surface, build_surface
from rosy_addon.projection.camera import Camera, look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import Body
from rosy_addon.projection.project import project
from rosy_addon.projection.rest import rest_places

SIZE = 384
PRESETS = {name: load_preset(name).look for name in preset_names()}
HATCHED = [name for name, look in PRESETS.items() if look.ink == "hatch"]

INK = Look(ink="hatch", anchor="surface", light="lamp", shading=1.0, grain=2.5, supersampling=2)


@lru_cache(maxsize=4)
def tube(around=160, along=120, bend=0.0):
    """A tube along z, of radius 0.5; bent, it remembers what it was."""
    turn = np.arange(around) * 2 * np.pi / around
    height = np.linspace(-1.5, 1.5, along + 1)
    rest = np.stack(
        [
            np.tile(0.5 * np.cos(turn), along + 1),
            np.tile(0.5 * np.sin(turn), along + 1),
            np.repeat(height, around),
        ],
        axis=1,
    )
    here = np.arange(along)[:, None] * around + np.arange(around)
    right = np.roll(here, -1, axis=1)
    faces = np.stack([here, right, right + around, here + around], axis=-1).reshape(-1, 4)
    points = rest if not bend else bent(rest, bend)
    return build_surface(
        points,
        faces.ravel(),
        np.arange(0, 4 * len(faces) + 1, 4),
        name="tube",
        rest=rest,
    )


def bent(points, angle):
    """Turned about the x axis, the more the higher, as an armature with smooth weights does it."""
    share = angle * np.clip(0.5 + points[:, 2], 0, 1)
    cos, sin = np.cos(share), np.sin(share)
    y, z = points[:, 1], points[:, 2]
    return np.stack([points[:, 0], cos * y - sin * z, sin * y + cos * z], axis=1)


@lru_cache(maxsize=4)
def ball(rows=70):
    up = np.linspace(0, np.pi, rows + 1)[:, None]
    around = np.arange(2 * rows) * np.pi / rows
    points = np.stack(
        [np.sin(up) * np.cos(around), np.sin(up) * np.sin(around), np.cos(up) + 0 * around], axis=-1
    ).reshape(-1, 3)
    here = np.arange(rows)[:, None] * 2 * rows + np.arange(2 * rows)
    right = np.roll(here, -1, axis=1)
    corners = np.concatenate(
        [
            np.stack([here, here + 2 * rows, right + 2 * rows], axis=-1).reshape(-1, 3),
            np.stack([here, right + 2 * rows, right], axis=-1).reshape(-1, 3),
        ]
    )
    return build_surface(points, corners.ravel(), np.arange(0, corners.size + 1, 3), name="ball")


def body(surface: Surface, degree=4, matrix=None):
    field = axis_field(surface, degree, (0.3, 0.2, 1.0))
    return Body(surface, np.eye(4) if matrix is None else matrix, field)


def eye(azimuth=0.0, zoom=1.0, away=4.0):
    place = away * np.array([np.sin(azimuth), -np.cos(azimuth), 0.3])
    return perspective_camera(
        look_at(place, (0, 0, 0)), SIZE, SIZE, fov=2 * np.arctan(np.tan(0.28) / zoom)
    )


def finer(camera, side):
    return Camera(
        camera.view, np.array(camera.projection), camera.width * side, camera.height * side, "fine"
    )


def drawn(thing, camera, look, lights=()):
    return compose(project([thing], finer(camera, look.supersampling)), look, lights).rgba


# --- tone ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", HATCHED)
def test_presets_reproduce_a_ramp(name):
    """A ball under one light, from 0 to 1: blurred, ink on paper is as light as it was to be."""
    look = PRESETS[name]
    thing, camera = body(ball()), eye()
    rgba = drawn(thing, camera, look)
    gbuffer = project([thing], camera)
    asked = np.clip(diffuse(gbuffer, look).mean(axis=1), 0, 1)
    assert asked.min() < 1 - look.shading + 0.05 and asked.max() > 0.97
    paper, ink = (to_linear(from_hex(code)) for code in (look.paper_colour, look.ink_colour))
    # From the darker of ink and paper to the lighter, by the channel in which they differ most.
    channel = int(np.argmax(np.abs(paper - ink)))
    darker, lighter = sorted((paper[channel], ink[channel]))
    left = (rgba[..., channel] - darker) / (lighter - darker)
    seen = np.zeros(SIZE * SIZE)
    seen[gbuffer.pixel] = 1
    wanted = np.zeros(SIZE * SIZE)
    wanted[gbuffer.pixel] = asked
    seen, wanted = seen.reshape(SIZE, SIZE), wanted.reshape(SIZE, SIZE)
    share = gaussian_filter(seen, 16)
    inner = share > 0.98
    got = gaussian_filter(np.where(seen > 0, left, 0), 16)[inner] / share[inner]
    error = np.abs(got - gaussian_filter(wanted, 16)[inner] / share[inner])
    assert error.mean() <= 0.04


@pytest.mark.parametrize("crispness", [0.0, 0.5, 1.0])
def test_thresholds_cover_what_they_say(crispness):
    """Of normal streaks, those of a threshold cover as much of the paper as it is for."""
    threshold, deviation, _ = ink_statistics(81, 2.0, 0.5, 16.0, crispness)
    assert (np.diff(threshold) < 0).all() and deviation > 0
    middle = threshold[len(threshold) // 2]
    assert abs(middle) < 0.1  # half of the paper: streaks of dense noise are hardly skew


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 6, 7])
@pytest.mark.parametrize("layers", [1, 2, 3])
def test_shares_of_families_are_whole_and_continuous(degree, layers):
    """They sum to 1, and change places without a jump as the field turns under the guide."""
    angles = np.linspace(-1, 1, 40001)[None]
    flow = planar_flow(angles, degree)
    look = Look(ink="hatch", layers=layers, guiding_angle=0.3)
    for tone in (0.02, 0.3, 0.7, 0.98):
        shares = np.array(family_shares(flow, look, np.full(angles.size, tone, dtype=np.float32)))
        np.testing.assert_allclose(shares.sum(axis=0), 1, atol=1e-5)
        # The members jump where the guide lies between two; the directions that get ink do not.
        ordered = np.sort(shares, axis=0)
        assert np.abs(np.diff(ordered, axis=1)).max() < 0.03
        # Where two change places both are there, and so may be their neighbour on the other side.
        usual = np.median((shares > 0.02).sum(axis=0))
        assert usual <= min(layers, flow.lines)


@pytest.mark.parametrize("name", HATCHED)
def test_lines_run_along_the_field(name):
    """The peak of the orientations on a wall that faces the eye is the field's, within 2 degrees."""
    points = np.array([[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]], dtype=float)
    wall = build_surface(points, [0, 1, 2, 3], [0, 4], name="wall")
    angle = np.radians(25)
    field = axis_field(wall, 2, (np.cos(angle), 0, np.sin(angle)))
    camera = orthographic_camera(look_at((0, -5, 0), (0, 0, 0)), SIZE, SIZE, scale=6)
    look = replace(PRESETS[name], shading=0.8)
    rgba = drawn(Body(wall, np.eye(4), field), camera, look)
    picture = rgba[..., 1] * rgba[..., 3]
    up, right = (gaussian_filter(picture, 2.0, order=order) for order in ((1, 0), (0, 1)))
    across = np.angle(((right + 1j * up) ** 2).mean()) / 2
    along = (across + np.pi / 2 - angle + np.pi / 2) % np.pi - np.pi / 2
    assert abs(np.degrees(along)) < 2


# --- stability ---------------------------------------------------------------------------------------


def likeness(thing, camera, other, other_camera, look):
    """Correlation of two pictures, the second one warped by the true motion."""
    first, second = drawn(thing, camera, look), drawn(other, other_camera, look)
    here, there = project([thing], camera), project([other], other_camera)
    corners = thing.surface.triangle_vertex[here.triangle]
    moved = np.einsum("pi,pij->pj", here.barycentric, other.surface.vertices[corners])
    matrix = other_camera.projection @ other_camera.view @ other.matrix
    clip = np.concatenate([moved, np.ones((len(moved), 1))], axis=1) @ matrix.T
    place = (clip[:, :2] / clip[:, 3:] * 0.5 + 0.5) * SIZE - 0.5
    depth = np.full((SIZE, SIZE), np.inf)
    depth.reshape(-1)[there.pixel] = -there.position[:, 2]
    near = np.rint(place).astype(int)
    seen = ((near >= 2) & (near < SIZE - 2)).all(axis=1)
    seen[seen] = np.abs(depth[near[seen, 1], near[seen, 0]] - clip[seen, 3]) < 0.01
    assert seen.mean() > 0.5
    tone, tone_there = (to_display(picture[..., 0]) for picture in (first, second))
    warped = map_coordinates(tone_there, place[seen, ::-1].T, order=3, mode="nearest")
    return np.corrcoef(tone.reshape(-1)[here.pixel[seen]], warped)[0, 1]


def moved_by(pixels):
    matrix = np.eye(4)
    matrix[0, 3] = pixels * 4.0 / eye().pixels_per_unit
    return matrix


MOTIONS = {
    "camera turned": lambda: (body(tube()), eye(), body(tube()), eye(np.radians(1))),
    "object moved": lambda: (body(tube()), eye(), body(tube(), matrix=moved_by(2)), eye()),
    "zoomed": lambda: (body(tube()), eye(), body(tube()), eye(zoom=1.1)),
    "bent": lambda: (body(tube()), eye(), body(tube(bend=0.05)), eye()),
    "bent far": lambda: (body(tube(bend=0.8)), eye(), body(tube(bend=0.81)), eye()),
}


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("ink", ["soft", "hatch"])
def test_streaks_stay_on_the_surface(motion, ink):
    # Even light: what moves with the lamp is not what is asked about.
    look = replace(INK, ink=ink, light="scene", shading=0.35 if ink == "hatch" else 0.0)
    look = replace(look, gain=1.2, crispness=0.5)
    first, camera, second, other_camera = MOTIONS[motion]()
    # Streaks as long as ever, in pixels, average less of the surface from nearer: that costs some
    # likeness, and thresholds make more of it.
    least = 0.8 if (motion, ink) == ("zoomed", "hatch") else 0.9
    assert likeness(first, camera, second, other_camera, look) >= least
    if motion == "zoomed":
        still = replace(look, anchor="picture")
        assert likeness(first, camera, second, other_camera, still) < 0.5


def test_lines_keep_their_width_through_a_zoom():
    """Of the lines across a wall, from one zoom to sixteen times as near."""
    points = np.array([[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]], dtype=float)
    wall = build_surface(points, [0, 1, 2, 3], [0, 4], name="wall")
    thing = Body(wall, np.eye(4), axis_field(wall, 2, (1.0, 0, 0)))
    widths = []
    for zoom in 2.0 ** np.arange(0, 4.01, 0.5):
        camera = orthographic_camera(
            look_at((0.3, -5, 0.2), (0.3, 0, 0.2)), SIZE, SIZE, scale=8 / zoom
        )
        rgba = drawn(thing, camera, replace(INK, light="scene", shading=0.4, grain=4.0))
        widths.append(width_of_lines(rgba[..., 0]))
    # The measure itself wavers by a few hundredths from zoom to zoom.
    assert max(widths) / min(widths) < 1.22


def width_of_lines(picture):
    """Where the autocorrelation across horizontal lines has fallen to a half, pixels."""
    columns = picture - picture.mean()
    spectrum = np.abs(np.fft.fft(columns, axis=0)) ** 2
    correlation = np.fft.ifft(spectrum.mean(axis=1)).real
    correlation /= correlation[0]
    below = int(np.argmax(correlation < 0.5))
    above, under = correlation[below - 1], correlation[below]
    return below - 1 + (above - 0.5) / (above - under)


# --- noise on the surface ---------------------------------------------------------------------------


def test_places_at_rest_are_those_of_the_bodies():
    thing = body(tube(bend=0.8), matrix=np.diag([1.0, -1.0, 2.0, 1.0]))
    gbuffer = project([thing], eye(away=9))
    places = rest_places(gbuffer)
    corners = thing.surface.rest[thing.surface.triangle_vertex[gbuffer.triangle]]
    wanted = np.einsum("pi,pij->pj", gbuffer.barycentric, corners)
    np.testing.assert_allclose(places.at(0, 0).T, wanted, atol=2e-4)
    # A pixel to the right is the next pixel of the same triangle.
    right = np.flatnonzero((np.diff(gbuffer.pixel) == 1) & (np.diff(gbuffer.triangle) == 0))
    np.testing.assert_allclose(places.at(1, 0).T[right], wanted[right + 1], atol=2e-4)


@pytest.mark.parametrize("high_pass", [0.0, 16.0])
@pytest.mark.parametrize("away", [3.0, 4.7, 11.0])
def test_noise_is_as_varied_as_that_of_the_picture(high_pass, away):
    gbuffer = project([body(tube())], eye(away=away, zoom=away / 4))
    noise = surface_noise(gbuffer, 2.0, 0, 3, density=0.3, high_pass=high_pass)
    assert np.abs(noise.mean(axis=0) - 0.5).max() < 0.02
    assert 0.3 < noise.std() < 0.5
    channels = np.corrcoef(noise.T)
    assert np.abs(channels[np.triu_indices(3, 1)]).max() < 0.03


def test_bodies_have_noise_of_their_own():
    names = ["a", "b", "a", "a", "c"]
    assert len(set(identities(names).tolist())) == 5
    # A body that joins in does not change the others'.
    assert identities(["z", *names])[1:].tolist() == identities(names).tolist()


def test_clear_paper_is_ink_alone():
    look = replace(INK, clear_paper=True, ink_colour="#204060")
    clear, full = (
        drawn(body(ball()), eye(), look),
        drawn(body(ball()), eye(), replace(look, clear_paper=False)),
    )
    inked = clear[..., 3] > 0
    np.testing.assert_allclose(
        clear[inked][:, :3], np.tile(to_linear(from_hex("#204060")), (inked.sum(), 1)), rtol=1e-3
    )
    whole = full[..., 3] == 1
    on_white = clear[..., :3] * clear[..., 3:] + 1 - clear[..., 3:]
    np.testing.assert_allclose(on_white[whole], full[whole][:, :3], atol=2e-3)
