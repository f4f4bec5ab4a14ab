"""Encode videos with the program ffmpeg."""

import shutil
from pathlib import Path

from ..rendering.turntable import Encoder
from ..worker.program import run_encoder


def find_encoder() -> Encoder | None:
    """Return the encoder of .mp4 files, or None if ffmpeg is not installed.

    The encoder uses the program on the PATH, or else the one in the Python package imageio-ffmpeg.
    """
    program = shutil.which("ffmpeg")
    if program is None:
        try:
            from imageio_ffmpeg import get_ffmpeg_exe

            program = get_ffmpeg_exe()
        except (ImportError, RuntimeError):  # no package, or it has no program for this system
            return None

    def encode(folder: Path, count: int, size: tuple[int, int], fps: float, path: Path) -> None:
        """Encode the pictures in a folder; see `Encoder`."""
        pictures = f"{folder}/".replace("%", "%%") + "%05d.png"
        command = [
            program, "-v", "error", "-y", "-framerate", f"{fps:g}", "-i", pictures,
            "-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p", str(path),
        ]  # fmt: skip
        run_encoder(command, "ffmpeg")

    return encode
