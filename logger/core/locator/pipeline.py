"""The locator from the readings of a cell to a verdict, in five steps.

    prepare                    readings -> blocks of readings taken at one point
    1 coarse    coarse_search  a quadtree over positions, with the walk in few blocks
    2 weigh     weigh_noise    which hypotheses of the noise the walk leaves plausible
    3 refine    refine         the quadtree again, with all blocks and those hypotheses
    4 summarise summarise      leaves -> modes, median, radius, means of P0, eta and sigma
    5 decide    decide         located, ambiguous or cannot tell, with reasons

`locate` is steps 1 to 4. The device runs steps 1 and 2 (`search.search_once`) and updates their
result with each reading (`online`) by the same functions.
"""

from logger.core.locator.posterior import Posterior
from logger.core.locator.preparation import LocatorInput, prepare
from logger.core.locator.quadtree import Effort, Tree
from logger.core.locator.search import coarse_search, refine, weigh_noise
from logger.core.locator.summary import outside_share, summarise
from logger.core.locator.two_source_test import LIVE, MOVES_M, MotionTest, divide, divide_in_time
from logger.core.locator.verdict import DESK_M, Decision, assess, may_move
from logger.core.model.prior import Prior
from logger.core.readings import Readings


def locate(
    obs: Readings,
    prior: Prior = Prior(),  # noqa: B008 (frozen)
    effort: Effort = Effort(),  # noqa: B008 (frozen)
) -> Posterior:
    """Posterior of the transmitter's position given all readings of a cell.

    Arrays of `obs` have shape (n,): positions in metres, levels in dBm. The posterior is in the
    same frame. Levels, censored readings and timing advances all count; of more than `MOST_MODEMS`
    modems those that received most. Raises `EstimationError` without a level inside the modem's
    scale.
    """
    task = prepare(obs, prior, effort)
    if task.prior.area is not None:
        task = task._replace(outside_share=outside_share(task, search(task.everywhere())))
    return summarise(task, search(task))


def search(task: LocatorInput) -> Tree:
    """Steps 1 to 3: the posterior as the leaves of a quadtree."""
    tree = coarse_search(task.walk)
    noise = weigh_noise(task.walk, tree)
    return refine(task.walk, tree, noise)


_MOVES_LOG_FACTOR = 1.5
"""Above, one that moves is likelier even if only one of five does: nothing is located.

Of 20 simulated transmitters at 0.3 to 3 m/s that were located where they no longer were, 9 are not
any more (11 with 1, 7 with 2.1); past 150 that stand, 10 are lost (16, 6), 4 of 33 measured ones.
"""


def decide(posterior: Posterior, obs: Readings, *, within_m: float = DESK_M) -> Decision:
    """The verdict: located where 95 % of the probability lie within `within_m`.

    A location is one only if no two transmitters explain the readings better, at once or one after
    the other, nor one that moves. `obs` are in their order in time.
    """
    obs = obs.usable()
    decision = assess(posterior, obs, divide(obs, posterior), within_m=within_m)
    if decision.verdict == "located":
        in_time = divide_in_time(obs, posterior, LIVE)
        decision = assess(posterior, obs, in_time, within_m=within_m)
    return unless_it_moves(decision, posterior, obs)


def unless_it_moves(decision: Decision, posterior: Posterior, obs: Readings) -> Decision:
    """The decision, or cannot tell where a transmitter that moves explains a location better.

    Readings of several modems, whose offsets look like a move, leave it as it is, and those not of
    one clock.
    """
    if decision.verdict != "located" or obs.n_modems > 1 or not obs.is_timed:
        return decision
    motion = MotionTest()
    motion.try_moves(obs, posterior, len(MOVES_M))
    moves = motion.division()
    if moves is None or moves.log_factor <= _MOVES_LOG_FACTOR:
        return decision
    return may_move(moves)
