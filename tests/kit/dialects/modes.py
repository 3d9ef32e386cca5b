"""The choice of technologies, each maker's command (firmware_notes); it outlasts the power."""

from collections.abc import Mapping

from logger.sim.dialects import Listing, Setting, setting

_QCFG = "+QCFG"


def _setting_reply(name: str) -> Listing:
    return lambda _, settings: [f"{name}: {settings[name]}"]


def _stored_setting(default: str, form: str) -> Setting:
    return setting(default, form, stored=True)


NWSCANMODE: Mapping[str, Listing] = {
    '+QCFG="NWSCANMODE"': lambda _, settings: [
        f'+QCFG: "nwscanmode",{settings[_QCFG].split(",")[1]}'
    ]
}
NWSCANMODE_SETTINGS = {_QCFG: _stored_setting('"NWSCANMODE",0,1', '"NWSCANMODE",[0-3](?:,[01])?')}

_RATS = {"00": "Automatic", "01": "UMTS 3G Only", "02": "GSM 2G Only", "06": "LTE Only"}
SELRAT: Mapping[str, Listing] = {
    "!SELRAT?": lambda _, settings: [
        f"!SELRAT: {settings['!SELRAT']}, {_RATS[settings['!SELRAT']]}"
    ]
}
SELRAT_SETTINGS = {"!SELRAT": _stored_setting("00", "00|01|06")}  # an MC7455 has no GSM

SYSCFGEX: Mapping[str, Listing] = {
    "^SYSCFGEX?": lambda _, settings: [
        f"^SYSCFGEX:{settings['^SYSCFGEX'].split(',')[0]},3FFFFFFF,1,2,7FFFFFFFFFFFFFFF"
    ]
}
SYSCFGEX_SETTINGS = {
    "^SYSCFGEX": _stored_setting('"00"', r'"(?:0[0-3]){1,3}",[0-9A-F]+,[0-2],[0-4],[0-9A-F]+,,')
}

XACT: Mapping[str, Listing] = {"+XACT?": _setting_reply("+XACT")}
XACT_SETTINGS = {
    "+XACT": _stored_setting("4,2,1,101,103", "[124](?:,[0-9]{1,3})*")
}  # nor has an L850
