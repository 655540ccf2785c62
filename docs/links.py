"""Links that leave the pages, and bars in docstrings: what Sphinx would not understand."""

from pathlib import Path

from docutils import nodes
from sphinx import addnodes

ROOT = Path(__file__).resolve().parents[1]
PAGES = {"README": "index", "CHANGELOG": "changes"}
"""Pages of the site that stand for files beside `docs`."""
MADE = {"job/keys.py": "generated/job-keys", "studies/variables.py": "generated/variables"}
"""Pages that the site makes of what the code declares, to which links lead that are named so."""


def leave_pages(app, doctree) -> None:
    """Follow links that are written for the tree of files.

    Examples of the gallery have a page, as have the files beside `docs` of `PAGES` and the code of
    `MADE`, unless the file itself is named; folders of the program are text.
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
        page = MADE.get("/".join(path.parts[-2:]))
        if path.parent.name == "gallery":
            page = f"auto_gallery/{path.stem}"
        if page is not None and node.astext() != path.name:
            node.replace_self(_link(app, app.env.docname, page, node.children))


def _link(app, docname: str, page: str, children) -> nodes.reference:
    uri = app.builder.get_relative_uri(docname, page)
    return nodes.reference("", "", *children, refuri=uri, internal=True)


def escape_bars(app, what, name, obj, options, lines) -> None:
    """Keep the bars of |u| in docstrings, which reST takes for a substitution."""
    lines[:] = [line.replace("|", "\\|") for line in lines]
