"""`figure`: pictures, keys and text are what and where they should be, also in the files."""

import io
import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
import pyvista as pv
from matplotlib.figure import Figure
from PIL import Image

import rosy_addon as rf
from rosy_addon.core.color import from_hex
from rosy_addon.projection.camera import orbit_camera

#: Small and fast.
SMALL = {"dpi": 60, "supersampling": 1}

ROOT = Path(__file__).resolve().parents[2]

#: Settings that a matplotlibrc may have. LaTeX is not installed.
USER_SETTINGS = {"font.family": "serif", "lines.linewidth": 5, "text.usetex": True, "font.size": 30}


@pytest.fixture(scope="module")
def surface():
    mesh = pv.Icosphere(nsub=3, radius=2.5)
    return rf.Surface(mesh.points, mesh.faces.reshape(-1, 4)[:, 1:], name="ball")


@pytest.fixture(scope="module")
def fields(surface):
    smoothest = rf.smoothest(surface)
    return {"Ours": smoothest, "Turned & moved": smoothest.rotated(0.3)}


def panels_of(figure: Figure):
    """The axes with pictures."""
    return [axes for axes in figure.axes if axes.images]


def texts_of(figure: Figure):
    return [text.get_text() for text in figure.texts]


def test_panels_fill_the_width_on_whole_pixels(fields):
    figure = rf.figure(fields, width=5.0, **SMALL)
    first, second = panels_of(figure)
    size = figure.get_size_inches() * 60
    for axes in (first, second):
        place = axes.get_position()
        corners = np.array([place.x0, place.y0, place.x1, place.y1]) * np.tile(size, 2)
        assert np.allclose(corners, np.rint(corners), atol=1e-6)
        height, width = axes.images[0].get_array().shape[:2]
        assert np.allclose(corners[2:] - corners[:2], (width, height))
    assert texts_of(figure)[:2] == ["(a) Ours", "(b) Turned & moved"]


def test_pictures_have_one_camera_and_one_range(surface):
    """The magnitude of one field is twice that of the other: both get the color map of the larger one."""
    one = rf.along_axis(surface, (0, 0, 1), degree=2).with_magnitude("unit")
    fields = {"one": one, "two": one.with_magnitude(2.0)}
    look = {"hue": "magnitude", "color_map": "gray", "gain": 0, "shading": 0}
    figure = rf.figure(fields, singularity_dots="none", color_label="speed (m/s)", **look, **SMALL)
    bar = next(axes for axes in figure.axes if axes.get_ylabel() == "speed (m/s)")
    assert bar.get_ylim() == (0, 2)
    first, second = (axes.images[0].get_array() for axes in panels_of(figure))
    assert np.array_equal(first[..., 3], second[..., 3])
    inside = first[..., 3] == 255
    ends = np.array([from_hex("#111111")[0], 1.0]) * 255
    assert abs(np.median(np.asarray(first)[inside, 0]) - ends.mean()) < 2
    assert abs(np.median(np.asarray(second)[inside, 0]) - ends[1]) < 2


def test_numbers_as_colors(surface, error_of):
    """The height over two fields, of which one has half of it: one range, whose name is the label."""
    one, height = rf.form(surface), surface.vertices[:, 2]
    figure = rf.figure([one, one], color_values=[height, height / 2], color_map="magma", **SMALL)
    bar = next(axes for axes in figure.axes if not axes.images and axes.axison)
    assert np.allclose(bar.get_ylim(), (-2.5, 2.5)) and bar.get_ylabel() == ""
    assert "1 array for 2 fields" in error_of(rf.figure, [one, one], color_values=[height], **SMALL)


def test_dots_are_at_the_singularities(fields, surface):
    """Projected by hand: the camera looks along y, and x is to the right."""
    figure = rf.figure(fields["Ours"], view=(0, 0), **SMALL)
    (axes,) = panels_of(figure)
    height, width = axes.images[0].get_array().shape[:2]
    camera = orbit_camera(surface.vertices, 0, 0, width, height, perspective=False, margin=0.02)
    drawn = np.asarray(axes.collections[0].get_offsets())
    points = surface.vertices[fields["Ours"].singularities.vertex]
    place = points[:, [0, 2]] * camera.pixels_per_unit + (width / 2, height / 2)
    is_drawn = np.linalg.norm(drawn[:, None] - place, axis=2).min(axis=0) < 0.5
    is_front = points[:, 1] < 1e-9  # or on the silhouette
    assert is_drawn[is_front].all() and len(drawn) == is_front.sum() > 2
    assert "index +1/4" in texts_of(figure)


def test_very_many_dots_are_small(surface):
    """A field of random directions has a singularity at every other vertex."""
    angle = 2 * np.pi * np.random.default_rng(0).random(surface.face_count)
    noise = rf.from_angles(surface, angle, degree=4)
    figure = rf.figure(noise, singularity_size=40.0, **SMALL)
    (axes,) = panels_of(figure)
    dots = axes.collections[0]
    size = np.sqrt(dots.get_sizes()) * 60 / 72  # pixels
    height, width = axes.images[0].get_array().shape[:2]
    assert len(size) > 100 and (np.pi / 4 * size**2).sum() < 0.12 * width * height


def test_differences(fields):
    """A field that is turned by 0.3: one color, the angle in the note, rings around dots."""
    look = {"gain": 0, "shading": 0, **SMALL}
    parts = ("differences",)
    for lines in ("other", "first", "both"):
        figure = rf.figure(fields, parts=parts, lines=lines, largest_angle=40, **look)
        (axes,) = panels_of(figure)
        picture = axes.images[0].get_array()
        colors = picture[picture[..., 3] == 255][:, :3].astype(int)
        assert np.ptp(colors, axis=0).max() <= 1
        bar = next(axes for axes in figure.axes if axes.get_ylabel() == "angle (degrees)")
        mappable = bar._colorbar.mappable
        expected = np.array(mappable.to_rgba(np.degrees(0.3))[:3]) * 255
        assert np.abs(colors.mean(axis=0) - expected).max() < 3
    assert any(text.startswith("mean 17.2°, 95 % 17.2°") for text in texts_of(figure))
    rings, dots = axes.collections
    assert (rings.get_facecolors()[:, 3] == 0).all() and (dots.get_facecolors()[:, 3] == 1).all()
    assert np.array_equal(rings.get_offsets(), dots.get_offsets()) and len(dots.get_offsets()) > 2
    assert (rings.get_sizes() > dots.get_sizes()).all()


def test_a_table_and_a_caption(fields):
    figure = rf.figure(fields, parts=("table",), caption="Two fields. " * 20, dpi=60)
    texts = texts_of(figure)
    assert not figure.axes and "energy" in texts and "17.2" in texts
    assert sum(text.count("Two fields.") for text in texts) >= 19  # the caption is in several lines
    height = figure.get_size_inches()[1]
    for text in figure.texts:
        box = text.get_window_extent().transformed(figure.dpi_scale_trans.inverted())
        assert box.x0 > -0.02 and box.x1 < 7.02 and box.y0 > -0.02 and box.y1 < height + 0.02


def test_the_scale_bar_has_a_round_length(fields, surface, error_of):
    """The ball has a diameter of 5: its picture is 96 % of the panel."""
    figure = rf.figure(fields["Ours"], scale_bar="mm", singularity_dots="none", **SMALL)
    (axes,) = panels_of(figure)
    (line,) = axes.lines
    width = axes.images[0].get_array().shape[1]
    assert axes.texts[0].get_text() == "1 mm"
    assert np.isclose(np.ptp(line.get_xdata()), 0.96 * width / 5, rtol=0.01)
    assert "orthographic" in error_of(rf.figure, fields["Ours"], scale_bar="mm", orthographic=False)


def test_files(fields, tmp_path, error_of):
    """Fonts are embedded as TrueType, text is text, pages are pages, and bytes are the same again."""
    pages = [rf.figure(fields, **SMALL), rf.figure(fields, parts=("differences", "table"), **SMALL)]
    for name in ("a.pdf", "b.pdf"):
        rf.save_figures(tmp_path / name, pages)
    pdf = (tmp_path / "a.pdf").read_bytes()
    assert pdf == (tmp_path / "b.pdf").read_bytes()
    assert len(re.findall(rb"/Type /Page\b", pdf)) == 2
    assert b"/FontFile2" in pdf and b"/Type3" not in pdf
    rf.save_figures(tmp_path / "a.svg", pages[0])
    assert {"(b) Turned & moved", "index +1/4"} <= set(svg_texts(tmp_path / "a.svg"))
    rf.save_figures(tmp_path / "a.png", pages[0])
    with Image.open(tmp_path / "a.png") as image:
        size = pages[0].get_size_inches() * 60
        assert np.allclose(image.size, size, atol=1)
        picture = np.asarray(image.convert("RGBA"))
    panel = panels_of(pages[0])[0]
    own = panel.images[0].get_array()
    top = round((1 - panel.get_position().y1) * size[1])
    shown = picture[top : top + own.shape[0], : own.shape[1]]
    solid = own[..., 3] == 255
    off = np.abs(shown[..., :3].astype(int) - own[..., :3]).max(axis=2)[solid]
    assert np.mean(off > 0) < 0.1  # dots are drawn over it
    assert "only a .pdf can hold 2 figures" in error_of(rf.save_figures, tmp_path / "a.svg", pages)
    assert ".pdf, .svg, .png" in error_of(rf.save_figures, tmp_path / "a.jpg", pages[0])


def svg_texts(path):
    """The texts of an .svg file."""
    nodes = ElementTree.parse(path).getroot().iter("{http://www.w3.org/2000/svg}text")
    return ["".join(node.itertext()).strip() for node in nodes]


@pytest.mark.parametrize("suffix", ["pdf", "svg", "png"])
def test_settings_of_matplotlib_change_nothing(fields, tmp_path, suffix):
    """A figure is drawn and written with the defaults, also by `savefig`, and the settings stay."""
    parts = {"parts": ("fields", "differences", "table"), "scale_bar": "mm", **SMALL}
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {}}[suffix]
    files = [tmp_path / f"{name}.{suffix}" for name in ("default", "user", "saved")]
    rf.save_figures(files[0], rf.figure(fields, **parts))
    with matplotlib.rc_context(USER_SETTINGS | {"savefig.facecolor": "red"}):
        figure = rf.figure(fields, **parts)
        rf.save_figures(files[1], figure)
        figure.savefig(files[2], metadata=metadata)
        assert matplotlib.rcParams["font.size"] == 30
    default, user, saved = (file.read_bytes() for file in files)
    assert default == user == saved


def test_a_matplotlibrc_of_the_folder_is_not_read(tmp_path, surface):
    """Its bytes are not even text; the file that the environment names has settings."""
    folder = tmp_path / "from a stranger"
    folder.mkdir()
    pv.PolyData.from_regular_faces(surface.vertices, surface.faces).save(folder / "ball.ply")
    (folder / "matplotlibrc").write_bytes(b"\xff\xfe")
    rows = [f"{name}: {value}" for name, value in USER_SETTINGS.items()]
    (tmp_path / "rc").write_text("\n".join(rows))
    words = ["compare", "ball.ply", "form", "-o", "a.svg", "--dpi", "50"]
    command = [sys.executable, "-m", "rosy_addon", *words]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "MATPLOTLIBRC": str(tmp_path / "rc")}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"DejaVu Sans" in (folder / "a.svg").read_bytes()


def test_titles_may_have_any_characters(fields, tmp_path):
    """Names of files may have bytes that are no text, and control characters, which XML cannot hold."""
    titles = "a\udcff", "b\x01\x1b[31m", "c\u202e\ufeff\ufffe", "two\nlines\t", "&<>\"'\u2028"
    titled = dict.fromkeys(titles, fields["Ours"])
    parts = {"parts": ("fields", "differences", "table"), "caption": f"{titles[1]}\n{titles[0]}"}
    figure = rf.figure(titled, scale_bar="\x02", color_label="\x03", **parts, **SMALL)
    rf.save_figures(tmp_path / "a.svg", figure)
    texts = svg_texts(tmp_path / "a.svg")
    for text in ("a\\udcff", "b\\x01\\x1b[31m", "c\\u202e\\ufeff\\ufffe", "two\\nlines\\t"):
        assert text in texts, text  # of the table
        assert any(f") {text} vs. " in title or title.endswith(f") {text}") for title in texts)
    rf.save_figures(tmp_path / "a.pdf", figure)
    rf.save_figures(tmp_path / "a.png", figure)


def test_letters_without_a_glyph_are_named(fields, tmp_path, recwarn, capfd):
    """Boxes are drawn for them, except by the viewer of an .svg outside of formulas."""
    one, other = fields.values()
    rf.save_figures(tmp_path / "a.svg", rf.figure({"\u65e5\u672c": one, "b": other}, **SMALL))
    assert not recwarn.list and "(a) \u65e5\u672c" in svg_texts(tmp_path / "a.svg")
    figure = rf.figure({"\u65e5\u672c": one, "$\u8a9e$": other}, **SMALL)
    every = "\u65e5\u672c\u8a9e"
    for name, letters in (("a.svg", "\u8a9e"), ("a.pdf", every), ("a.png", every)):
        for write in (rf.save_figures, lambda path, page: page.savefig(path)):
            with pytest.warns(rf.RosyWarning, match=f"no glyph for {letters}: write an") as warned:
                write(tmp_path / name, figure)
            assert len(warned) == 1
    assert capfd.readouterr().err == ""  # matplotlib would say it in its own words


def test_a_notebook_shows_a_figure(fields):
    picture = rf.figure(fields["Ours"], **SMALL)._repr_png_()
    with Image.open(io.BytesIO(picture)) as image:
        assert image.width == 420


def test_formulas(fields, tmp_path, error_of):
    figure = rf.figure(fields, parts=("table",), caption=r"$\frac{1}{$", dpi=60)
    message = error_of(rf.save_figures, tmp_path / "a.svg", figure)
    assert "is not a formula" in message and not list(tmp_path.iterdir())
    figure = rf.figure(fields, parts=("table",), caption=r"$\frac{1}{2}$ for 3 \$", dpi=60)
    rf.save_figures(tmp_path / "a.svg", figure)


def test_the_date_of_a_font_is_not_reported(fields, tmp_path, caplog):
    """A .pdf embeds matplotlib's font for primes, whose date fontTools doubts."""
    figure = rf.figure(fields, parts=("table",), caption="$x'$", dpi=60)
    rf.save_figures(tmp_path / "a.pdf", figure)
    assert not caplog.records


def test_what_a_figure_refuses(fields, error_of):
    other = rf.Surface(pv.Icosphere(nsub=1))
    for arguments, message in (
        ({"parts": ("legend",)}, "choose fields, differences, table"),
        ({"parts": ()}, "needs parts"),
        ({"lines": "none"}, "choose other, first, both"),
        ({"dpi": 3}, "from 10 to 2400"),
        ({"width": float("nan")}, "from 0.5 to 100"),
        ({"gian": 3}, "unknown setting 'gian'"),
        ({"width": 0.5, "columns": 100}, "0.5 inches has no room for 100 columns of panels"),
    ):
        assert message in error_of(rf.figure, fields, **arguments)
    mixed = [fields["Ours"], rf.form(other)]
    assert "no other field" in error_of(rf.figure, mixed, parts="differences")
    assert len(panels_of(rf.figure(mixed, **SMALL))) == 2
    tiny = rf.figure(fields, parts=("table",), width=1, dpi=10)
    assert "smaller than a pixel" in error_of(rf.save_figures, "a.png", tiny)


def test_the_command(tmp_path, rosy, fields, surface):
    pv.PolyData.from_regular_faces(surface.vertices, surface.faces).save(tmp_path / "ball.ply")
    words = ("compare", tmp_path / "ball.ply", "Ours=smoothest", "form", "--dpi", 50)
    options = "-o", tmp_path / "a.pdf", "--caption", "A ball", "--degree", 2
    status, output, errors = rosy(*words, *options)
    assert (status, errors) == (0, "") and "Ours" in output
    assert len(re.findall(rb"/Type /Page\b", (tmp_path / "a.pdf").read_bytes())) == 2
    assert rosy(*words, "-o", tmp_path / "a.png", "--set", "supersampling=1")[0] == 0
    with Image.open(io.BytesIO((tmp_path / "a.png").read_bytes())) as image:
        assert image.width == 350
