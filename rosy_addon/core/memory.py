"""Memory: a bound for pictures, what this process can still take, and refusal of what needs more."""

from __future__ import annotations

import ctypes
import os
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from .errors import RosyError

#: Bytes of a process that draws, without any sample: Python with numpy in other processes, the batch of
#: streamlines of `compositor.fast_lic` (2 Mi steps of 24 bytes), and the noise from which
#: `compositor.streak_statistics` takes its distributions.
PROCESS_BYTES = 120_000_000

#: Bytes of a pixel of the finished picture: four float32 numbers.
PIXEL_BYTES = 16

#: Bytes of a sample: 22 numbers of 4 bytes in the G-buffer (see `projection.gbuffer.GBuffer`), and 6 in
#: the field in the picture (see `compositor.pixel_field.PixelField`).
SAMPLE_BYTES = 28 * 4

#: Bytes of each line through a sample, for each image that is kept of it: 6 numbers of 4 bytes. They are
#: the next sample on the streamline, the noise, two running sums, their count and the image.
LINE_BYTES = 6 * 4

#: Images of a line if there are several: of the three channels of colored or drifting noise, of the
#: strokes, breaks and overshoot of hatching, or of the whole picture instead of a strip of it.
MANY_IMAGES = 3

#: Bytes of a triangle: three corners in clip space, of four float64 numbers each.
TRIANGLE_BYTES = 3 * 4 * 8

#: Size in bytes of the array that raises the threshold. The GNU C library raises the threshold for
#: freed blocks of up to 32 MiB only.
MMAP_THRESHOLD_BYTES = 31 << 20


def raise_mmap_threshold() -> None:
    """Make the C library keep freed memory for the next arrays instead of unmapping it.

    A frame allocates and frees its arrays dozens of times. The operating system clears the pages of
    each new mapping, which takes a fifth of the time of a frame. The GNU C library maps blocks
    above a threshold separately, and raises this threshold to the size of the largest such block
    that was freed. This function allocates and frees one large block, without writing to it. It has
    no effect with other C libraries.
    """
    np.empty(MMAP_THRESHOLD_BYTES, dtype=np.uint8)


def samples_memory(samples: float, lines: int, many_images: bool) -> float:
    """Return the bytes of samples on the surface, in a picture or a texture.

    Parameters
    ----------
    samples : float
    lines : int
        Lines of the field through a point.
    many_images : bool
        Whether the look keeps `MANY_IMAGES` of each line.
    """
    return samples * (SAMPLE_BYTES + LINE_BYTES * lines * (MANY_IMAGES if many_images else 1))


def check_memory(needed: float, subject: str, advice: str) -> None:
    """Check that a step can take the memory that it needs, before it takes any.

    Parameters
    ----------
    needed : float
        Bytes, from an estimate.
    subject : str
        What needs them, for the message, such as "a picture of 800 x 600 pixels".
    advice : str
        What the user can do instead, for the message.

    Raises
    ------
    RosyError
        If more is needed than `available_memory`.
    """
    free = available_memory()
    if free is not None and needed > free:
        raise RosyError(
            f"{subject} needs about {format_bytes(needed)} of memory, {format_bytes(free)} are "
            f"free: {advice}"
        )


def format_bytes(count: float) -> str:
    """Return a number of bytes as text, as in "850 MB", "9.1 GB" or "21 GB"."""
    if count < 0.9995e9:
        return f"{count / 1e6:.0f} MB"
    return f"{count / 1e9:.1f} GB" if count < 9.95e9 else f"{count / 1e9:,.0f} GB"


def available_memory() -> int | None:
    """Return how many bytes this process can still take. None if that is not known.

    It is the least of what the system has left, including its swap space, and of what the limits of
    control groups (containers) and of the address space leave. On macOS, which compresses and swaps
    on demand, it is the total memory. Never raises.
    """
    found = []
    for source in (_system_memory, _control_group_memory, _address_space):
        # A source that the system does not have, or that has another form than expected.
        with suppress(Exception):
            found += source()
    return max(min(found), 0) if found else None


def _system_memory() -> list[int]:
    """Return the bytes that the operating system has left."""
    if sys.platform == "win32":
        # The structure MEMORYSTATUSEX: its size and the load, then seven amounts.
        status = (ctypes.c_uint64 * 8)(64)
        if ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status)):
            # Of memory with page files, and of the address space.
            return [min(status[4], status[6])]
        return []
    if sys.platform == "darwin":
        return [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")]
    lines = Path("/proc/meminfo").read_text().splitlines()
    kilobytes = {name: int(rest.split()[0]) for name, rest in (s.split(":") for s in lines)}
    return [(kilobytes["MemAvailable"] + kilobytes["SwapFree"]) * 1024]


def _control_group_memory(root: Path = Path("/")) -> list[int]:
    """Return the bytes that each control group of this process leaves, under a root directory.

    Read the files of the group and of the groups that contain it. In a container, the path of the group
    may not exist; the files of the mount are then used.
    Memory that only caches files is free.
    """
    free = []
    for line in (root / "proc/self/cgroup").read_text().splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers == "":
            mount = root / "sys/fs/cgroup"
            limit_name, usage_name, cached_name = "memory.max", "memory.current", "inactive_file"
        elif "memory" in controllers.split(","):
            mount = root / "sys/fs/cgroup/memory"
            limit_name, usage_name = "memory.limit_in_bytes", "memory.usage_in_bytes"
            cached_name = "total_inactive_file"
        else:
            continue
        group = mount / path.lstrip("/")
        for folder in (group, *group.parents):
            # A group without a limit has no such file, or the limit "max".
            with suppress(OSError, ValueError):
                limit = int((folder / limit_name).read_text())
                used = int((folder / usage_name).read_text())
                counts = (folder / "memory.stat").read_text().split()
                cached = dict(zip(counts[::2], counts[1::2], strict=True)).get(cached_name, 0)
                free.append(limit - used + int(cached))
            if folder == mount:
                break
    return free


def _address_space() -> list[int]:
    """Return the bytes that the limit of the address space of this process leaves, if it has one."""
    import resource  # not on Windows

    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return []
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return [limit - pages * os.sysconf("SC_PAGE_SIZE")]
