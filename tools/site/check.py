"""Check the built site of the documentation: `python tools/site/check.py dist/site`.

Three things are checked:

- Pictures have alternative text.
- Pages load only files of the site, and these files exist.
- The reference describes all public names of the package.

Links and anchors are checked by `mkdocs build --strict`.
"""

import re
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

#: Attributes of tags with an address that is loaded with the page. The address of a `link` tag is loaded only
#: for the relations below.
LOADED = {"src", "srcset", "poster", "data", "background"}
LOADED_RELATIONS = {"stylesheet", "icon", "preload", "modulepreload", "preconnect", "dns-prefetch"}

#: Addresses in the scripts of the theme that are allowed: some are only names, others are loaded only for
#: pages with a diagram or a repository, or in old browsers.
DORMANT_IN_SCRIPTS = re.compile(
    r"http://www\.w3\.org/|https://(clipboardjs\.com|unpkg\.com/(mermaid|resize-observer-polyfill)"
    r"|api\.github\.com|bit\.ly/2s3ChXG|\$\{e\}/api/v4|github\.com/squidfunk|squidfunk\.github\.io)"
)

#: Classes of tags for which the theme would load these addresses. No page may have them.
DORMANT_CLASSES = {"mermaid", "md-source"}


class Page(HTMLParser):
    """A parser that collects the anchors of a page, the addresses that it loads, and its problems."""

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
        Names that the page api.html must describe. By default they are not checked.
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
    """Return the addresses outside the site that a style sheet or a script may load."""
    text = re.sub(r"/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    if path.suffix == ".css":
        return re.findall(r"(?:url\(|@import)\s*[\"']?((?:https?:)?//[^\"')\s]+)", text)
    found = re.findall(r"https?://[^\s\"'`)]+", text)
    return [address for address in found if not DORMANT_IN_SCRIPTS.match(address)]


def main() -> int:
    """Print what is wrong with the site. The exit status is 1 if anything is wrong."""
    import rosyfields

    site = Path(sys.argv[1]).resolve()
    found = list(problems(site, rosyfields.__all__))
    print("\n".join(found) or f"{site}: pictures and addresses are in order")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
