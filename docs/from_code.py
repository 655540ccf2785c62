"""Pages of the reference that are made from the code, and links that leave the pages."""

import argparse
import contextlib
import io
import os
from pathlib import Path

from docutils import nodes
from sphinx import addnodes

from hpcsweep.commands.cli import build_parser
from hpcsweep.job.template import TEMPLATE

ROOT = Path(__file__).resolve().parents[1]
PAGES = {"README": "index", "CHANGELOG": "changes"}
"""Pages of the site that stand for files beside `docs`."""


def write(folder: Path) -> None:
    """Write all pages, those that have not changed excepted, so that they are not built again."""
    folder.mkdir(exist_ok=True)
    for name, text in (("command-line", command_line()), ("template", template())):
        page = folder / f"{name}.md"
        if not page.exists() or page.read_text() != text:
            page.write_text(text)


def command_line() -> str:
    """Return the help of every command."""
    os.environ["COLUMNS"] = "88"
    parser = build_parser()
    (commands,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    parts = [
        "# Command line\n\nThe help of every command, as `hpcsweep COMMAND --help` prints it.\n"
    ]
    parts.append(f"```text\n{parser.format_help()}```\n")
    for name in commands.choices:
        parts.append(f"## {name}\n\n```text\n{_help(parser, name)}```\n")
    return "\n".join(parts)


def _help(parser: argparse.ArgumentParser, command: str) -> str:
    """Return what a command prints when asked for help: parts of it are added only then."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
        parser.parse_args([command, "--help"])
    return said.getvalue()


def template() -> str:
    """Return the commented job that `hpcsweep new` writes."""
    return (
        "# A commented job\n\n`hpcsweep new study.toml` writes it; every key is explained on\n"
        f"[Job files](../job-files.md).\n\n```toml\n{TEMPLATE}```\n"
    )


def leave_pages(app, doctree) -> None:
    """Follow links that are written for the tree of files.

    Examples of the gallery have a page, as have the files beside `docs` of `PAGES`; folders of the
    program are text.
    """
    for node in list(doctree.findall(addnodes.pending_xref)):
        target = node.get("reftarget", "")
        page = PAGES.get(Path(target).name.removesuffix(".md"))
        folder = (Path(app.env.doc2path(node["refdoc"])).parent / target).resolve()
        if page is not None:
            node.replace_self(_link(app, node["refdoc"], page, node.children))
        elif target.endswith("/") and folder.is_dir() and folder.is_relative_to(ROOT):
            node.replace_self(nodes.literal("", f"{folder.relative_to(ROOT)}/"))
        elif (ROOT / target).is_file():  # in the changes, whose file lies there
            node.replace_self(nodes.literal("", target))
    for node in list(doctree.findall(addnodes.download_reference)):
        path = Path(node["reftarget"])
        if path.parent.name == "gallery":
            page = f"auto_gallery/{path.stem}"
            node.replace_self(_link(app, app.env.docname, page, node.children))


def _link(app, docname: str, page: str, children) -> nodes.reference:
    uri = app.builder.get_relative_uri(docname, page)
    return nodes.reference("", "", *children, refuri=uri, internal=True)


def escape_bars(app, what, name, obj, options, lines) -> None:
    """Keep the bars of |u| in docstrings, which reST takes for a substitution."""
    lines[:] = [line.replace("|", "\\|") for line in lines]
