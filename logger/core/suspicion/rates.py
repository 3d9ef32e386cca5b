"""Rates of the rules and words on legitimate logs.

Printed by `benchmarks/suspicion.py rates --python` on 62 runs of telephones, 38.5 h, mostly
in cars: GSM 2 h in calls, UMTS, LTE. Upper bounds for a modem that is carried on foot.
"""

from collections.abc import Mapping

from logger.core.suspicion.finding import HourRate, Rate, Word

_LOGS = "62 runs of telephones"

MEASURED: Mapping[str, Mapping[str, Rate]] = {
    "P1": {"GSM": Rate(0, 23, _LOGS), "LTE": Rate(0, 814, _LOGS), "WCDMA": Rate(0, 84, _LOGS)},
    "P4": {"GSM": Rate(0, 23, _LOGS), "LTE": Rate(0, 814, _LOGS), "WCDMA": Rate(0, 84, _LOGS)},
    "P5": {"GSM": Rate(1, 21, _LOGS)},
    "P6": {"GSM": Rate(0, 21, _LOGS)},
    "L1": {"GSM": Rate(0, 23, _LOGS), "LTE": Rate(1, 814, _LOGS), "WCDMA": Rate(1, 84, _LOGS)},
    "L2": {"GSM": Rate(0, 23, _LOGS), "LTE": Rate(0, 814, _LOGS), "WCDMA": Rate(0, 84, _LOGS)},
    "L3": {"GSM": Rate(0, 23, _LOGS), "LTE": Rate(0, 814, _LOGS), "WCDMA": Rate(0, 84, _LOGS)},
    "L4": {"GSM": Rate(0, 23, _LOGS), "LTE": Rate(0, 814, _LOGS), "WCDMA": Rate(0, 84, _LOGS)},
    "N1": {"GSM": Rate(0, 21, _LOGS)},
    "S2": {"GSM": Rate(0, 23, _LOGS), "LTE": Rate(1, 814, _LOGS), "WCDMA": Rate(0, 88, _LOGS)},
    "S3": {"GSM": Rate(13, 23, _LOGS), "LTE": Rate(13, 814, _LOGS), "WCDMA": Rate(2, 88, _LOGS)},
    "S4": {"GSM": Rate(0, 23, _LOGS), "LTE": Rate(0, 814, _LOGS), "WCDMA": Rate(0, 88, _LOGS)},
    "S8": {"GSM": Rate(0, 23, _LOGS), "LTE": Rate(28, 814, _LOGS), "WCDMA": Rate(3, 88, _LOGS)},
    "S5": {"GSM": Rate(0, 23, _LOGS), "LTE": Rate(0, 814, _LOGS), "WCDMA": Rate(1, 88, _LOGS)},
    "S9": {"GSM": Rate(1, 23, _LOGS), "LTE": Rate(0, 814, _LOGS), "WCDMA": Rate(1, 88, _LOGS)},
    "S6": {"GSM": Rate(0, 23, _LOGS), "LTE": Rate(0, 814, _LOGS), "WCDMA": Rate(0, 88, _LOGS)},
    "S7": {"GSM": Rate(0, 23, _LOGS), "LTE": Rate(0, 814, _LOGS), "WCDMA": Rate(0, 88, _LOGS)},
    "T1": {"GSM": Rate(0, 21, _LOGS), "LTE": Rate(1, 258, _LOGS)},
    "C2": {"GSM": Rate(1, 23, _LOGS), "LTE": Rate(12, 814, _LOGS), "WCDMA": Rate(4, 88, _LOGS)},
    "R1": {"GSM": Rate(0, 2, _LOGS)},
}

WORD_RATES: Mapping[Word, HourRate] = {
    "suspicious": HourRate(1, 38.5),
    "unusual": HourRate(16, 38.5),
}
