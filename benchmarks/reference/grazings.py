"""Contacts that an integrator with events keeps on, or never sees, beside the exact flow.

`bash benchmarks/run.sh grazings [--tries N] [--seed S]` starts one mass beside a stop so that
within a period its top passes the stop by 1e-16 to 1e-3 gaps, and follows it for that period: by
heyoka (a Taylor series of adaptive order with events, to be installed beside), whose event at the
stop turns the contact on or off by its sign, by scipy's DOP853 with the same event, and by `flow`.
What is right is told by the closed form between contacts: crossings are bracketed by samples and by
the tops between them, and found by Brent's method.
"""

import hpcsweep.commands.one_thread  # noqa: F401  # isort: skip  (before numpy is loaded)
import argparse
from collections.abc import Callable, Iterator

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap

ZETA, BETA, GAP = 0.05, 1000.0, 1.0
UNDECIDED = 1e-13
"""Tops this close to the stop may touch it or not; a contact that stays on is wrong even then."""
CLOSE = 1e-6
"""Difference of the end (gaps) above which an answer is wrong; tolerances are 1e-12 or less."""
CROSSINGS = 200
SAMPLES = 1000
"""Of a stretch, between which the closed form is searched for tops."""


Case = tuple[float, float, np.ndarray]


class Stretch:
    """Motion with the contact on or off: closed form from a state at a time."""

    def __init__(self, omega: float, amplitude: float, on: bool, tau: float, z: np.ndarray):
        stiffness, self._shift = (1.0 + BETA, BETA * GAP / (1.0 + BETA)) if on else (1.0, 0.0)
        self._omega, self._tau = omega, tau
        # the answer to -A sin(Omega tau) is the imaginary part of this times exp(i Omega tau)
        self._size = -amplitude / (stiffness - omega**2 + 2j * ZETA * omega)
        self._root = complex(-ZETA, np.sqrt(stiffness - ZETA**2))
        u, v = z - self._forced(tau)
        # u = Re(c exp(root t))
        self._free = complex(u, (self._root.real * u - v) / self._root.imag)

    def _forced(self, tau):
        turned = self._size * np.exp(1j * self._omega * tau)
        return np.array([self._shift + turned.imag, (1j * self._omega * turned).imag])

    def __call__(self, tau) -> np.ndarray:
        """Return (u, v) at a time, or at several."""
        turned = self._free * np.exp(self._root * (tau - self._tau))
        return np.array([turned.real, (self._root * turned).real]) + self._forced(tau)

    def crossing(self, end: float, sign: float) -> float | None:
        """Return the first time at which x passes 0 in a direction, None before `end`."""
        times = np.linspace(self._tau, end, SAMPLES + 1)
        x, v = (self(times).T - [GAP, 0.0]).T * sign
        x[0] = min(x[0], 0.0)  # it has just left, or lies below
        for k in np.flatnonzero((x[1:] > 0) | ((v[:-1] > 0) & (v[1:] < 0))):
            first, last = times[k], times[k + 1]
            if v[k] > 0 and v[k + 1] < 0:  # a top between them
                last = brentq(lambda tau: self(tau)[1], first, last, xtol=1e-15)
            if sign * (self(last)[0] - GAP) > 0:
                low = 0.0 if k == 0 else x[k]
                return first if low >= 0 and v[k] >= 0 else self._root_of(first, last, sign)
        return None

    def _root_of(self, first: float, last: float, sign: float) -> float:
        if sign * (self(first)[0] - GAP) >= 0:  # on its way back first
            first = brentq(lambda tau: self(tau)[1], first, last, xtol=1e-15)
        return float(brentq(lambda tau: self(tau)[0] - GAP, first, last, xtol=1e-15))


def exact(omega: float, amplitude: float, start: np.ndarray) -> np.ndarray:
    """Return the state after a period, from crossing to crossing."""
    end, tau, on, z = 2.0 * np.pi / omega, 0.0, False, start
    for _ in range(CROSSINGS):
        stretch = Stretch(omega, amplitude, on, tau, z)
        found = stretch.crossing(end, -1.0 if on else 1.0)
        if found is None:
            return stretch(end)
        tau, z, on = found, stretch(found), not on
        z[0] = GAP
    raise ArithmeticError("no end of crossings")


def starts(tries: int, seed: int) -> Iterator[tuple[Case, np.ndarray]]:
    """Draw motions that graze within a period: frequency, amplitude, start; and the right end."""
    rng = np.random.default_rng(seed)
    while tries:
        omega, amplitude = rng.uniform(0.5, 3.0), 10 ** rng.uniform(-2, 0)
        past = 10 ** rng.uniform(-16, -3) * rng.choice([1, 1, 1, -1])
        top = rng.uniform(0.2, 0.9) * 2.0 * np.pi / omega
        # what touches the stop by less than rounding goes on as what passes it by
        told = past if abs(past) > UNDECIDED else -10.0 * UNDECIDED
        start, near = (
            Stretch(omega, amplitude, False, top, np.array([GAP + x, 0.0]))(0.0)
            for x in (past, told)
        )
        way = Stretch(omega, amplitude, False, 0.0, start)
        pulled = -amplitude * np.sin(omega * top) < GAP  # it turns back there
        if start[0] < GAP and pulled and way.crossing(0.99 * top, 1.0) is None:
            tries -= 1
            yield (omega, amplitude, start), exact(omega, amplitude, near)


def by_heyoka() -> Callable | None:
    """Return a function to the end of a period and whether the contact is on there."""
    try:
        import heyoka
    except ImportError as error:
        print(f"heyoka is not there: {error}")
        return None
    u, v = heyoka.make_vars("u", "v")
    on, amplitude, omega = (heyoka.par[k] for k in range(3))
    force = -amplitude * heyoka.sin(omega * heyoka.time) - 2.0 * ZETA * v - u
    rate = force - on * BETA * (u - GAP)

    def switch(integrator, sign: int) -> bool:
        integrator.pars[0] = float(sign > 0)
        return True

    event = heyoka.t_event(u - GAP, callback=switch)
    follow = heyoka.taylor_adaptive(
        [(u, v), (v, rate)], [0.0, 0.0], pars=[0.0] * 3, t_events=[event]
    )

    def end(frequency: float, size: float, start: np.ndarray) -> tuple[np.ndarray, bool]:
        follow.time, follow.state[:] = 0.0, start
        follow.pars[:] = 0.0, size, frequency
        follow.reset_cooldowns()
        follow.propagate_until(2.0 * np.pi / frequency)
        return follow.state.copy(), bool(follow.pars[0])

    return end


def by_scipy(frequency: float, size: float, start: np.ndarray) -> tuple[np.ndarray, bool]:
    """Return the end of a period by DOP853, each contact from event to event."""
    period, tau, on, z = 2.0 * np.pi / frequency, 0.0, False, start

    def stop(_tau, state):
        return state[0] - GAP

    stop.terminal = True
    while True:

        def motion(at, state, on=on):
            push = BETA * (state[0] - GAP) * on
            return state[1], -size * np.sin(frequency * at) - 2.0 * ZETA * state[1] - state[
                0
            ] - push

        stop.direction = -1.0 if on else 1.0
        done = solve_ivp(motion, (tau, period), z, "DOP853", rtol=1e-12, atol=1e-14, events=stop)
        z = done.y[:, -1]
        if done.status != 1 or done.t[-1] >= period:
            return z, on
        tau, on = done.t[-1], not on


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tries", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    damped = {"damping_ratio": ZETA, "sharpness": np.inf, "stiffness_ratio": BETA}
    structure = Structure(1, **damped)

    def by_flow(frequency: float, size: float, start: np.ndarray) -> tuple[np.ndarray, bool]:
        return FlowMap(structure, frequency).observe(start, size, 1).points[0], False

    named = {"flow": by_flow, "heyoka": by_heyoka(), "scipy DOP853": by_scipy}
    cases = [*starts(options.tries, options.seed)]
    for name, end in named.items():
        if end is None:
            continue
        wrong = kept = 0
        worst = 0.0
        for case, right in cases:
            z, on = end(*case)
            error = float(np.abs(z - right).max())
            wrong += not error < CLOSE
            kept += on and not z[0] >= GAP - CLOSE
            worst = max(worst, error)
        print(
            f"{name:13s} wrong {wrong} of {len(cases)}, of these contact kept on {kept}, "
            f"largest error {worst:.1e}",
            flush=True,
        )


if __name__ == "__main__":
    main()
