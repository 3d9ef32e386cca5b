"""Levels, identities and timing advance in log records of Qualcomm's diagnostic stream.

Where a field lies is data: a table by code and version. A record counts if its version is known,
its length fits, and channel, code and level are possible; all others are counted. Checked with
captures of MobileInsight: B062, B0C1, B0C2, B179, B17F version 5, B192, B193 and B195. B17F
version 4, B180, GSM and WCDMA agree with what SCAT reads, no capture was at hand.

No message to or from a subscriber is read here: of GSM's messages only two kinds that a cell sends
to everybody.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from functools import partial
from typing import NamedTuple

from logger.core.cell_names import HIGHEST, Identity
from logger.core.types import MOST_NEIGHBOURS, Rat, Role
from logger.drivers.diag.frames import LogRecord


class Observation(NamedTuple):
    """What a record says of one cell; None is what it does not say.

    `channel` is ARFCN, UARFCN or EARFCN and `code` BSIC, PSC or PCI. `ta_16ts` counts steps of
    78.07 m. `neighbours` are the channels of a GSM cell's neighbour list. `is_reported`: the modem
    filtered the level and rounded it to 1 dB, for the network.
    """

    time_ns: int
    radio_id: int
    rat: Rat
    channel: int | None
    code: int | None
    role: Role
    level_dbm: float | None = None
    identity: Identity | None = None
    ta_16ts: int | None = None
    neighbours: tuple[int, ...] | None = None
    is_reported: bool = False


class RefusedError(Exception):
    """A length does not fit, or a value is impossible."""


class _UnknownError(Exception):
    """A record of a version, its argument, that no table has."""


class _Bits(NamedTuple):
    at: int
    n: int
    lowest: int = 0
    signed: bool = False

    def of(self, body: bytes, start: int = 0) -> int:
        begin = start + self.at
        end = begin + (self.lowest + self.n + 7) // 8
        if end > len(body):
            raise RefusedError
        value = int.from_bytes(body[begin:end], "little") >> self.lowest & ((1 << self.n) - 1)
        return value - (1 << self.n) if self.signed and value >> (self.n - 1) else value


class _Cells(NamedTuple):
    """Cells of a record: `number` of them, or one, each of `step` bytes from `first` on.

    `number` and `channel` lie in the record, all else in the cell; so does `channel` with
    `own_channels`. The level counts 1/16 dB from `zero_dbm` on. It is the largest of `receivers`,
    or the record has another form. `room`: the record has bytes for so many cells, whatever their
    number. `is_serving` has a value for the serving cell alone. `has_code` is 1 where the code is
    known.
    """

    rat: Rat
    role: Role
    channel: _Bits
    code: _Bits | None
    level: _Bits | None
    first: int = 0
    step: int = 0
    number: _Bits | None = None
    zero_dbm: float = 0.0
    room: int = 0
    own_channels: bool = False
    receivers: tuple[_Bits, ...] = ()
    is_serving: tuple[_Bits, int] | None = None
    has_code: _Bits | None = None


_MOST_RADIO_ID = 15  # modems have two receivers; more would be held in memory
_RSRP_0_DBM = -180.0
_PCI = _Bits(0, 9)
_ARFCN = _Bits(0, 12)
_lte = partial(_Cells, "LTE", zero_dbm=_RSRP_0_DBM)
_mib = partial(_lte, "neighbour", code=_Bits(1, 16), level=None)  # of any cell, not only serving
_b17f = partial(_lte, "serving")
_b180 = partial(_lte, "neighbour", code=_PCI, level=_Bits(0, 12, 20), step=32)
_b179 = partial(_lte, "neighbour", channel=_Bits(8, 32))
_b193 = partial(
    _lte,
    "neighbour",
    channel=_Bits(0, 32),
    code=_PCI,
    first=8,
    number=_Bits(4, 16),
    room=4,
    receivers=(_Bits(16, 12, 10), _Bits(20, 12, 12)),
    is_serving=(_Bits(0, 4, 9), 0b1000),  # carrier 0, "serving"
)
_b195 = _lte("neighbour", _Bits(0, 32), _PCI, _Bits(12, 12), first=8, step=52, number=_Bits(4, 6))
_gsm = partial(
    _Cells,
    "GSM",
    "neighbour",
    _ARFCN,
    level=_Bits(2, 16, signed=True),
    first=1,
    number=_Bits(0, 8),
    own_channels=True,
)


def _b193_one(size: int, words: int) -> _Cells:
    """`size` is the bytes of its EARFCN, `words` where levels begin."""
    return _lte(
        "neighbour",
        _Bits(0, 8 * size),
        _Bits(size, 9),
        _Bits(words + 8, 12, 12),
        step=words + 12,
        receivers=(_Bits(words, 12, 10), _Bits(words + 4, 12, 12)),
        is_serving=(_Bits(size, 3, 9), 0),
    )


_CELLS: Mapping[int, Mapping[int, tuple[_Cells, ...]]] = {
    0xB0C1: {1: (_mib(_Bits(3, 16), step=9),), 2: (_mib(_Bits(3, 32), step=11),)},
    0xB17F: {
        4: (_b17f(_Bits(4, 16), _Bits(6, 9), _Bits(8, 12), step=32),),
        5: (_b17f(_Bits(4, 32), _Bits(8, 9), _Bits(12, 12), step=36),),
    },
    0xB180: {
        4: (_b180(_Bits(4, 16), first=8, number=_Bits(6, 10, 6)),),
        5: (_b180(_Bits(4, 32), first=12, number=_Bits(8, 26, 6)),),
    },
    0xB179: {
        4: (
            _b179(code=_Bits(12, 16), level=_Bits(16, 16), step=28, is_serving=(_Bits(4, 32), 0)),
            _b179(code=_Bits(0, 16), level=_Bits(2, 16), first=28, step=12, number=_Bits(24, 8)),
        ),
    },
    0xB193: {
        4: (_b193_one(2, 12),),
        7: (_b193_one(4, 16),),
        19: (_b193(level=_Bits(24, 12, 12), step=88),),
        22: (_b193(level=_Bits(28, 12, 12), step=120),),
        36: (
            _b193(
                level=_Bits(28, 12, 12),
                step=128,
                zero_dbm=_RSRP_0_DBM + 40.0,
                receivers=(
                    _Bits(16, 12, 10),
                    _Bits(20, 12, 12),
                    _Bits(24, 12, 12),
                    _Bits(28, 12),
                ),
            ),
        ),
    },
    0xB192: {4: (_b195,)},
    0xB195: {4: (_b195,)},
    0x5071: {0: (_gsm(_Bits(5, 8), step=12, has_code=_Bits(4, 8)),)},
    0x507B: {0: (_gsm(None, step=4),)},
}
"""Cells by code and version, of the record or of its subpacket; GSM's have none, 0 here."""
_SUBPACKETS: Mapping[int, int] = {0xB062: 6, 0xB192: 27, 0xB193: 25, 0xB195: 31}
"""The subpacket that is read, by code; its bytes count from the end of its head."""
_ACCESSES: Mapping[int, tuple[int, int, int]] = {
    2: (1, 3, 13),
    3: (3, 5, 15),
    49: (3, 5, 15),
    50: (3, 5, 18),
}
"""Where B062 has result, messages and timing advance, by subpacket version."""
_SERVING_INFO: Mapping[int, tuple[int, int]] = {2: (16, 25), 3: (32, 29)}
"""Bits of an EARFCN in B0C2, and length, by version."""
_RANKED: Mapping[int, tuple[int, int]] = {0: (2, 10), 1: (2, 11), 2: (7, 16)}
"""Where the cells of 4005 begin and their size, by version."""
_VERSIONS: Mapping[int, Collection[int]] = {
    **_CELLS,
    0xB062: _ACCESSES,
    0xB0C2: _SERVING_INFO,
    0x4005: _RANKED,
}
_TWINS: Mapping[int, int] = {
    code + 0xA00: code for code in (0x506C, 0x5071, 0x507A, 0x507B, 0x512F, 0x5134)
}
"""Codes of modems for two SIMs: the number of the SIM, and the record of the other code."""
ALLOWED_CODES = frozenset({*_VERSIONS, *_TWINS, *_TWINS.values(), 0x4127})
"""All codes that are read."""

_RANGE_DBM: Mapping[str, tuple[float, float]] = {
    "LTE": (-156.0, -30.0),
    "GSM": (-120.0, -20.0),
    "WCDMA": (-130.0, -25.0),
}
_RSCP_0_DBM = -21
_MOST_TA = 1282  # 3GPP TS 36.213 4.2.3
_NO_TA = 0xFFFF
_ANSWERED = 2
"""Bit of the messages of a random access: the cell sent its timing advance."""
_TA_SETTLES_NS, _TA_WAITS_NS = 10**9, 10 * 10**9
STAYS_NS = 300 * 10**9
"""A serving cell that was named longer ago may be another one now."""
_BURSTS, _BURST_BYTES = 4, 23
_BCCH_DOWN = 0x81
_SI2, _SI3 = bytes.fromhex("061a"), bytes.fromhex("061b")
"""Kinds of messages (3GPP TS 44.018 9.1)."""


class Decoder:
    """Observations of log records in their order.

    `n_read` records were understood; `unknown` counts others by code and version, `refused` by code
    those with an impossible length or value.
    """

    def __init__(self) -> None:
        self.n_read = 0
        self.unknown: Counter[tuple[int, int]] = Counter()
        self.refused: Counter[int] = Counter()
        # of each receiver: serving cells, a timing advance that waits for its cell, and what its
        # GSM cell broadcasts
        self._serving: dict[tuple[int, str], Observation] = {}
        self._access: dict[int, Observation] = {}
        self._broadcast: dict[int, tuple[Identity, tuple[int, ...] | None]] = {}

    def feed(self, record: LogRecord) -> list[Observation]:
        """What a record says; nothing if its code is not allowed."""
        code, body = record.code, record.body
        if code not in ALLOWED_CODES:
            return []
        try:
            if code in _TWINS:
                radio_id = record.radio_id or _Bits(0, 8).of(body)
                record = LogRecord(_TWINS[code], radio_id, record.time_ns, body[1:])
            observations = [one for part in _parts(record) for one in self._read(record, *part)]
        except _UnknownError as error:
            self.unknown[code, error.args[0]] += 1
            return []
        except RefusedError:
            self.refused[code] += 1
            return []
        self.n_read += 1
        for one in tuple(observations):
            if one.role == "serving" and one.channel is not None:
                # first, while the second of the access is open
                observations = [*self._settle_access(one), *observations]
                last = self._last(record, one.rat, STAYS_NS)
                is_same = last is not None and last[3:5] == one[3:5]
                known = last.identity if last and is_same else None
                self._serving[one.radio_id, one.rat] = one._replace(identity=one.identity or known)
        return observations

    def _read(self, record: LogRecord, version: int, body: bytes) -> Iterator[Observation]:
        match record.code:
            case 0xB0C2:
                yield _serving_info(record, version, body)
            case 0xB062:
                self._take_access(record, version, body)
            case 0x5134:
                yield _gsm_cell(record, body)
            case 0x507A:
                yield from self._gsm_level(record, body)
            case 0x506C:
                yield from self._gsm_bursts(record, body)
            case 0x512F:
                yield from self._gsm_broadcast(record, body)
            case 0x4127:
                yield _wcdma_cell(record, body)
            case 0x4005:
                yield from self._ranks(record, version, body)
            case code:
                for cells in _CELLS[code][version]:
                    yield from _cells_of(record, cells, body)

    def _last(self, record: LogRecord, rat: Rat, within_ns: int) -> Observation | None:
        last = self._serving.get((record.radio_id, rat))
        return last if last and 0 <= record.time_ns - last.time_ns <= within_ns else None

    def _take_access(self, record: LogRecord, version: int, body: bytes) -> None:
        result, messages, at = _ACCESSES[version]
        ta_16ts = _Bits(at, 16).of(body)
        if body[result] or not body[messages] & _ANSWERED or ta_16ts == _NO_TA:
            return
        if ta_16ts > _MOST_TA:
            raise RefusedError
        if last := self._last(record, "LTE", _TA_WAITS_NS):
            self._access[record.radio_id] = last._replace(
                time_ns=record.time_ns, level_dbm=None, identity=None, ta_16ts=ta_16ts
            )

    def _settle_access(self, serving: Observation) -> list[Observation]:
        """A timing advance, once the cell is the same after the access; a handover has another."""
        if serving.rat != "LTE" or (access := self._access.get(serving.radio_id)) is None:
            return []
        waited_ns = serving.time_ns - access.time_ns
        is_same = (serving.channel, serving.code) == (access.channel, access.code)
        if is_same and 0 <= waited_ns < _TA_SETTLES_NS:
            return []
        del self._access[serving.radio_id]
        return [access] if is_same and 0 <= waited_ns <= _TA_WAITS_NS else []

    def _gsm_level(self, record: LogRecord, body: bytes) -> Iterator[Observation]:
        level_dbm = _level(_Bits(0, 16, signed=True).of(body), "GSM")
        if len(body) != 3:
            raise RefusedError
        if level_dbm is not None and (last := self._last(record, "GSM", STAYS_NS)):
            yield _again(last, record, level_dbm)

    def _gsm_bursts(self, record: LogRecord, body: bytes) -> Iterator[Observation]:
        """Levels on the channel of the serving cell; a call may hop on others."""
        if len(body) != 1 + _BURSTS * _BURST_BYTES:
            raise RefusedError
        last = self._last(record, "GSM", STAYS_NS)
        for start in range(1, len(body), _BURST_BYTES):
            level_dbm = _level(_Bits(10, 16, signed=True).of(body, start), "GSM")
            channel = _Bits(4, 12).of(body, start)
            if last and level_dbm is not None and channel == last.channel:
                yield _again(last, record, level_dbm)

    def _gsm_broadcast(self, record: LogRecord, body: bytes) -> Iterator[Observation]:
        """The list of neighbours follows once the same cell was heard before and after it."""
        if len(body) < 3 or body[2] != len(body) - 3:
            raise RefusedError
        kind, radio_id = body[4:6], record.radio_id
        if body[0] != _BCCH_DOWN or kind not in {_SI2, _SI3}:
            return
        before, listed = self._broadcast.get(radio_id, (None, None))
        if kind == _SI2:
            if before:
                self._broadcast[radio_id] = before, _neighbours(body[6:22])
            return
        if len(body) < 13:
            raise RefusedError
        identity = _identity(_bcd(body[8:11]), _big(body[11:13]), _big(body[6:8]))
        self._broadcast[radio_id] = identity, None
        last = self._last(record, "GSM", STAYS_NS)
        is_last = last is not None and last.identity == identity
        yield Observation(
            record.time_ns,
            radio_id,
            "GSM",
            last.channel if last and is_last else None,
            last.code if last and is_last else None,
            "serving",
            identity=identity,
            neighbours=listed if before == identity else None,
        )

    def _ranks(self, record: LogRecord, version: int, body: bytes) -> Iterator[Observation]:
        """Levels of WCDMA cells; those of GSM cells beside them are of an unknown scale."""
        first, step = _RANKED[version]
        number = body[0] & 0x3F
        if first + number * step > len(body):
            raise RefusedError
        serving = self._last(record, "WCDMA", STAYS_NS)
        for start in range(first, first + number * step, step):
            channel = _channel(_Bits(0, 16).of(body, start), "WCDMA")
            code = _code(_Bits(2, 16).of(body, start), "WCDMA")
            is_serving = serving is not None and (channel, code) == serving[3:5]
            level_dbm = float(_Bits(4, 8, signed=True).of(body, start) + _RSCP_0_DBM)
            yield Observation(
                record.time_ns,
                record.radio_id,
                "WCDMA",
                channel,
                code,
                "serving" if is_serving else "neighbour",
                _in_range(level_dbm, "WCDMA"),
            )


def _parts(record: LogRecord) -> Iterator[tuple[int, bytes]]:
    """Version and bytes of each part that is read."""
    code, body = record.code, record.body
    head = _Bits(0, 8).of(body)
    if record.radio_id > _MOST_RADIO_ID:
        raise RefusedError
    if code not in _SUBPACKETS:
        version = {0x4: head >> 6, 0xB: head}.get(code >> 12, 0) if code in _VERSIONS else 0
        if version not in _VERSIONS.get(code, {0}):
            raise _UnknownError(version)
        yield version, body
        return
    if head != 1:
        raise _UnknownError(head)
    start = 4
    for _ in range(_Bits(1, 8).of(body)):
        size = _Bits(start + 2, 16).of(body)
        if size < 4 or start + size > len(body):
            raise RefusedError
        if body[start] == _SUBPACKETS[code]:
            version = body[start + 1]
            if version not in _VERSIONS[code]:
                raise _UnknownError(version)
            yield version, body[start + 4 : start + size]
        start += size


def _cells_of(record: LogRecord, cells: _Cells, body: bytes) -> Iterator[Observation]:
    number = 1 if cells.number is None else cells.number.of(body)
    room = cells.room or number
    if number > room or cells.first + room * cells.step > len(body):
        raise RefusedError
    rat = cells.rat
    for start in range(cells.first, cells.first + number * cells.step, cells.step):
        channel = cells.channel.of(body, start if cells.own_channels else 0)
        code = None
        if cells.code and (cells.has_code is None or cells.has_code.of(body, start) == 1):
            code = _code(cells.code.of(body, start), rat)
        level_dbm = None
        if cells.level:
            raw = cells.level.of(body, start)
            level_dbm = _level(raw, rat, cells.zero_dbm)
            if cells.receivers:
                of_receivers = max(one.of(body, start) for one in cells.receivers)
                if level_dbm != of_receivers / 16 + _RSRP_0_DBM:
                    raise RefusedError
            if level_dbm is None:
                continue
        role = cells.role
        if cells.is_serving and cells.is_serving[0].of(body, start) == cells.is_serving[1]:
            role = "serving"
        yield Observation(
            record.time_ns, record.radio_id, rat, _channel(channel, rat), code, role, level_dbm
        )


def _again(serving: Observation, record: LogRecord, level_dbm: float) -> Observation:
    return serving._replace(
        time_ns=record.time_ns, level_dbm=level_dbm, identity=None, neighbours=None
    )


def _serving_info(record: LogRecord, version: int, body: bytes) -> Observation:
    n_bits, length = _SERVING_INFO[version]
    after = 5 + n_bits // 4  # two channels and two bandwidths
    if len(body) != length:
        raise RefusedError
    mcc, n_digits, mnc = (_Bits(after + at, n).of(body) for at, n in ((10, 16), (12, 8), (13, 16)))
    if n_digits not in {2, 3}:
        raise RefusedError
    identity = _identity(
        (f"{mcc:03}", f"{mnc:0{n_digits}}"),
        area=_Bits(after + 4, 16).of(body),
        cell_id=_Bits(after, 32).of(body),
        most=(1 << 28) - 1,
    )
    channel = _channel(_Bits(3, n_bits).of(body), "LTE")
    code = _code(_Bits(1, 16).of(body), "LTE")
    return Observation(
        record.time_ns, record.radio_id, "LTE", channel, code, "serving", identity=identity
    )


def _gsm_cell(record: LogRecord, body: bytes) -> Observation:
    if len(body) != 13:
        raise RefusedError
    bcc, ncc = body[2], body[3]
    if bcc > 7 or ncc > 7:
        raise RefusedError
    return Observation(
        record.time_ns,
        record.radio_id,
        "GSM",
        _channel(_ARFCN.of(body), "GSM"),
        8 * ncc + bcc,
        "serving",
        identity=_identity(_bcd(body[6:9]), _big(body[9:11]), _Bits(4, 16).of(body)),
    )


def _wcdma_cell(record: LogRecord, body: bytes) -> Observation:
    digits = body[18:24].hex()[1::2]  # each in a byte; f follows an MNC of two
    if len(body) < 28 or body[18:24].hex()[::2] != "000000":
        raise RefusedError
    identity = _identity(
        (digits[:3], digits[3:].removesuffix("f")),
        area=_Bits(24, 32).of(body),
        cell_id=_Bits(8, 32).of(body),
        most=(1 << 28) - 1,
    )
    channel = _channel(_Bits(4, 32).of(body), "WCDMA")
    code = _code(_Bits(16, 12, 4).of(body), "WCDMA")
    return Observation(
        record.time_ns, record.radio_id, "WCDMA", channel, code, "serving", identity=identity
    )


def _level(raw: int, rat: Rat, zero_dbm: float = 0.0) -> float | None:
    """`raw` is in 1/16 dB; GSM writes 0 for a cell that was not measured."""
    return None if rat == "GSM" and raw == 0 else _in_range(raw / 16 + zero_dbm, rat)


def _in_range(level_dbm: float, rat: Rat) -> float:
    low_dbm, high_dbm = _RANGE_DBM[rat]
    if not low_dbm <= level_dbm <= high_dbm:
        raise RefusedError
    return level_dbm


def _channel(channel: int, rat: Rat) -> int:
    if channel > HIGHEST[rat][0]:
        raise RefusedError
    return channel


def _code(code: int, rat: Rat) -> int:
    if code > HIGHEST[rat][1]:
        raise RefusedError
    return code


def _identity(plmn: tuple[str, str], area: int, cell_id: int, most: int = 0xFFFF) -> Identity:
    mcc, mnc = plmn
    is_network = len(mcc) == 3 and len(mnc) in {2, 3} and (mcc + mnc).isdecimal()
    if not is_network or mcc == "000" or area > 0xFFFF or cell_id > most:
        raise RefusedError
    return Identity(mcc, mnc, area, cell_id)


def _bcd(plmn: bytes) -> tuple[str, str]:
    """MCC and MNC of three bytes (3GPP TS 24.008 10.5.1.3)."""
    digits = plmn.hex()
    if len(digits) != 6:
        raise RefusedError
    third = digits[2].replace("f", "")
    return digits[1] + digits[0] + digits[3], digits[5] + digits[4] + third


def _big(number: bytes) -> int:
    return int.from_bytes(number, "big")


def _neighbours(frequencies: bytes) -> tuple[int, ...] | None:
    """Channels of a list in the form of a map of 1 to 124 that no other message continues.

    The other forms of 3GPP TS 44.018 10.5.2.13 are None.
    """
    if len(frequencies) != 16 or frequencies[0] & 0b1110_0000:
        return None
    bits = _big(frequencies)
    listed = tuple(n for n in range(1, 125) if bits >> (n - 1) & 1)
    return listed if len(listed) <= MOST_NEIGHBOURS else None
