"""Which cells are suspicious, and how often that is said of a legitimate one.

`RULES` (`rules`) lists what is checked; each family of rules has a file. `SuspicionTracker`
(`tracker`) feeds them with the records of a run, in their order: live and at the desk the same.
A finding is evidence of `nats` (a log likelihood ratio): how much more often a rogue cell gives it
than a legitimate one did in measured logs. `words` makes one of three words of the findings.
"""
