"""Judge all claims, for given files, by damping."""

from collections.abc import Sequence
from pathlib import Path

from claims import coexistence, judgement
from claims.data import Claim, Map, Verdict
from claims.evidence import Study, variant_of
from claims.reading import open_frames, read_map, read_study
from hpcsweep.job.paths import path_of
from hpcsweep.model.arguments import refused

STIFF, SOFT = 1000.0, 100.0
"""beta of the paper's two maps."""


def judge_files(paths: Sequence[Path]) -> dict[str, list[Claim]]:
    """Answer every claim for every damping that occurs in the files.

    Returns
    -------
    dict
        Damping, as named by `evidence.variant_of`, to the claims in order.

    Raises
    ------
    StoreError
        If a file cannot be used.
    """
    studies: dict[str, Study] = {}
    maps: dict[str, dict[float, Map]] = {}
    for path in _paths_of("paths", paths):
        frames = open_frames(path)
        try:
            variant = variant_of(frames.study.structure)
            maps.setdefault(variant, {})
            beta = frames.study.structure.stiffness_ratio
            study = read_study(frames) if beta == STIFF else None
            if study is not None and _better(study, studies.get(variant)):
                studies[variant] = study
            found = read_map(frames) if beta in (STIFF, SOFT) else None
            if found is not None and _finer(found, maps[variant].get(beta)):
                maps[variant][beta] = found
        finally:
            frames.close()
    return {
        variant: [*_of_sweep(variant, studies.get(variant)), *_of_maps(variant, maps[variant])]
        for variant in maps
    }


def judge_study(study: Study) -> list[Claim]:
    """Answer the claims about Omega = 0.445, beta = 1000."""
    sweep = study.sweep
    probe = study.probe()
    claims = [
        judgement.first_grazing(sweep, study.grazing()),
        judgement.window_order(sweep, study.gaps(judgement.WINDOWS)),
        judgement.window_hits(study.hits(judgement.WINDOWS)),
        judgement.late_period(sweep, study.late()),
        (
            judgement.chaotic_probe(probe)
            if probe is not None
            else Claim("3", TEXTS["3"], Verdict.CANNOT_TELL, "the sweep does not reach it")
        ),
        coexistence.two_impacting_orbits(sweep),
        *coexistence.coexisting_regions(sweep, study.branch_end()),
        judgement.raised_modes(sweep, study.free_norm()),
    ]
    grazing = study.structure.grazing_amplitude(sweep.omega)
    return [*claims, judgement.linear_is_exact(*study.linear_distance(), grazing)]


TEXTS = {
    "1": "Region (ii): chaos at first grazing, then P1 C3",
    "2": "Region (iii): windows P9, P8, P7, P6, P4 in chaos; P5 only on the way down",
    "3": "A = 0.09877 is chaotic",
    "4": "(iv): P2 C13 beside P4 C23, the first with the larger drift",
    "5": "(v) C123 beside C23; (vi) two C123; (vii) fold of P1 C23; (viii) C123 alone",
    "6": "beta = 100 is much simpler than beta = 1000",
    "7": "P1 with impacts lowers the drift with high probability; chaos is mixed",
    "8": "Impact raises the norms of modes 2 and 3 at linear resonance",
    "9": "At low amplitude the period-1 linear solution is exact",
}
"""Texts of the claims, used where there is no evidence."""


def _of_sweep(variant: str, study: Study | None) -> list[Claim]:
    if study is not None:
        return judge_study(study)
    need = f"needs a fine sweep at Omega = 0.445, beta = 1000: {_job('figure3', variant)}"
    return [
        Claim(number, TEXTS[number], Verdict.CANNOT_TELL, need)
        for number in ("1", "2", "3", "4", "5", "8", "9")
    ]


def _of_maps(variant: str, maps: dict[float, Map]) -> list[Claim]:
    """Answer the claims about maps over Omega and A."""
    jobs = {STIFF: _job("figure6", variant), SOFT: _job("figure6-beta100", variant)}
    missing = [job for beta, job in jobs.items() if beta not in maps]
    claims = []
    if missing:
        need = f"needs maps over Omega and A: {', '.join(missing)} (or the bluecrystal ones)"
        claims.append(Claim("6", TEXTS["6"], Verdict.CANNOT_TELL, need))
    else:
        claims.append(judgement.softer_is_simpler(maps[STIFF], maps[SOFT]))
    if STIFF not in maps:
        need = f"needs a map over Omega and A: {jobs[STIFF]}"
        return [*claims, Claim("7", TEXTS["7"], Verdict.CANNOT_TELL, need)]
    stiff = maps[STIFF]
    return [*claims, judgement.drift_of_orbits(stiff), judgement.drift_of_chaos(stiff)]


def _job(name: str, variant: str) -> str:
    return f"jobs/paper/{name}{'-described' if variant == 'described' else ''}.toml"


def _better(study: Study, other: Study | None) -> bool:
    """Return whether a study is better: sweeps both ways, then the finer one."""
    if other is None:
        return True
    new, old = study.sweep, other.sweep
    return (new.both(), new.amplitude.size) > (old.both(), old.amplitude.size)


def _finer(new: Map, other: Map | None) -> bool:
    """Return the map with more computed runs, the first of equal ones."""
    return other is None or new.valid.sum() > other.valid.sum()


def _paths_of(name: str, value: object) -> list[Path]:
    """Return the paths of a sequence of file names; a single name is refused.

    Raises
    ------
    ValueError
    """
    if isinstance(value, str | bytes) or not isinstance(value, Sequence):
        raise refused(name, "a sequence of paths", value)
    return [path_of(name, one) for one in value]
