"""Simulated modems by name, one or more for each family of drivers."""

from logger.sim.dialects.cinterion import BGS2, MC55, TC63
from logger.sim.dialects.dialect import Dialect
from logger.sim.dialects.huawei import ME909S
from logger.sim.dialects.lte_only import L850, MC7455
from logger.sim.dialects.plain import PLAIN
from logger.sim.dialects.quectel import EC25, M95
from logger.sim.dialects.simcom_gsm import SIM800, SIM808
from logger.sim.dialects.simcom_lte import SIM7000, SIM7600
from logger.sim.dialects.telit import GE864
from logger.sim.dialects.ublox import SARA_G350

DIALECTS: dict[str, Dialect] = {
    dialect.name: dialect
    for dialect in (
        *(SIM800, SIM808, SIM7000, SIM7600, EC25, M95, GE864, SARA_G350),
        *(BGS2, MC55, TC63, MC7455, ME909S, L850, PLAIN),
    )
}
