"""Draw figure 6: how blending reduces contrast, and how that is corrected."""

import numpy as np
from matplotlib.figure import Figure

from rosy_addon.compositor.contrast import blend_gain, expected_std, scale_contrast
from rosy_addon.compositor.image_noise import NOISE_MEAN
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look

from .looks import MEASURED
from .page import fill_tables, picture
from .plane import PlanarField, channel, compose_field
from .sheet import Panel, chart, gray

DEGREE, SIZE, FIELD_SIZE = 6, 256, 400

#: Look of the pictures, and look of the measurements for several degrees.
LOOK, GRAY_LOOK = MEASURED.with_settings({"hue": "noise"}), MEASURED

EXPANDED, SEEDS = 2.5, 6
MEMBER = np.radians(12)


def constant(angle: float, degree: int) -> PlanarField:
    """Return a constant field with a member at an angle, in radians."""
    return lambda p: np.full(p.shape, np.exp(1j * degree * angle))


def write() -> None:
    """Draw the pictures and measure the tables."""
    layer = compose_field(constant(MEMBER, DEGREE), DEGREE, FIELD_SIZE, LOOK).layer
    members, blend, expected = (
        layer.images.members,
        layer.images.blend,
        expected_std(pixel_look(LOOK)),
    )
    shown = [
        ("one member, I₀", members[0], expected),
        ("another one, I₁", members[1], expected),
        ("the third, I₂", members[2], expected),
        ("I, the mean of three", blend, expected / _gain(DEGREE, LOOK)),
        ("corrected", layer.tone, expected),
        (f"expanded {EXPANDED} times", scale_contrast(layer.tone, EXPANDED), expected * EXPANDED),
    ]
    pictures, histograms, rows = [], [], []
    for letter, (name, values, deviation) in zip("abcdef", shown, strict=True):
        image = _cut(values)
        pictures.append(Panel(gray(image), f"({letter}) {name}"))
        histograms.append(_histogram(image[..., 0], deviation))
        measured = float(image.std(axis=(0, 1)).mean())
        difference = f"{100 * (measured / deviation - 1):+.1f} %"
        rows.append([name, float(image.mean()), f"{measured:.4f}", f"{deviation:.4f}", difference])
    picture("figure-06-members", pictures[:3], histograms[:3])
    picture("figure-06-blended", pictures[3:], histograms[3:])
    fill_tables("figure-06", rows, [_corrected(degree) for degree in range(2, 8)])


def _gain(degree: int, look: Look) -> float:
    """Return the factor by which the contrast of the blend is corrected, for streamlines of full length."""
    count = degree if degree % 2 else degree // 2
    return float(blend_gain(count, np.float32([2 * look.length + 1]), pixel_look(look))[0])


def _corrected(degree: int) -> list[object]:
    """Return a table row of a degree: the factor and the deviation after correction, for two kinds of noise.

    The deviation is relative to that of the image of one member.
    """
    count = degree if degree % 2 else degree // 2
    row: list[object] = [degree, count, float(np.sqrt(count))]
    for high_pass in (GRAY_LOOK.high_pass, 0.0):
        look = GRAY_LOOK.with_settings({"high_pass": high_pass})
        deviations = []
        for seed in range(SEEDS):
            seeded = look.with_settings({"seed": seed})
            layer = compose_field(constant(MEMBER, degree), degree, FIELD_SIZE, seeded).layer
            deviations.append(float(_cut(layer.tone).std()))
        row += [_gain(degree, look), float(np.mean(deviations)) / expected_std(pixel_look(look))]
    return row


def _cut(image: np.ndarray) -> np.ndarray:
    """Return the central (SIZE, SIZE, K) pixels of a picture."""
    middle = slice((FIELD_SIZE - SIZE) // 2, (FIELD_SIZE + SIZE) // 2)
    channels = [channel(image, FIELD_SIZE, k)[middle, middle] for k in range(image.shape[1])]
    return np.stack(channels, axis=-1)


def _histogram(red: np.ndarray, deviation: float) -> Panel:
    """Draw the histogram of the red channel, with the normal distribution that theory predicts."""
    figure = Figure(layout="constrained")
    axes = figure.subplots()
    axes.hist(np.clip(red.ravel(), 0, 1), bins=100, range=(0, 1), density=True, color="#d98880")
    value = np.linspace(0.0, 1.0, 500)
    normal = np.exp(-0.5 * ((value - NOISE_MEAN) / deviation) ** 2)
    axes.plot(value, normal / (deviation * np.sqrt(2 * np.pi)), color="#333333", linewidth=1)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0, 11)
    axes.set_yticks([])
    axes.tick_params(labelsize=8, colors="#444444")
    axes.spines[["top", "right", "left"]].set_visible(False)
    label = f"mean {red.mean():.3f}, deviation {red.std():.4f}"
    return Panel(chart(figure, SIZE, 100), label)
