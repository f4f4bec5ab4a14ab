"""Contrast correction of LIC images, with factors from theory instead of image analysis.

The paper is Palacios and Zhang, IEEE TVCG 2011 (see `compositor`). P is the number of pixels, K the number of
noise channels.
"""

import numpy as np

from .filter_kernel import full_sample_count
from .image_noise import NOISE_MEAN, streak_moments
from .look_units import PixelLook


def normalize_variance(
    mean: np.ndarray, effective_samples: np.ndarray, look: PixelLook
) -> np.ndarray:
    """Scale averages over streamlines that ended early to the variance of full streamlines.

    If full streamlines have m samples, the mean of n samples has m / n times their variance. Without this
    correction, contrast is too high at borders and around zeros of the field. Means over less than
    two cells of the noise fade to gray, because they would look like dots, not streaks.

    Parameters
    ----------
    mean : (P, K) float32 ndarray
        Mean noise along each streamline.
    effective_samples : (P,) float32 ndarray
        Effective samples of each streamline (`filter_kernel.KernelWeights`), n above; at least 1.
    look : PixelLook
        Its `length`, `line_width` and kernel are used.

    Returns
    -------
    (P, K) float32 ndarray
    """
    full_samples = np.float32(full_sample_count(look.length, look.kernel))
    cells = effective_samples * np.float32(1 / look.line_width)
    factor = np.sqrt(effective_samples / full_samples) * np.minimum(cells / 2, 1)
    return NOISE_MEAN + (mean - NOISE_MEAN) * factor[:, None]


def blend_gain(image_count: int, effective_samples: np.ndarray, look: PixelLook) -> np.ndarray:
    """Compute the factor that gives the mean of M member images the standard deviation of one.

    It is about sqrt(M). Equation 6 of the paper assumes that the M values at a pixel are
    independent. But all M streamlines cross at the pixel and share the noise around it. The
    variance of the mean is that of one image times (1 + r) / M, where r is the sum of the
    correlations of one streamline with the others (`image_noise.streak_moments`). For N = 7 and the
    default length, sqrt(M) alone is 10 percent too high. Correlations grow as streamlines get
    shorter.

    Parameters
    ----------
    image_count : int
        M.
    effective_samples : (P,) float32 ndarray
        Effective samples of a streamline (`KernelWeights`), mean over the M streamlines through a pixel.
    look : PixelLook
        Its `length`, `line_width`, `high_pass` and kernel are used.

    Returns
    -------
    (P,) float32 ndarray
        sqrt(M / (1 + r)), from 1 to sqrt(M).
    """
    _, correlation_sum = streak_moments(*streak_args(look), image_count, kernel=look.kernel)
    correlation = correlation_sum * full_sample_count(look.length, look.kernel) / effective_samples
    pixel_correlation = np.clip(correlation, 0, image_count - 1)
    return np.sqrt(image_count / (1 + pixel_correlation)).astype(np.float32)


def supersampling_gain(look: PixelLook) -> float:
    """Compute the contrast gain that makes supersampled streaks as strong as streaks without supersampling.

    Parameters
    ----------
    look : PixelLook
        The look in pixels of the supersampled frame.
    """
    subpixels = look.supersampling
    supersampled_args = streak_args(look)
    supersampled_std, _ = streak_moments(*supersampled_args, average=subpixels, kernel=look.kernel)
    direct_args = (length / subpixels for length in supersampled_args)
    direct_std, _ = streak_moments(*direct_args, kernel=look.kernel)
    return direct_std / supersampled_std


def expected_std(look: PixelLook) -> float:
    """Compute the theoretical standard deviation of the LIC image of one member of the field.

    Streamlines are assumed to have their full length. The result is in display values, like the noise.
    """
    return streak_moments(*streak_args(look), kernel=look.kernel)[0]


def streak_args(look: PixelLook) -> tuple[float, float, float]:
    """Return the length of streamlines, and the cell size and high-pass width of the noise.

    They are in pixels of the frame. The length includes both directions and the pixel itself.
    """
    return 2 * look.length + 1, look.line_width, look.high_pass


def scale_contrast(tone: np.ndarray, gain: np.ndarray | float) -> np.ndarray:
    """Scale the difference of tones from the mean of the noise by `gain` (equation 6 of the paper)."""
    return NOISE_MEAN + gain * (tone - NOISE_MEAN)
