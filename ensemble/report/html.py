"""Pages of HTML that need no other file: of a Markdown page, of a film; tables and pictures."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.token import Token

_PNG = b"\x89PNG\r\n\x1a\n"
_DOTS_OF_ONE_COLUMN = 1200  # a figure with more pixels across fills two columns


def html_page(text: str, directory: Path) -> str:
    """Return a Markdown page as HTML, with the images of ``directory`` alone inside."""
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    parser.add_render_rule("image", _image)
    parser.add_render_rule("table_open", lambda *_: '<div class="table"><table>')
    parser.add_render_rule("table_close", lambda *_: "</table></div>")
    title = text.partition("\n")[0].lstrip("# ").replace("`", "")
    style = Path(__file__).with_name("page.css").read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        f"{parser.render(text, {'directory': directory})}</body>\n</html>\n"
    )


def picture(png: bytes, name: str, kind: str = "") -> str:
    """Return a PNG as an element that holds it; ``kind`` is its class, if there is one."""
    data = base64.b64encode(png).decode()
    shape = f'class="{kind}" ' if kind else ""
    return f'<img {shape}alt="{escape(name)}" src="data:image/png;base64,{data}">'


def picture_of(figure: Any, name: str = "figure") -> str:
    """Return a figure as a picture in HTML."""
    return picture(figure._repr_png_(), name)


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
