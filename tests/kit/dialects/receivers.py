"""GNSS receivers in modems: +CGNSINF and +QGPSLOC (captures 170 to 180)."""

from logger.sim.dialects import KNOTS_PER_MPS, Answer, Settings, setting, tenths
from logger.sim.world import Air

KMH_PER_MPS = 3.6
QUECTEL_NOT_ACTIVE, QUECTEL_NOT_FIXED = 505, 516

CGNS_SETTINGS = {"+CGNSPWR": setting("0", "[01]")}
QGPS_SETTINGS = {"+QGPS": setting("0", "1")}


def cgnsinf(air: Air, settings: Settings) -> Answer:
    """Decimal degrees and km/h; without a fix the time is that of a clock begun in 1980."""
    if settings["+CGNSPWR"] == "0":
        return ["+CGNSINF: 0,,,,,,,,,,,,,,,,,,,,"]
    fix = air.fix()
    if fix is None:
        return ["+CGNSINF: 1,0,19800106000014.000,,,,0.00,0.0,0,,,,,,0,0,,,,,"]
    time = f"{fix.utc:%Y%m%d%H%M%S}.{fix.utc.microsecond // 1000:03d}"
    motion = f"{fix.speed_mps * KMH_PER_MPS:.2f},{fix.course_deg:.1f}"
    where = f"{fix.lat_deg:.6f},{fix.lon_deg:.6f},{fix.alt_m:.3f}"
    return [f"+CGNSINF: 1,1,{time},{where},{motion},1,,0.9,1.7,1.4,,12,9,,,42,,"]


def qgpsloc(air: Air, settings: Settings) -> Answer:
    """Signed degrees of mode 2; the course is degrees and minutes."""
    fix = air.fix()
    if settings["+QGPS"] == "0":
        return QUECTEL_NOT_ACTIVE
    if fix is None:
        return QUECTEL_NOT_FIXED
    kmh, knots = fix.speed_mps * KMH_PER_MPS, fix.speed_mps * KNOTS_PER_MPS
    degrees, minutes = divmod(round(fix.course_deg * 60), 60)
    motion = f"{degrees}.{minutes:02d},{kmh:.1f},{knots:.1f}"
    where = f"{fix.lat_deg:.5f},{fix.lon_deg:.5f},0.9,{fix.alt_m:.1f},3"
    return [f"+QGPSLOC: {tenths(fix)},{where},{motion},{fix.utc:%d%m%y},09"]
