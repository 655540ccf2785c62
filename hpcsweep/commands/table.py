"""`hpcsweep table`: write chosen results as a table: CSV, Excel, Parquet.

Write chosen results as a table with one row for each structure, record, scale and place (of other
studies, each run and place), and columns that name these: record, scale, storey, floor or contact,
and the keys that the job varies. By its name the table is CSV, an Excel workbook (.xlsx, needs
openpyxl) or Parquet (.parquet, needs pyarrow). Runs that are not computed have no row. Names that a
spreadsheet would compute (=A1, +1, @SUM) stand behind an apostrophe there.

examples:
  hpcsweep table pair.h5 -o pair.csv
  hpcsweep table pair.h5 --what drift,acceleration,force --place A -o pair.xlsx
  hpcsweep table pair.h5 --what storey_drift,storey_drift_time,pga --at gap=0.02 -o pair.parquet
  hpcsweep table frames.h5 --structures --beside walls.h5 --scale 5 -o portfolio.csv
With --structures a row is a structure at one intensity: median, 16 and 84 % of the records, the
share of these in which something touches, the place where the median is largest.
Columns have the names of --what and their units: drift [%]. Responses are sizes; drift and
residual_drift are ratios in percent where the job gives storey heights.
"""

import contextlib
import importlib
import itertools
from collections.abc import Iterator
from typing import NamedTuple

from hpcsweep.commands import CommandError, add_at, add_file
from hpcsweep.commands.outputs import TABLE, check_overwriting, writing

NEEDS = {".csv": "pandas", ".xlsx": "openpyxl", ".parquet": "pyarrow"}
"""Libraries that write a table, by the end of its name."""
MAX_ROWS = 2**20 - 1
"""Of a sheet, below its header."""
PARTS = "16 %", "median", "84 %"
"""Of the records, in the order of `OfStructure.band`."""
DONE = " done"
"""Name of the outcomes by which rows are chosen."""


def configure(parser) -> None:
    """Add the options of the command."""
    from hpcsweep.figures.diagrams import responses, storeys

    add_file(parser, "TABLE", "table: .csv, .xlsx or .parquet (default: FILE with .csv)")
    parser.add_argument(
        "--what",
        metavar="NAMES",
        help="responses, as of plot --response, or variables of the file, divided by commas "
        "(default: drift,acceleration; of others all with one value a run, and what was asked for)",
    )
    parser.add_argument("--place", metavar="NAME", help="one storey, floor, contact or building")
    parser.add_argument("--structures", action="store_true", help="a row a structure")
    for option in (storeys.BESIDE, responses.SCALE):
        option.add(parser, ", with --structures")
    add_at(parser, "all values")


def run(options) -> int:
    """Run the command."""
    from hpcsweep.store import Frames

    path = options.output or options.file.with_suffix(".csv")
    form = path.suffix.lower()
    if form not in NEEDS:
        raise CommandError(f"{path}: the name of a table must end in {', '.join(NEEDS)}")
    try:
        importlib.import_module(NEEDS[form])
    except ImportError:
        said = f"pip install {NEEDS[form]}" + ", or name a .csv with -o" * (form != ".csv")
        raise CommandError(f"{path}: needs {NEEDS[form]}, which is not installed: {said}") from None
    check_overwriting(path, TABLE)
    import pandas

    with contextlib.closing(Frames(options.file, None, options.at)) as frames:
        tables = _tables(frames, options.what, options.place)
        if options.structures:
            tables = _structures(frames, options)
        if form != ".parquet":
            tables = map(_as_cells, tables)
        first = next(tables)
        wanted = () if options.structures else _wanted(frames, options.what).items()
        with writing(path):
            if form == ".csv":
                n_rows = 0
                for table in itertools.chain([first], tables):
                    table.to_csv(path, index=False, mode="a" if n_rows else "w", header=not n_rows)
                    n_rows += len(table)
            else:
                whole = pandas.concat([first, *tables], ignore_index=True)
                n_rows = len(whole)
                if form == ".xlsx" and n_rows > MAX_ROWS:
                    limit = f"{n_rows} rows, a sheet has {MAX_ROWS}; name a .csv or .parquet"
                    raise CommandError(f"{path}: {limit}")
                write = whole.to_excel if form == ".xlsx" else whole.to_parquet
                write(path, index=False)
    units = (name if column.unit == "1" else f"{name} in {column.unit}" for name, column in wanted)
    print(f"{path}: {', '.join([f'{n_rows} rows', *units])}")
    return 0


def _structures(frames, options) -> Iterator:
    """Yield the table of all structures."""
    import pandas

    from hpcsweep.figures.diagrams.storeys import PERIOD, opened, structures_of

    what = (options.what or "drift", options.place, options.scale)
    with opened(options.beside or ()) as others:
        structures = structures_of(frames, *what, others)
    label = structures[0].stripes.label.replace("  ", " ")
    rows = [
        {"job": each.job, "structure": each.name, "storeys in all": each.storeys, **each.keys}
        | {f"{part} {label}": size for part, size in zip(PARTS, each.band, strict=True)}
        | {"touching": each.touching, "worst place": each.worst}
        for each in structures
    ]
    yield pandas.DataFrame(rows).rename(columns={PERIOD: "longest period"})


def _tables(frames, what: str | None, place: str | None) -> Iterator:
    """Yield the table of each part that is chosen."""
    for keys in frames.parts():
        study = frames.study
        wanted = _wanted(frames, what)
        units = _units(frames, wanted)
        held = [column.variable for column in wanted.values()]
        each = [[k] for k in range(study.n_frames)] if study.is_list else [None]
        for some in each:
            yield _table(frames.gather([*held, "outcome"], some), study, wanted, place, keys, units)


class Column(NamedTuple):
    """A column of the table: a variable, or a response, with its ratio to the storeys' heights."""

    variable: str
    is_response: bool
    is_ratio: bool
    unit: str


def _wanted(frames, what: str | None) -> dict[str, Column]:
    """Return the columns that are asked for, by their names."""
    from hpcsweep.model.unit_names import unit_of
    from hpcsweep.studies.ground_motion.stripes import RESPONSES
    from hpcsweep.studies.quantities import METRIC_KEYS, ROWS
    from hpcsweep.studies.variables import STOREY_HEIGHT

    study, is_records = frames.study, frames.study.content == "responses"
    held = {v.name: v for v in (*(v for v, _ in study.given), *frames.variables)}
    fit = [name for name, v in held.items() if len({*v.dims} - {*study.run_dims}) <= 1]
    offered = {key: each.name for key, each in RESPONSES.items() if is_records and each.name in fit}
    offered |= {name: name for name in fit if name not in offered}
    if what is None:
        asked = {key.name for key in METRIC_KEYS if not key.default} & study.settings.metrics
        asked |= {each.name for each in ROWS} if study.settings.rows else set()
        of_runs = {name for name in fit if held[name].dims == study.run_dims} | asked
        names = (name for name in fit if name in frames and name in of_runs)
        what = "drift,acceleration" if is_records else ",".join(names)
    wanted: dict[str, Column] = {}
    for column in map(str.strip, what.split(",")):
        if column not in offered:
            raise CommandError(f"--what {column}: must be of {', '.join(offered)}")
        is_response, variable = is_records and column in RESPONSES, held[offered[column]]
        is_ratio = is_response and variable.dims[-1] == "storey" and STOREY_HEIGHT.name in held
        unit = "%" if is_ratio else unit_of(study.structure, variable.units)
        wanted[column] = Column(variable.name, is_response, is_ratio, unit)
    return wanted


def _table(results, study, wanted: dict[str, Column], place: str | None, keys: dict, units: dict):
    """Return the table of a part's results: a row a computed run and place."""
    from hpcsweep.earthquakes.intensity import rounded
    from hpcsweep.store import meanings
    from hpcsweep.studies.ground_motion.stripes import places_of
    from hpcsweep.studies.variables import percent_of_height

    runs, places, columns = [*study.run_dims], dict[str, None](), {}
    percent = percent_of_height(results)
    for column, (name, is_response, is_ratio, _) in wanted.items():
        array = abs(results[name]) if is_response else results[name]
        if "flag_meanings" in array.attrs:
            array = meanings(array)
        if is_ratio and percent is not None:
            array = array.copy(data=array.values * percent)
        for dim in {*array.dims} - {*runs}:
            names = [str(label) for label in results[dim].values]
            array = array.rename({dim: "place"}).assign_coords(place=names)
            array = array.isel(place=places_of(names, place)).drop_duplicates("place", keep="last")
            places |= dict.fromkeys(array["place"].values.tolist())
        columns[column] = array
    for name, array in columns.items():
        columns[name] = array.reindex(place=[*places]) if "place" in array.dims else array
    along = ["place"] if places else []
    table = results[["outcome"]].rename(outcome=DONE).assign(columns).to_dataframe([*runs, *along])
    table = table[table[DONE] > 0].reset_index().assign(**keys)
    if units.get("scale") == " [g]":
        table["scale"] = [*map(rounded, study.intensities(table["scale"])[0])]
    by_formula = [name for name in ("omega", "amplitude") if name in results.coords]
    shown = dict.fromkeys([*keys, *runs, *by_formula, *along, *wanted])
    return table[[*shown]].rename(columns=lambda name: name + units.get(name, ""))


def _units(frames, wanted: dict[str, Column]) -> dict[str, str]:
    """Return the units of columns in brackets, as they follow their names."""
    from hpcsweep.model.unit_names import unit_of
    from hpcsweep.studies.variables import AMPLITUDE, OMEGA

    study = frames.whole.study
    kinds = {"omega": OMEGA[0], "amplitude": AMPLITUDE[0]}
    kinds |= {name: entry.units for name, entry in study.coordinates.items()}
    kinds |= {entry.name: entry.units for axis in study.axes for entry in axis.keys}
    units = {name: unit_of(study.structure, unit) for name, unit in kinds.items()}
    if "scale" in study.run_dims:
        units["scale"] = frames.study.intensities(1.0)[1]
    units |= {name: entry.unit for name, entry in wanted.items()}
    return {name: f" [{unit}]" for name, unit in units.items() if unit not in ("1", "")}


def _as_cells(table):
    """Return a table in which no cell is a formula to a spreadsheet."""
    from hpcsweep.earthquakes.demands import as_cell

    texts = {name: table[name].map(as_cell) for name in table if table[name].dtype.kind == "O"}
    return table.assign(**texts).rename(columns=as_cell)
