"""All checks in the checklist's order."""

from postproc.reproductions.validate import convergence, cost, model, scenarios, update, utm
from postproc.reproductions.validate.check import Effort, Group

GROUPS: tuple[Group, ...] = (
    utm.checks,
    model.checks,
    update.checks,
    convergence.checks,
    scenarios.checks,
    cost.checks,
)
THOROUGH = Effort(circles=9, scenarios=5, timed=200)
QUICK = Effort(circles=1, scenarios=1, timed=30)
