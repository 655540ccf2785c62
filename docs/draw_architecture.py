"""Draw docs/architecture.svg: the rooms on their floors, and who uses whom.

    python docs/draw_architecture.py            write the picture
    python docs/draw_architecture.py --check    exit with 1 if it is not up to date

Floors and walls are the contracts of import-linter in pyproject.toml, the arrows the imports of
the source, the words the docstrings of the rooms: nothing is said here a second time. An arrow is
left out where a way through other rooms says the same (transitive reduction).
"""

import ast
import sys
import textwrap
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = "hpcsweep"
PICTURE = ROOT / "docs" / "architecture.svg"
SEAMS = {
    "studies": "seam: what a campaign computes",
    "model": "seam: what is simulated",
}
"""Rooms whose contents are meant to be replaced or added to."""

WIDTH, MARGIN = 1040, 20
BOX_WIDTH, HEAD, FOOT = 224, 26, 10
"""Width of a narrow box; room for its name above, and below the words."""
GAP, STEM = 34, 12
"""Between floors, and from a box to where an arrow may turn."""
LINE, LETTERS = 14, 36
"""Height of a line of text, letters in one of a narrow box."""
WIDE = 4
"""Arrows from which on a room that is alone on its floor takes all of it."""
INK, PALE, WALL, SEAM = "#1f2933", "#f4f6f8", "#7b8794", "#b4530a"


@dataclass(frozen=True)
class Box:
    """One room in the picture."""

    name: str
    floor: int
    left: float
    width: float
    top: float
    height: float
    lines: list[str]
    alone: str

    @property
    def bottom(self) -> float:
        """Lower edge."""
        return self.top + self.height

    @property
    def middle(self) -> float:
        """Place of its arrows."""
        return self.left + self.width / 2

    def covers(self, x: float) -> bool:
        """Return whether a vertical line at x meets it."""
        return self.left - 6 < x < self.left + self.width + 6


def contracts() -> list[dict]:
    """Read import-linter's contracts."""
    text = (ROOT / "pyproject.toml").read_text()
    return tomllib.loads(text)["tool"]["importlinter"]["contracts"]


def floors() -> list[list[str]]:
    """Return the rooms of each floor, the highest first."""
    layers = next(c["layers"] for c in contracts() if c["type"] == "layers")
    return [[room.strip("() ") for room in layer.replace(":", "|").split("|")] for layer in layers]


def libraries() -> dict[str, list[str]]:
    """Return for each room the libraries that it alone may import."""
    found: dict[str, list[str]] = defaultdict(list)
    for contract in contracts():
        if contract["type"] != "forbidden" or contract["source_modules"] != [PACKAGE]:
            continue
        for line in contract.get("ignore_imports", []):
            source, library = (part.strip() for part in line.split("->"))
            room = source.split(".")[1]
            main = contract["ignore_imports"][0].split(".")[1].split(" ")[0]
            if room == main and library not in found[room]:
                found[room].append(library)
    return found


def _imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
            yield from (f"{node.module}.{name.name}" for name in node.names)


def uses(rooms: Iterable[str]) -> dict[str, set[str]]:
    """Return for each room the others that it imports."""
    found: dict[str, set[str]] = {room: set() for room in rooms}
    for room, used in found.items():
        for path in sorted((ROOT / PACKAGE / room).rglob("*.py")):
            for module in _imported(ast.parse(path.read_text())):
                parts = module.split(".")
                if parts[0] == PACKAGE and len(parts) > 1 and parts[1] in found:
                    used.add(parts[1])
        used.discard(room)
    return found


def reduced(used: dict[str, set[str]]) -> list[tuple[str, str]]:
    """Leave out the arrows that a longer way replaces; `used` has no circles."""

    def reach(room: str) -> set[str]:
        return set().union(used[room], *(reach(other) for other in used[room]))

    return [
        (room, other)
        for room in used
        for other in sorted(used[room])
        if not any(other in reach(between) for between in used[room] - {other})
    ]


def words(room: str) -> str:
    """Return the first line of a room's docstring."""
    source = (ROOT / PACKAGE / room / "__init__.py").read_text()
    text = ast.get_docstring(ast.parse(source)) or ""
    return text.split("\n\n")[0].replace("\n", " ").replace("`", "")


def boxes(arrows: list[tuple[str, str]]) -> dict[str, Box]:
    """Place the rooms."""
    placed, top, only = {}, float(MARGIN), libraries()
    for floor, rooms in enumerate(floors()):
        slot = (WIDTH - 2 * MARGIN) / len(rooms)
        wide = len(rooms) == 1 and sum(rooms[0] in arrow for arrow in arrows) >= WIDE
        width, letters = (slot, 4 * LETTERS) if wide else (BOX_WIDTH, LETTERS)
        told = {
            room: textwrap.wrap(words(room).rstrip("."), letters, max_lines=3, placeholder=" ...")
            for room in rooms
        }
        alone = {room: ", ".join(only.get(room, [])) for room in rooms}
        height = HEAD + FOOT + LINE * max(len(told[room]) + bool(alone[room]) for room in rooms)
        for place, room in enumerate(rooms):
            left = MARGIN + slot * place + (slot - width) / 2
            placed[room] = Box(room, floor, left, width, top, height, told[room], alone[room])
        top += height + GAP
    return placed


def _route(source: Box, target: Box, others: Iterable[Box]) -> list[tuple[float, float]]:
    """Find a way down from one box to another, past the boxes between."""
    between = [box for box in others if source.floor < box.floor < target.floor]
    wished = [target.middle, source.middle]
    ends = [box.left - 14 for box in between] + [box.left + box.width + 14 for box in between]
    wished += sorted(ends, key=lambda x: abs(x - source.middle) + abs(x - target.middle))
    x = next((x for x in wished if not any(box.covers(x) for box in between)), WIDTH - 8.0)
    start = x if source.covers(x) else source.middle
    end = x if target.covers(x) else target.middle
    leave, arrive = source.bottom, target.top
    points = [(start, leave), (start, leave + STEM), (x, leave + STEM)]
    points += [(x, arrive - GAP + STEM), (end, arrive - GAP + STEM), (end, arrive - 1)]
    return [point for point, following in pairwise(points) if point != following] + points[-1:]


def _box(box: Box) -> Iterator[str]:
    edge, line = (SEAM, 2) if box.name in SEAMS else (INK, 1.2)
    yield (
        f'<rect x="{box.left:g}" y="{box.top:g}" width="{box.width:g}" height="{box.height:g}" '
        f'rx="5" fill="{PALE}" stroke="{edge}" stroke-width="{line}"/>'
    )
    yield _text(box.middle, box.top + 19, box.name, 'font-weight="bold" font-size="15"')
    for number, words_of_line in enumerate(box.lines):
        yield _text(box.middle, box.top + 36 + LINE * number, words_of_line, 'font-size="11.5"')
    if box.alone:
        style = f'font-size="11" font-style="italic" fill="{WALL}"'
        yield _text(box.middle, box.bottom - 7, f"alone imports {box.alone}", style)
    if box.name in SEAMS:
        style = f'font-size="13" font-style="italic" fill="{SEAM}"'
        place = box.left - 14, box.top + box.height / 2 + 4
        yield _text(*place, SEAMS[box.name], style, "end")


def _text(x: float, y: float, text: str, style: str, anchor: str = "middle") -> str:
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" {style}>{escape(text)}</text>'


def picture() -> str:
    """Draw everything; return the SVG text."""
    rooms = [room for floor in floors() for room in floor]
    arrows = reduced(uses(rooms))
    placed = boxes(arrows)
    height = max(box.bottom for box in placed.values()) + MARGIN
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:g}" '
        f'width="{WIDTH}" height="{height:g}" font-family="Helvetica, Arial, sans-serif" '
        f'fill="{INK}">',
        "<title>The rooms of hpcsweep: each uses only rooms below it</title>",
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" '
        f'markerHeight="8" orient="auto"><path d="M0,0.5 L8,4 L0,7.5 z" fill="{INK}"/></marker>'
        "</defs>",
        f'<rect width="{WIDTH}" height="{height:g}" rx="8" fill="#ffffff"/>',
    ]
    for source, target in arrows:
        way = _route(placed[source], placed[target], placed.values())
        path = " ".join(f"{x:g},{y:g}" for x, y in way)
        lines.append(
            f'<polyline points="{path}" fill="none" stroke="{INK}" stroke-width="1.3" '
            'marker-end="url(#tip)"/>'
        )
    for box in placed.values():
        lines += _box(box)
    return "\n".join([*lines, "</svg>", ""])


def main() -> int:
    """Write the picture, or compare it; return the exit code."""
    if "--check" in sys.argv[1:]:
        return int(not PICTURE.exists() or PICTURE.read_text() != picture())
    PICTURE.write_text(picture())
    return 0


if __name__ == "__main__":
    sys.exit(main())
