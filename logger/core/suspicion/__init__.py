"""Which cells are suspicious, and how often that is said of a legitimate one.

A `Rule` (`rule`) is one object with all that is known of it: it decorates its check, in the file of
its family. `RULES` (`rules`) finds them. `SuspicionTracker` (`tracker`) asks them about the records
of a run, in their order: live and at the desk the same. A finding is evidence of `nats` (a log
likelihood ratio): how much more often a rogue cell gives it than a legitimate one did in measured
logs. `words` makes one of three words of the findings.
"""
