"""Check the built site: `python tools/site/check.py dist/site`.

- Pictures have alternative text.
- Links inside the site lead to files and anchors that exist.
- Nothing is loaded from elsewhere.
- The reference has all public names of the package.
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
    """What a page contains.

    Attributes
    ----------
    anchors : set of str
    links, loaded : list of str
        Addresses to follow, and those loaded with the page.
    problems : list of str
    """

    def __init__(self, html: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.problems: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect the anchors and addresses of a tag."""
        values = {name: value or "" for name, value in attrs}
        self.anchors.update(values[name] for name in ("id", "name") if name in values)
        if tag == "img" and not values.get("alt", "").strip():
            self.problems.append(f"no alternative text: {values.get('src', '')[:80]}")
        for name in DORMANT_CLASSES & set(values.get("class", "").split()):
            self.problems.append(f"the theme loads scripts from elsewhere for the class {name}")
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
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
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    for path, page in pages.items():
        place = path.relative_to(site)
        yield from (f"{place}: {problem}" for problem in page.problems)
        for address in page.loaded:
            if _is_elsewhere(address):
                yield f"{place}: loads {address}"
            elif not address.startswith("data:") and not _target(site, path, address).is_file():
                yield f"{place}: {address} does not exist"
        for address in page.links:
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                continue
            target = _target(site, path, parts.path) if parts.path else path
            if not target.is_file():
                yield f"{place}: dead link {address}"
            elif (
                parts.fragment
                and target in pages
                and unquote(parts.fragment) not in pages[target].anchors
            ):
                yield f"{place}: dead anchor {address}"
    for path in sorted([*site.rglob("*.css"), *site.rglob("*.js")]):
        if path.name.startswith("search_index"):
            continue
        text = re.sub(r"/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        if path.suffix == ".css":
            found = re.findall(r"(?:url\(|@import)\s*[\"']?((?:https?:)?//[^\"')\s]+)", text)
        else:
            found = re.findall(r"https?://[^\s\"'`)]+", text)
            found = [address for address in found if not DORMANT_IN_SCRIPTS.match(address)]
        yield from (f"{path.relative_to(site)}: loads {address}" for address in sorted(set(found)))
    reference = pages.get(site / "api.html")
    for name in names or ():
        if reference is None or f"rosyfields.{name}" not in reference.anchors:
            yield f"api.html: no rosyfields.{name}: add it to docs/api.md"


def _is_elsewhere(address: str) -> bool:
    return address.startswith("//") or urlsplit(address).scheme in ("http", "https")


def _target(site: Path, page: Path, address: str) -> Path:
    """Return the file of an address on a page."""
    path = unquote(urlsplit(address).path)
    target = site / path.lstrip("/") if path.startswith("/") else page.parent / path
    target = target.resolve()
    return target / "index.html" if target.is_dir() else target


def main() -> int:
    """Print what is wrong with the site; the exit status is 1 if anything is."""
    import rosyfields

    site = Path(sys.argv[1]).resolve()
    found = list(problems(site, rosyfields.__all__))
    print("\n".join(found) or f"{site}: pictures, links and addresses are in order")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
