"""Pages of HTML that need no other file: of a Markdown page, of a film; tables and pictures."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.token import Token

_STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, "DejaVu Sans", sans-serif; color: #1a1a1a; background: #fff;
  max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.25rem; border-bottom: 1px solid #ccc;
  padding-bottom: .2rem; margin-top: 2.2rem; } h3 { font-size: 1.05rem; }
blockquote { background: #fff3d6; border-left: 4px solid #e69f00; margin: 1em 0;
  padding: .1rem .8rem; }
h1 + p { font-size: 1.05rem; background: #f3f6f9; border-left: 4px solid #0072b2;
  padding: .7rem 1rem; }
.table { overflow-x: auto; } .table + .table { margin-top: 1rem; }
table { border-collapse: collapse; font-size: .82rem; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .55rem; border-bottom: 1px solid #ddd; white-space: nowrap; }
th { border-bottom: 1.5px solid #555; }
tbody tr:nth-child(even) { background: #f7f7f7; }
img { max-width: 100%; height: auto; display: block; margin: 1rem 0 0; }
img.narrow { width: 27rem; } img.wide { width: 55rem; }
pre { background: #f6f6f6; padding: .8rem; font-size: .8rem; overflow-x: auto;
  white-space: pre-wrap; }
@media print {
  @page { size: A4; margin: 16mm 14mm; }
  body { font-size: 10pt; max-width: none; margin: 0; padding: 0; }
  h2, h3 { break-after: avoid; }
  img { break-inside: avoid; break-after: avoid; }
  img.narrow { width: 85mm; } img.wide { width: 175mm; }
  table { font-size: 7.2pt; break-inside: auto; } tr { break-inside: avoid; }
  th, td { padding: .5mm 1.2mm; }
  .table { overflow: visible; }
}
"""
_PNG = b"\x89PNG\r\n\x1a\n"
_DOTS_OF_ONE_COLUMN = 1200  # a figure with more pixels across fills two columns


def html_page(text: str, directory: Path) -> str:
    """Return a Markdown page as HTML, with the images of ``directory`` inside.

    Parameters
    ----------
    text : str
        The page. Links to files beside it stay links.
    directory : path
        Where its images are; none from elsewhere is taken.
    """
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    parser.add_render_rule("image", _image)
    parser.add_render_rule("table_open", lambda *_: '<div class="table"><table>')
    parser.add_render_rule("table_close", lambda *_: "</table></div>")
    title = text.partition("\n")[0].lstrip("# ").replace("`", "")
    return whole_page(title, _STYLE, parser.render(text, {"directory": directory}))


def whole_page(title: str, style: str, body: str) -> str:
    """Return a document of HTML; the title is a text, style and body are as they are."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{style}</style>\n</head>\n<body>\n"
        f"{body}</body>\n</html>\n"
    )


def picture(png: bytes, name: str, kind: str = "") -> str:
    """Return a PNG as an element that holds it; ``kind`` is its class, if there is one."""
    data = base64.b64encode(png).decode()
    shape = f'class="{kind}" ' if kind else ""
    return f'<img {shape}alt="{escape(name)}" src="data:image/png;base64,{data}">'


def picture_of(figure: Any) -> str:
    """Return a figure as a picture in HTML."""
    return picture(figure._repr_png_(), "figure")


def table_of(rows: Iterable[tuple[str, str]]) -> str:
    """Return rows of a name and a value as a table."""
    cells = (f"<th>{escape(name)}</th><td>{escape(text)}</td>" for name, text in rows)
    return f"<table>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>"


def _image(renderer: Any, tokens: Sequence[Token], place: int, options: Any, env: Any) -> str:
    token = tokens[place]
    # What is not a PNG of this folder itself, by its name or through a link, is not shown.
    folder = env["directory"].resolve()
    path = (folder / str(token.attrs["src"])).resolve()
    data = path.read_bytes() if path.parent == folder and path.is_file() else b""
    if not data.startswith(_PNG):
        return f"<em>{escape(token.content)}</em>"
    # The width stands in the header of a PNG: four bytes from the sixteenth on.
    wide = int.from_bytes(data[16:20], "big") > _DOTS_OF_ONE_COLUMN
    return picture(data, token.content, "wide" if wide else "narrow")
