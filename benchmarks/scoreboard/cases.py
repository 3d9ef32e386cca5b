"""The cases: which worlds, how many runs, which methods."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from zlib import crc32

import numpy as np

from . import traces, worlds
from .filters import FILTERS
from .score import (
    BOUND,
    CENTROID,
    DISC,
    EXACT,
    EXACT_CLIPPED,
    LEAST_SQUARES,
    OURS,
    OURS_KNOWN_NOISE,
    OURS_SECTOR,
    OURS_UNCENSORED,
    STRONGEST,
)
from .walks import TELLING
from .world import Noise, World

PEERS = (LEAST_SQUARES, *FILTERS, CENTROID, STRONGEST)
KNOWN = (OURS, EXACT, BOUND, *PEERS)
"""Methods where the oracle walks the same walk; where it does not, a bound would not be theirs."""
MATCHED = (OURS, OURS_KNOWN_NOISE, EXACT, BOUND, *PEERS)
"""The same where the locator may know the kind of noise, as the oracle does."""
ORACLE = (OURS, EXACT, *PEERS)
CLIPPED_SHADOWED = (OURS, OURS_UNCENSORED, EXACT, *PEERS)
CLIPPED = (OURS, OURS_UNCENSORED, EXACT, EXACT_CLIPPED, *PEERS)
"""Clipped levels have a limit of their own where the noise is white."""
UNKNOWN = (OURS, *PEERS)
SECTOR = (OURS, OURS_SECTOR, *PEERS)

WHITE = Noise(3.0)
SPECIFIED_READINGS = (10, 20, 50)
CLIPPED_SHARES = (0.20, 0.45, 0.70)
SHADOWED = Noise(0.0, 6.0, 15.0)
SECTOR_NOISES = {"white": WHITE, "shadow": replace(SHADOWED, step_db=1.0)}
GPS_ERRORS: dict[str, worlds.GpsError] = {
    "gps-white": "white",
    "gps-slow": "slow",
    "gps-constant": "constant",
}

Build = Callable[[np.random.Generator, str], World]


@dataclass(frozen=True, slots=True)
class Case:
    """Worlds of one kind; `world(seed, run)` depends on its two arguments only.

    `runs` worlds are evaluated by default; `most` is the number of worlds that exist.
    """

    name: str
    title: str
    world: Callable[[int, int], World]
    runs: int
    methods: tuple[str, ...]
    most: int | None = None

    def count(self, wanted: int | None) -> int:
        """Runs to do where `wanted` (None: the usual number) were asked for."""
        count = self.runs if wanted is None else wanted
        return count if self.most is None else min(count, self.most)


def generator(name: str, seed: int, run: int) -> np.random.Generator:
    """Random numbers of one run of one case."""
    return np.random.default_rng(np.random.SeedSequence([seed, crc32(name.encode()), run]))


def _simulated_cases(
    name: str,
    title: str,
    build: Build,
    *,
    methods: tuple[str, ...] = KNOWN,
    shapes: tuple[str, ...] = TELLING,
    runs: int = 60,
) -> Case:
    """A case whose walks take these shapes in turn."""

    def world(seed: int, run: int) -> World:
        return build(generator(name, seed, run), shapes[run % len(shapes)])

    return Case(name, title, world, runs, methods)


def _white() -> list[Case]:
    title = "white noise 3 dB, walk: {}"
    build = partial(worlds.plain, noise=WHITE)
    return [
        _simulated_cases(
            f"white-{shape}", title.format(shape), build, methods=MATCHED, shapes=(shape,), runs=100
        )
        for shape in TELLING
    ]


def _shadowing_cases() -> list[Case]:
    cases = []
    for shadow_db, d_c_m in ((6.0, 15.0), (8.0, 30.0)):
        for kind, in_plane in (("path", False), ("field", True)):
            noise = Noise(0.0, shadow_db, d_c_m, in_plane=in_plane, step_db=1.0)
            where = "a field in the plane" if in_plane else "first order along the path"
            title = f"shadowing {shadow_db:.0f} dB over {d_c_m:.0f} m, {where}, 1 dB steps"
            build = partial(worlds.plain, noise=noise)
            cases.append(
                _simulated_cases(f"shadow{shadow_db:.0f}-{kind}", title, build, methods=MATCHED)
            )
    return cases


def _two_scale_case() -> Case:
    title = (
        "shadowing of two scales as a field in the plane: 7 dB, three quarters of the variance "
        "over 300 m, the rest over 20 m; white noise 1 dB, 1 dB steps"
    )
    return _simulated_cases(
        "two-scale", title, partial(worlds.plain, noise=worlds.TWO_SCALE), runs=100
    )


def _sector_cases() -> list[Case]:
    title = "sector antenna of 65 degrees, 25 dB from front to back, {}"
    kinds = {"white": "white noise 3 dB", "shadow": "shadowing 6 dB over 15 m along the path"}
    return [
        _simulated_cases(
            f"sector-{kind}",
            title.format(kinds[kind]),
            partial(worlds.past_sector_antenna, noise=noise),
            methods=SECTOR,
        )
        for kind, noise in SECTOR_NOISES.items()
    ]


def _twins() -> list[Case]:
    build = partial(worlds.plain, noise=WHITE)
    return [
        _simulated_cases(
            "twin-straight",
            "straight walk, white noise 3 dB: mirror image",
            build,
            shapes=("straight",),
            runs=200,
        ),
        _simulated_cases(
            "twin-circle",
            "round walk, white noise 3 dB: inverse point",
            build,
            shapes=("circle",),
            runs=200,
        ),
    ]


def _censored_cases() -> list[Case]:
    title = "{:.0%} of the levels clipped at -110 dBm, {}, 1 dB steps"
    white = [
        _simulated_cases(
            f"clip-{100 * share:.0f}",
            title.format(share, "white noise 3 dB"),
            partial(worlds.clipped_world, share=share, noise=WHITE),
            methods=CLIPPED,
        )
        for share in CLIPPED_SHARES
    ]
    build = partial(worlds.clipped_world, share=0.45, noise=SHADOWED)
    of_shadow = title.format(0.45, "shadowing 6 dB over 15 m along the path")
    return [*white, _simulated_cases("clip-45-shadow", of_shadow, build, methods=CLIPPED_SHADOWED)]


def _gps_error_cases() -> list[Case]:
    title = "position error of the receiver 5 m an axis, {}, pass at 15 to 40 m, white noise 3 dB"
    return [
        _simulated_cases(
            name, title.format(kind), partial(worlds.with_gps_errors, kind=kind), methods=ORACLE
        )
        for name, kind in GPS_ERRORS.items()
    ]


def _specified_cases() -> list[Case]:
    cases = []
    for spread in (False, True):
        for count in SPECIFIED_READINGS:
            where = "all around the circle" if spread else "the first of 50 around the circle"
            title = (
                f"the specification's scenario: {count} readings at 500 m, {where}, "
                "white noise 3 dB"
            )
            name = f"spec-{count}-{'around' if spread else 'begun'}"
            build = partial(_specified_world, count=count, spread=spread)
            cases.append(_simulated_cases(name, title, build, shapes=("circle",)))
    return cases


def _specified_world(rng: np.random.Generator, _: str, *, count: int, spread: bool) -> World:
    return worlds.specified_scenario(rng, count, spread=spread)


def _measured_cases() -> list[Case]:
    cases = []
    for classes, what in (
        ("A", "passes within 50 m and sees 120 deg"),
        ("B", "passes within 50 m, narrower"),
        ("CDE", "never within 50 m"),
    ):
        count = len(traces.names(classes))
        title = f"other methods on measured walks of class {', '.join(classes)}: {what}"
        world = partial(_measured_world, classes)
        cases.append(Case(f"real-{classes}", title, world, count, (*PEERS, DISC), most=count))
    return cases


def _measured_world(classes: str, _: int, run: int) -> World:
    return traces.world_of(*traces.names(classes)[run])


CASES: dict[str, Case] = {
    case.name: case
    for case in (
        *_white(),
        *_shadowing_cases(),
        _two_scale_case(),
        *_sector_cases(),
        *_twins(),
        *_censored_cases(),
        *_gps_error_cases(),
        _simulated_cases(
            "two-sources",
            "two transmitters with one identity, 200 to 500 m apart, white noise 3 dB",
            worlds.shared_identity,
            methods=UNKNOWN,
        ),
        *_measured_cases(),
        *_specified_cases(),
    )
}
