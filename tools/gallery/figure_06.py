"""Figure 6: how blending reduces contrast, and the correction."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from rosy_addon.compositor.contrast import blend_gain, expected_std, scale_contrast
from rosy_addon.compositor.image_noise import NOISE_MEAN
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look

from .looks import MEASURED
from .page import Page
from .plane import PlanarField, channel, compose_field
from .sheet import Panel, chart, gray

DEGREE, SIZE, FIELD_SIZE = 6, 256, 400
LOOK = MEASURED.with_settings({"hue": "noise"})
EXPANDED, SEEDS = 2.5, 6
MEMBER = np.radians(12)
RANGE = (0.0, 1.0)


def constant(angle: float, degree: int) -> PlanarField:
    """Return a constant field; the angle is in radians."""
    return lambda p: np.full(p.shape, np.exp(1j * degree * angle))


def write() -> None:
    """Draw and write the page."""
    page = Page("figure-06", "Contrast")
    layers = compose_field(constant(MEMBER, DEGREE), DEGREE, FIELD_SIZE, LOOK).layer
    expected = expected_std(pixel_look(LOOK))
    # In the visible part, streamlines have their full length.
    gain = float(blend_gain(DEGREE // 2, np.float32([2 * LOOK.length + 1]), pixel_look(LOOK))[0])
    blend = layers.images.blend
    shown = [
        ("one member, I₀", layers.images.members[0], expected),
        ("another one, I₁", layers.images.members[1], expected),
        ("the third, I₂", layers.images.members[2], expected),
        ("I, the mean of three", blend, expected / gain),
        ("corrected", layers.tone, expected),
        (f"expanded {EXPANDED} times", scale_contrast(layers.tone, EXPANDED), expected * EXPANDED),
    ]
    page.text(
        """This page shows how blending reduces the contrast, and how RoSy corrects it. The field is
        a constant 6-RoSy field. The noise is colored, and half of its cells are bright. Each pixel
        of a member's LIC image is the mean of many noise samples, so its values are nearly normally
        distributed. The blend of the three members has a smaller spread, so the picture gets gray.
        The reduction is known in advance, so no image analysis is needed: differences from 0.5 are
        multiplied by a factor. The histograms show the red channel. The line is the normal
        distribution expected from theory, not a fit."""
    )
    images = [_cut(channel_wise) for _, channel_wise, _ in shown]
    panels = [
        [Panel(gray(image), f"({letter}) {name}"), _histogram(image[..., 0], deviation)]
        for image, (name, _, deviation), letter in zip(images, shown, "abcdef", strict=True)
    ]
    for suffix, chosen in (("members", panels[:3]), ("blended", panels[3:])):
        page.picture(
            [[pair[0] for pair in chosen], [pair[1] for pair in chosen]],
            "Images of a constant 6-RoSy field, each with the histogram of its red channel",
            suffix,
        )
    page.text("## Measurements")
    page.text(
        """The table lists the mean and the standard deviation over the three channels, beside
        the value from theory."""
    )
    rows = []
    for (name, _, deviation), image in zip(shown, images, strict=True):
        measured = float(image.std(axis=(0, 1)).mean())
        rows.append(
            [
                name,
                float(image.mean()),
                f"{measured:.4f}",
                f"{deviation:.4f}",
                f"{100 * (measured / deviation - 1):+.1f} %",
            ]
        )
    page.table(["Image", "Mean", "Standard deviation", "Theory", "Difference"], rows)
    page.text(
        f"""The paper assumes that the M streamlines through a pixel are independent, and multiplies
        by √M. But they cross at that pixel and share the noise around it. In white noise, which the
        paper uses, they share enough to make √M too large. Here, variations broader than
        {LOOK.high_pass:.0f} pixels are first removed from the noise, and the streamlines share
        little. The next table is for gray pictures of constant fields. It lists the factor, and the
        ratio of the standard deviation after correction to the theoretical one of a single member
        image (mean of {SEEDS} noise patterns)."""
    )
    rows = []
    for degree in range(2, 8):
        count = degree if degree % 2 else degree // 2
        row = [degree, count, float(np.sqrt(count))]
        for high_pass in (LOOK.high_pass, 0.0):
            row += _corrected(degree, LOOK.with_settings({"hue": "one", "high_pass": high_pass}))
        rows.append(row)
    page.table(
        [
            "N",
            "Images M",
            "√M",
            "Factor",
            "Deviation",
            "Factor, white noise",
            "Deviation, white noise",
        ],
        rows,
    )
    page.write("Figure 6")


def _corrected(degree: int, look: Look) -> list[float]:
    """Return the correction factor, and the corrected deviation relative to one member image."""
    deviations = []
    for seed in range(SEEDS):
        seeded = look.with_settings({"seed": seed})
        tone = compose_field(constant(MEMBER, degree), degree, FIELD_SIZE, seeded).layer.tone
        deviations.append(float(_cut(tone).std()))
    factor = float(
        blend_gain(
            degree if degree % 2 else degree // 2,
            np.float32([2 * look.length + 1]),
            pixel_look(look),
        )[0]
    )
    return [factor, float(np.mean(deviations)) / expected_std(pixel_look(look))]


def _cut(image: np.ndarray) -> np.ndarray:
    """Return the (SIZE, SIZE, K) center of a picture."""
    margin = (FIELD_SIZE - SIZE) // 2
    channels = np.stack([channel(image, FIELD_SIZE, k) for k in range(image.shape[1])], axis=-1)
    return channels[margin : margin + SIZE, margin : margin + SIZE]


def _histogram(red: np.ndarray, deviation: float) -> Panel:
    figure = Figure(layout="constrained")
    axes = figure.subplots()
    axes.hist(np.clip(red.ravel(), *RANGE), bins=100, range=RANGE, density=True, color="#d98880")
    value = np.linspace(*RANGE, 500)
    normal = np.exp(-0.5 * ((value - NOISE_MEAN) / deviation) ** 2) / (
        deviation * np.sqrt(2 * np.pi)
    )
    axes.plot(value, normal, color="#333333", linewidth=1)
    axes.set_xlim(*RANGE)
    axes.set_ylim(0, 11)
    axes.set_yticks([])
    axes.tick_params(labelsize=8, colors="#444444")
    axes.spines[["top", "right", "left"]].set_visible(False)
    label = f"mean {red.mean():.3f}, deviation {red.std():.4f}"
    return Panel(chart(figure, SIZE, 100), label)
