"""Check the built site: `python tools/site/check.py dist/site`.

- Pictures have alternative text.
- Nothing is loaded from elsewhere, and what is loaded exists.
- The reference has all public names of the package.

Links and anchors are checked by `mkdocs build --strict`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

#: Attributes whose address is loaded with a page. That of `link` is only for these relations.
LOADED = {"src", "srcset", "poster", "data", "background"}
LOADED_RELATIONS = {"stylesheet", "icon", "preload", "modulepreload", "preconnect", "dns-prefetch"}

#: Addresses in the scripts of the theme: names, and what it loads only for pages with a diagram, with
#: a repository or in old browsers.
DORMANT_IN_SCRIPTS = re.compile(
    r"http://www\.w3\.org/|https://(clipboardjs\.com|unpkg\.com/(mermaid|resize-observer-polyfill)"
    r"|api\.github\.com|bit\.ly/2s3ChXG|\$\{e\}/api/v4|github\.com/squidfunk|squidfunk\.github\.io)"
)

#: What makes the theme load them.
DORMANT_CLASSES = {"mermaid", "md-source"}


class Page(HTMLParser):
    """The anchors of a page, the addresses that are loaded with it, and its problems."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.loaded: list[str] = []
        self.problems: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect the anchors and addresses of a tag."""
        values = {name: value or "" for name, value in attrs}
        self.anchors.add(values.get("id", ""))
        if tag == "img" and not values.get("alt", "").strip():
            self.problems.append(f"no alternative text: {values.get('src', '')[:80]}")
        for name in DORMANT_CLASSES & set(values.get("class", "").split()):
            self.problems.append(f"the theme loads scripts from elsewhere for the class {name}")
        if tag == "link" and LOADED_RELATIONS & set(values.get("rel", "").split()):
            self.loaded.append(values["href"])
        self.loaded += [values[name] for name in LOADED if name in values]


def problems(site: Path, names: list[str] | None = None) -> Iterator[str]:
    """Yield what is wrong with a site, one line each.

    Parameters
    ----------
    site : Path
    names : list of str, optional
        Names that api.html must describe.
    """
    anchors: set[str] = set()
    for path in sorted(site.rglob("*.html")):
        page, place = Page(path.read_text(encoding="utf-8")), path.relative_to(site)
        anchors |= page.anchors if place == Path("api.html") else set()
        yield from (f"{place}: {problem}" for problem in page.problems)
        for address in page.loaded:
            local = unquote(urlsplit(address).path)
            file = site / local.lstrip("/") if local.startswith("/") else path.parent / local
            if address.startswith("//") or urlsplit(address).scheme in ("http", "https"):
                yield f"{place}: loads {address}"
            elif not address.startswith("data:") and not file.is_file():
                yield f"{place}: {address} does not exist"
    for path in sorted([*site.rglob("*.css"), *site.rglob("*.js")]):
        if not path.name.startswith("search_index"):
            for address in sorted(set(_addresses(path))):
                yield f"{path.relative_to(site)}: loads {address}"
    for name in names or ():
        if f"rosyfields.{name}" not in anchors:
            yield f"api.html: no rosyfields.{name}: add it to docs/api.md"


def _addresses(path: Path) -> list[str]:
    """Return what a style sheet or a script loads from elsewhere."""
    text = re.sub(r"/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    if path.suffix == ".css":
        return re.findall(r"(?:url\(|@import)\s*[\"']?((?:https?:)?//[^\"')\s]+)", text)
    found = re.findall(r"https?://[^\s\"'`)]+", text)
    return [address for address in found if not DORMANT_IN_SCRIPTS.match(address)]


def main() -> int:
    """Print what is wrong with the site; the exit status is 1 if anything is."""
    import rosyfields

    site = Path(sys.argv[1]).resolve()
    found = list(problems(site, rosyfields.__all__))
    print("\n".join(found) or f"{site}: pictures and addresses are in order")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
