"""Hook of MkDocs: give pictures a link to the file, and their size, so that pages do not jump."""

import contextlib
import io
import posixpath
import re

from PIL import Image, UnidentifiedImageError

_IMAGE = re.compile(
    r'(?P<link><a\b[^>]*>\s*)?<img (?P<attributes>[^>]*?src="(?P<source>[^"]+)"[^>]*?) ?/?>'
)


def on_page_content(html: str, *, page, config, files) -> str:
    """Add sizes and links to the pictures of a page. Pictures that are links already keep these."""

    def completed(match: re.Match[str]) -> str:
        source = match["source"]
        address = posixpath.normpath(posixpath.join(posixpath.dirname(page.file.dest_uri), source))
        file = next((file for file in files.media_files() if file.dest_uri == address), None)
        size = file and picture_size(file.content_bytes)
        attributes = match["attributes"]
        if size:
            attributes += f' width="{size[0]}" height="{size[1]}" loading="lazy"'
        image = f"<img {attributes}>"
        if match["link"]:
            return match["link"] + image
        return f'<a class="picture" href="{source}">{image}</a>'

    return _IMAGE.sub(completed, html)


def picture_size(content: bytes) -> tuple[int, int] | None:
    """Return the width and height in pixels of a picture file; None for other files, such as .svg."""
    with contextlib.suppress(UnidentifiedImageError), Image.open(io.BytesIO(content)) as picture:
        return picture.size
    return None
