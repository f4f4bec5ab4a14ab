"""Estimate the memory that pictures need, find out how much is free, and refuse work that needs more."""

import ctypes
import os
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from .errors import RosyError

#: Memory in bytes of a process that draws, apart from its samples: Python with numpy in other processes, the
#: batch of streamlines of `compositor.fast_lic` (2 Mi steps of 24 bytes), and the noise from which
#: `compositor.streak_statistics` computes distributions.
PROCESS_BYTES = 120_000_000

#: Memory in bytes of each pixel of the finished picture: four float32 numbers.
PIXEL_BYTES = 16

#: Memory in bytes of each sample of the surface: 21 numbers of 4 bytes in the G-buffer (see
#: `projection.gbuffer.GBuffer`), and 6 in the field in the picture (see `compositor.pixel_field.PixelField`).
SAMPLE_BYTES = 27 * 4

#: Memory in bytes for each sample, line direction of the field and stored LIC image: 6 numbers of 4 bytes.
#: They are the next sample on the streamline, the noise, two running sums, their count and the image.
LINE_BYTES = 6 * 4

#: Number of images for each line direction if a look needs several: for the three channels of colored or
#: drifting noise, for the strokes, breaks and overshoot of hatching, or for the whole picture instead of a
#: strip of it.
MANY_IMAGES = 3

#: Memory in bytes of each triangle: three corners in clip space with four float64 numbers each.
TRIANGLE_BYTES = 3 * 4 * 8

#: Size in bytes of the array that `raise_mmap_threshold` frees. The GNU C library raises its threshold only
#: for freed blocks of up to 32 MiB.
MMAP_THRESHOLD_BYTES = 31 << 20


def raise_mmap_threshold() -> None:
    """Make the C library keep freed memory for the next arrays instead of unmapping it.

    While a frame is drawn, arrays are allocated and freed dozens of times. The operating system clears the
    pages of each new memory mapping, which takes a fifth of the time of a frame. The GNU C library uses a
    separate mapping for each block above a threshold. It raises this threshold to the size of the largest
    such block that was freed. So this function allocates and frees one large block, without writing to it. It
    has no effect with other C libraries.
    """
    np.empty(MMAP_THRESHOLD_BYTES, dtype=np.uint8)


def samples_memory(samples: float, lines: int, many_images: bool) -> float:
    """Return the memory, in bytes, that the samples of the surface in a picture or a texture need.

    Parameters
    ----------
    samples : float
        Number of samples.
    lines : int
        Number of line directions of the field at a point.
    many_images : bool
        Whether the look needs several LIC images for each line direction: `MANY_IMAGES` instead of one.
    """
    return samples * (SAMPLE_BYTES + LINE_BYTES * lines * (MANY_IMAGES if many_images else 1))


def check_memory(needed: float, subject: str, advice: str) -> None:
    """Check that there is enough memory for a piece of work. Call this before the work begins.

    Parameters
    ----------
    needed : float
        Estimate of the memory that the work needs, in bytes.
    subject : str
        The work, as named in the error message, such as "a picture of 800 x 600 pixels".
    advice : str
        Advice to the user at the end of the message, such as "choose a smaller size".

    Raises
    ------
    RosyError
        If more memory is needed than `available_memory`.
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
    """Return how many bytes of memory this process can still allocate, or None if that is not known.

    It is the smallest of several values: the free memory of the system with its swap space, and the remaining
    memory under the limits of control groups (containers) and of the address space. On macOS, which
    compresses and swaps on demand, the total memory is used as free memory. No exception is raised.
    """
    found = []
    for source in (_system_memory, _control_group_memory, _address_space):
        # The system may not have this source of information, or its format may differ from the expected one.
        with suppress(Exception):
            found += source()
    return max(min(found), 0) if found else None


def _system_memory() -> list[int]:
    """Return a list with the free memory of the operating system in bytes; empty if it is not known."""
    if sys.platform == "win32":
        # The structure MEMORYSTATUSEX: its size and the load, then seven amounts.
        status = (ctypes.c_uint64 * 8)(64)
        if ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status)):
            # The free memory with page files, and the free address space.
            return [min(status[4], status[6])]
        return []
    if sys.platform == "darwin":
        return [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")]
    lines = Path("/proc/meminfo").read_text().splitlines()
    kilobytes = {name: int(rest.split()[0]) for name, rest in (s.split(":") for s in lines)}
    return [(kilobytes["MemAvailable"] + kilobytes["SwapFree"]) * 1024]


def _control_group_memory(root: Path = Path("/")) -> list[int]:
    """Return the remaining memory, in bytes, under the limit of each control group of this process.

    The files of the group and of all groups that contain it are read, relative to the directory `root`. In a
    container, the path of the group may not exist. Then the files at the mount point are used.
    Memory that only caches files counts as free.
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
            # A group without a limit does not have the file, or has the text "max" in it.
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
    """Return a list with the remaining address space of this process in bytes; empty if it has no limit."""
    import resource  # not on Windows

    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return [] if limit == resource.RLIM_INFINITY else [limit - _used_address_space()]


def _used_address_space() -> int:
    """Return how many bytes of address space this process uses."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")


def limit_memory(count: int | None) -> None:
    """Let this process allocate at most some more bytes of memory; None removes an earlier limit.

    It has an effect only on Linux. Elsewhere, the address space of a process cannot be limited, or cannot be measured.
    """
    if sys.platform == "linux":
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_AS)
        limit = most if count is None else _used_address_space() + count
        if most != resource.RLIM_INFINITY:
            limit = min(limit, most)
        resource.setrlimit(resource.RLIMIT_AS, (limit, most))
