"""Qualcomm's diagnostic stream in a file: .qmdl of Rayhunter, SCAT and QCSuper, .mi2log.

Only codes that carry levels, identities, timing advance or evidence leave their frame. The times
are the modem's: of 1980 until a network set its clock.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from logging import getLogger
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from logger.core.cell_names import HIGHEST, Identity
from logger.core.errors import RunFileError
from logger.core.foreign import open_regular
from logger.core.latest import Latest
from logger.core.types import Fix
from logger.drivers.diag.frames import FrameReader, LogRecord
from logger.drivers.diag.levels import (
    ALLOWED_CODES,
    STAYS_NS,
    Decoder,
    Observation,
    RefusedError,
)
from logger.drivers.diag.seconds import Second, Seconds
from postproc.interop.contents import Format
from postproc.interop.readers.rayhunter import CLOCK_SET_NS
from postproc.interop.sighting import NoCell, Remark, Row, Sighting
from postproc.progress import with_progress
from postproc.suspicion.signalling import CODE, UNKNOWN, Signal

# Of messages to and from a subscriber only the kind, an algorithm, a cause or the kind of identity
# asked for is read, by the position of its bits, and nothing is kept. What cells send to
# everybody, how a modem shall measure, and what it reported is decoded with pycrate, if installed.

T = TypeVar("T")

RRC, NAS_DOWN, NAS_UP = 0xB0C0, 0xB0EC, 0xB0ED
GSM_RR, GSM_RR_OF_TWO = 0x512F, 0x5B2F
CODES = frozenset({RRC, NAS_DOWN, NAS_UP, GSM_RR, GSM_RR_OF_TWO})
"""Codes of messages that are read."""
NO_PYCRATE = "messages that need pycrate"

_HEADS: Mapping[range, tuple[int, int, int, int]] = {
    range(6, 8): (4, 6, 2, 10),
    range(8, 25): (4, 6, 4, 12),
    range(25, 30): (6, 8, 4, 14),
}
"""Where PCI and EARFCN of a message lie, bytes of the EARFCN, and where its channel lies."""
_CHANNELS: Mapping[tuple[int, ...], tuple[int, ...]] = {
    (6, 7, 8, 13, 22): (2, 5, 6, 8),
    (9, 12): (9, 12, 13, 15),
    (14, 15, 16, 20, 24, 25): (2, 6, 7, 9),
    (19, 26, 27, 29): (3, 8, 9, 11),
}
"""Numbers of BCCH-DL-SCH, DL-CCCH, DL-DCCH and UL-DCCH by version; no other is read."""
_VERSIONS = {
    version: (*head, channels)
    for head_versions, head in _HEADS.items()
    for versions, channels in _CHANNELS.items()
    for version in versions
    if version in head_versions
}
_MOST, _MOST_BYTES = 4096, 1024
"""Cells and messages that are remembered, and bytes of such a message."""
_ANSWER_NS = 10 * 10**9
_IDENTITIES = {1: "IMSI", 2: "IMEI", 3: "IMEISV", 4: "TMSI"}  # 3GPP TS 24.301 9.9.3.17
_IDENTITY_REQUEST, _IDENTITY_RESPONSE, _SECURITY_MODE = 0x55, 0x56, 0x5D
_AUTHENTICATION_REJECT = 0x54
_REJECTS = {
    0x44: "attach",
    0x4B: "tracking area update",
    0x4E: "service",
    _AUTHENTICATION_REJECT: "authentication",
}
_TARGETS = ("LTE", "GERAN", "UTRA", "UTRA", "CDMA2000", "CDMA2000")
"""Of a redirection (3GPP TS 36.331 6.2.2, RRCConnectionRelease)."""
_REJECTED, _CONNECTED = 2, 3
_RECONFIGURATION, _RELEASE, _SECURITY = 4, 5, 6
_REPORT = 1
_REPORT_0_DBM = -140.5
"""Of the middle of step 0 of RSRP in a report (3GPP TS 36.133 9.1.4)."""
_CARRIERS = {
    "sib5": ("interFreqCarrierFreqList",),
    "sib6": ("carrierFreqListUTRA-FDD", "carrierFreqListUTRA-TDD"),
    "sib7": ("carrierFreqsInfoList",),
}
"""Lists of carriers in the blocks of LTE, UTRA and GERAN."""
_MOST_RECEIVERS = 16
_PLAIN_EMM = 0x07
_GSM_DCCH_DOWN, _CIPHERING = 0x80, b"\x06\x35"


class _Message(NamedTuple):
    """A message of RRC."""

    time_ns: int
    radio_id: int
    channel: int
    code: int
    body: bytes

    @property
    def cell(self) -> str:
        return f"LTE-{self.channel}-{self.code}"

    def bits(self, first: int, n: int) -> int:
        """Some bits as a number; the first of a byte is its highest."""
        end = first + n
        if end > 8 * len(self.body):
            raise RefusedError
        whole = int.from_bytes(self.body[: (end + 7) // 8], "big")
        return whole >> (-end % 8) & ((1 << n) - 1)

    def after(self, first: int) -> bytes:
        n = 8 * len(self.body) - first
        return (self.bits(first, n) << -n % 8).to_bytes((n + 7) // 8, "big")


class _Changes(NamedTuple):
    """Objects and measurements that are gone; carriers and objects of others.

    Of a handover the carrier, and the algorithms from then on.
    """

    objects_gone: Sequence[int] = ()
    gone: Sequence[int] = ()
    carriers: Mapping[int, int | None] = {}
    objects: Mapping[int, int] = {}
    target: int | None = None
    algorithms: str = ""


class _Measurements:
    """Which carrier each measurement of a receiver is of (3GPP TS 36.331 5.5.2)."""

    def __init__(self) -> None:
        self.carriers: dict[int, int | None] = {}
        self.objects: dict[int, int] = {}

    def channel(self, number: int) -> int | None:
        return self.carriers.get(self.objects.get(number, 0))

    def hand_over(self, source: int, target: int) -> None:
        """Exchange the measurements of two carriers (36.331 5.5.6.1)."""
        by_carrier = {carrier: one for one, carrier in self.carriers.items()}
        old, new = by_carrier.get(source, 0), by_carrier.get(target)
        if new is None:
            self.objects = {one: obj for one, obj in self.objects.items() if obj != old}
        else:
            swap = {old: new, new: old}
            self.objects = {one: swap.get(obj, obj) for one, obj in self.objects.items()}

    def change(self, changes: _Changes) -> None:
        for one in changes.objects_gone:
            self.carriers.pop(one, None)
        for one in changes.gone:
            self.objects.pop(one, None)
        self.carriers.update(changes.carriers)
        self.objects.update(changes.objects)


class Messages:
    """Cells, levels and evidence of messages in their order.

    `unknown` and `refused` are as those of `Decoder`. `n_unnamed` reported neighbours are of a
    carrier that the capture does not name; `n_undecoded` messages need pycrate, which is missing.
    """

    def __init__(self) -> None:
        self.unknown: Counter[tuple[int, int]] = Counter()
        self.refused: Counter[int] = Counter()
        self.n_unnamed = self.n_undecoded = 0
        self._has_pycrate = find_spec("pycrate_asn1dir") is not None
        self._readers: dict[int, Callable[[LogRecord], Iterator[Observation | Signal]]] = {
            RRC: self._rrc,
            NAS_DOWN: self._nas,
            NAS_UP: self._nas,
            GSM_RR: self._gsm,
            GSM_RR_OF_TWO: self._gsm,
        }
        # by receiver: the cell of its last message, its measurements, and what it was asked for
        self._cells: dict[int, str] = {}
        self._gsm_cells: dict[int, str] = {}
        self._measurements: dict[int, _Measurements] = {}
        self._asked: dict[int, Signal] = {}
        self._last_ns = 0
        # by cell: operator and own priority; what each broadcast last of the priorities of others
        self._operators: Latest[str] = Latest(_MOST)
        self._own: Latest[int] = Latest(_MOST)
        self._priorities: Latest[str] = Latest(_MOST)
        # by any identity of a shared cell the first one; by their bytes what messages say
        self._first: Latest[Identity] = Latest(_MOST)
        self._decoded: Latest[Any] = Latest(_MOST)

    def feed(self, record: LogRecord) -> list[Observation | Signal]:
        """What a record says; nothing if its code is not of messages."""
        if record.code not in CODES:
            return []
        read = self._readers[record.code]
        if abs(record.time_ns - self._last_ns) > STAYS_NS:
            # another connection, perhaps of another capture: its numbers mean other carriers
            for known in (self._cells, self._gsm_cells, self._measurements):
                known.clear()
        self._last_ns = record.time_ns
        try:
            return [*self._give_up(record.time_ns), *read(record)]
        except RefusedError:
            self.refused[record.code] += 1
            return []

    def end(self) -> list[Signal]:
        """What still waits for an answer."""
        return [self._answer(radio_id, "not answered") for radio_id in tuple(self._asked)]

    def with_first_name(self, one: Observation) -> Observation:
        """An observation with the first identity of a cell that several operators share."""
        # messages of GSM do not name their cell
        if one.rat == "GSM" and one.role == "serving" and one.channel is not None:
            name = f"GSM-{one.channel}-{one.code}"
            if one.radio_id < _MOST_RECEIVERS:
                self._gsm_cells[one.radio_id] = name
            if one.identity is not None:
                self._operators.put(name, f"{one.identity.mcc}-{one.identity.mnc}")
        if one.identity is None or one.rat != "LTE":
            return one
        identity = self._first.get(str(one.identity), one.identity)
        operator = f"{identity.mcc}-{identity.mnc}"
        self._operators.put(f"LTE-{one.channel}-{one.code}", operator)
        return one._replace(identity=identity)

    def _signal(self, time_ns: int, kind: str, value: str, cell: str) -> Signal:
        return Signal(time_ns, kind, value, cell, self._operators.get(cell, UNKNOWN))

    def _give_up(self, time_ns: int) -> Iterator[Signal]:
        for radio_id, asked in tuple(self._asked.items()):
            if not 0 <= time_ns - asked.time_ns <= _ANSWER_NS:
                yield self._answer(radio_id, "not answered")

    def _answer(self, radio_id: int, how: str) -> Signal:
        asked = self._asked.pop(radio_id)
        return asked._replace(value=f"{asked.value}, {how}")

    def _nas(self, record: LogRecord) -> Iterator[Signal]:
        message = record.body[4:7]
        if record.body[:1] != b"\x01":
            self.unknown[record.code, record.body[0] if record.body else 0] += 1
            return
        if len(message) < 2 or message[0] != _PLAIN_EMM:
            return
        radio_id, kind = record.radio_id, message[1]
        detail = message[2] if len(message) > 2 else 0
        cell = self._cells.get(radio_id, UNKNOWN)
        if record.code == NAS_UP:
            if kind == _IDENTITY_RESPONSE and radio_id in self._asked:
                yield self._answer(radio_id, "answered")
            return
        if kind == _IDENTITY_REQUEST and radio_id < _MOST_RECEIVERS:
            if radio_id in self._asked:
                yield self._answer(radio_id, "not answered")
            name = _IDENTITIES.get(detail & 7, "another identity")
            asked = self._signal(record.time_ns, "identity request", name, cell)
            self._asked[radio_id] = asked
        elif kind == _SECURITY_MODE:
            value = f"EEA{detail >> 4 & 7} EIA{detail & 7}"
            yield self._signal(record.time_ns, "NAS security", value, cell)
        elif kind in _REJECTS:
            cause = "" if kind == _AUTHENTICATION_REJECT else f", cause {detail}"
            yield self._signal(record.time_ns, "reject", f"{_REJECTS[kind]}{cause}", cell)

    def _gsm(self, record: LogRecord) -> Iterator[Signal]:
        """The cipher commanded (3GPP TS 44.018 9.1.9)."""
        is_twin = record.code == GSM_RR_OF_TWO
        body = record.body[is_twin:]
        if body[:1] != bytes([_GSM_DCCH_DOWN]) or body[3:5] != _CIPHERING or len(body) < 6:
            return
        radio_id = record.radio_id or (record.body[0] if is_twin else 0)
        value = f"A5/{(body[5] >> 1 & 7) + 1}" if body[5] & 1 else "A5/0"
        cell = self._gsm_cells.get(radio_id, UNKNOWN)
        yield self._signal(record.time_ns, "GSM cipher", value, cell)

    def _rrc(self, record: LogRecord) -> Iterator[Observation | Signal]:
        body = record.body
        version = body[0] if body else 0
        if version not in _VERSIONS:
            self.unknown[record.code, version] += 1
            return
        code_at, channel_at, n_bytes, kind_at, kinds = _VERSIONS[version]
        start = kind_at + 7
        code, channel = (
            int.from_bytes(body[at : at + n], "little")
            for at, n in ((code_at, 2), (channel_at, n_bytes))
        )
        highest_channel, highest_code = HIGHEST["LTE"]
        length = int.from_bytes(body[start - 2 : start], "little")
        if len(body) < start or length != len(body) - start:
            raise RefusedError
        if channel > highest_channel or code > highest_code or record.radio_id >= _MOST_RECEIVERS:
            raise RefusedError
        if body[kind_at] not in kinds:
            return
        kind = kinds.index(body[kind_at])
        message = _Message(record.time_ns, record.radio_id, channel, code, body[start:])
        self._cells[record.radio_id] = message.cell
        read = (self._broadcast, self._setup, self._downlink, self._uplink)[kind]
        yield from read(message)

    def _broadcast(self, message: _Message) -> Iterator[Observation | Signal]:
        if not self._can_decode():
            return
        identities, priorities = self._decode("BCCH_DL_SCH_Message", _broadcast_by, message.body)
        if identities:
            first = identities[0]
            for other in identities[1:]:
                self._first.put(str(other), first)
            yield self.with_first_name(
                Observation(
                    message.time_ns, message.radio_id, "LTE", message.channel, message.code,
                    "neighbour", identity=first,
                )
            )  # fmt: skip
        cell = message.cell
        own = priorities.get("LTE")
        if own is not None:
            self._own.put(cell, own)
        for sib, highest in priorities.items():
            if sib == "LTE":
                continue
            own = self._own.get(cell)
            value = f"highest {highest}, own {'unknown' if own is None else own}"
            name = f"{sib} of {cell}"
            if self._priorities.get(name) != value:
                yield self._signal(message.time_ns, f"{sib} priority", value, cell)
            self._priorities.put(name, value)

    def _can_decode(self) -> bool:
        self.n_undecoded += not self._has_pycrate
        return self._has_pycrate

    def _setup(self, message: _Message) -> Iterator[Signal]:
        kind = message.bits(0, 3)
        if kind == _CONNECTED:
            self._measurements.pop(message.radio_id, None)
        elif kind == _REJECTED:
            yield self._signal(message.time_ns, "reject", "RRC connection", message.cell)

    def _downlink(self, message: _Message) -> Iterator[Signal]:
        """Release, security and measurements: bits as in 3GPP TS 36.331 6.2.2."""
        if message.bits(0, 1):
            return
        kind = message.bits(1, 4)
        if kind == _RELEASE and not message.bits(7, 3):
            self._measurements.pop(message.radio_id, None)
            value = "no redirection"
            if message.bits(10, 1) and not message.bits(15, 1):
                target = message.bits(16, 3)
                value = f"to {_TARGETS[target]}" if target < len(_TARGETS) else "to another kind"
            yield self._signal(message.time_ns, "release", value, message.cell)
        elif kind == _SECURITY and not message.bits(7, 3):
            if not message.bits(12, 1) and not message.bits(16, 1):
                value = f"EEA{message.bits(13, 3)} EIA{message.bits(17, 3)}"
                yield self._signal(message.time_ns, "RRC security", value, message.cell)
        elif kind == _RECONFIGURATION and self._can_decode():
            yield from self._reconfigure(message)

    def _reconfigure(self, message: _Message) -> Iterator[Signal]:
        if message.bits(7, 4):
            raise RefusedError
        has_measurements, has_more = message.bits(11, 1), message.bits(12, 1) or message.bits(15, 1)
        changes = _Changes()
        if has_more:
            changes = self._decode("DL_DCCH_Message", _configuration, message.body)
        elif has_measurements:
            # they stand first: what follows them need not be decoded
            changes = self._decode("MeasConfig", _changes, message.after(17))
        measurements = self._measurements.setdefault(message.radio_id, _Measurements())
        if changes.target is not None and changes.target != message.channel:
            measurements.hand_over(message.channel, changes.target)
        measurements.change(changes)
        if how := changes.algorithms:
            yield self._signal(message.time_ns, "handover security", how, message.cell)

    def _uplink(self, message: _Message) -> Iterator[Observation]:
        if message.bits(0, 5) != _REPORT or not self._can_decode():
            return
        number, level_dbm, cells = self._decode("UL_DCCH_Message", _report, message.body)
        at = Observation(
            message.time_ns, message.radio_id, "LTE", message.channel, message.code, "serving",
            is_reported=True,
        )  # fmt: skip
        yield at._replace(level_dbm=level_dbm)
        measurements = self._measurements.get(message.radio_id)
        channel = measurements.channel(number) if measurements else None
        self.n_unnamed += len(cells) if channel is None else 0
        for code, cell_dbm, identity in cells:
            yield self.with_first_name(
                at._replace(
                    channel=channel,
                    code=code,
                    role="neighbour",
                    level_dbm=cell_dbm,
                    identity=None if channel is None else identity,
                )
            )

    def _decode(self, form: str, take: Callable[[Any], T], body: bytes) -> T:
        # networks and modems repeat most of their messages
        key = f"{form} {take.__name__} {body.hex()}"
        if key in self._decoded:
            taken: T = self._decoded[key]
        else:
            taken = _decode(form, take, body)
        if len(body) <= _MOST_BYTES:
            self._decoded.put(key, taken)
        return taken


def _decode(form: str, take: Callable[[Any], T], body: bytes) -> T:
    """What is taken of a message; pycrate has dictionaries, and pairs of a choice and its value."""
    getLogger("pycrate").propagate = False  # what it says of a message quotes it
    message = getattr(import_module("pycrate_asn1dir.RRCLTE").EUTRA_RRC_Definitions, form)
    try:
        message.from_uper(body)
        return take(message.get_val())
    except Exception as error:
        # pycrate has no class of its own for bytes that are no message, or one of another form
        raise RefusedError from error


def _of_release(message: Any, release: str) -> Mapping[str, Any]:
    _, (_, content) = message["message"]
    _, (choice, content) = content["criticalExtensions"]
    if choice != release:
        raise RefusedError
    return dict(content)


def _configuration(message: Any) -> _Changes:
    content = _of_release(message, "rrcConnectionReconfiguration-r8")
    target = content.get("mobilityControlInfo", {}).get("carrierFreq", {}).get("dl-CarrierFreq")
    _, handover = content.get("securityConfigHO", {}).get("handoverType", ("", {}))
    named = handover.get("securityAlgorithmConfig", {})
    parts = ("cipheringAlgorithm", "integrityProtAlgorithm") if named else ()
    algorithms = " ".join(named[one].upper()[:4] for one in parts)
    changes = _changes(content.get("measConfig", {}))
    return changes._replace(target=target, algorithms=algorithms)


def _changes(config: Any) -> _Changes:
    carriers: dict[int, int | None] = {}
    for one in config.get("measObjectToAddModList", ()):
        kind, what = one["measObject"]
        carriers[one["measObjectId"]] = _carrier(what) if kind == "measObjectEUTRA" else None
    return _Changes(
        config.get("measObjectToRemoveList", ()),
        config.get("measIdToRemoveList", ()),
        carriers,
        {one["measId"]: one["measObjectId"] for one in config.get("measIdToAddModList", ())},
    )


def _carrier(config: Mapping[str, Any]) -> int | None:
    channel = config.get("carrierFreq-v9e0", config.get("carrierFreq"))
    return channel if isinstance(channel, int) and channel < 0xFFFF else None


def _report(
    message: Any,
) -> tuple[int, float | None, list[tuple[int, float | None, Identity | None]]]:
    """Number of the measurement, serving level, neighbours of LTE."""
    results = _of_release(message, "measurementReport-r8")["measResults"]
    cells = []
    kind, others = results.get("measResultNeighCells", ("", ()))
    for cell in others if kind == "measResultListEUTRA" else ():
        identity = None
        info = cell.get("cgi-Info")
        if info and "mcc" in info["cellGlobalId"]["plmn-Identity"]:
            place, area = info["cellGlobalId"], info["trackingAreaCode"][0]
            identity = _identity(place["plmn-Identity"], area, place["cellIdentity"][0])
        cells.append((cell["physCellId"], _reported_dbm(cell["measResult"]), identity))
    return results["measId"], _reported_dbm(results["measResultPCell"]), cells


def _broadcast_by(message: Any) -> tuple[list[Identity], dict[str, int]]:
    """Identities of a cell, and the highest priority in each of its blocks; "LTE" is its own."""
    _, (kind, content) = message["message"]
    if kind == "systemInformationBlockType1":
        access = content["cellAccessRelatedInfo"]
        area, cell_id = access["trackingAreaCode"][0], access["cellIdentity"][0]
        plmns: list[Mapping[str, Any]] = []
        for one in access["plmn-IdentityList"]:
            plmn = one["plmn-Identity"]
            # the country of an operator is that of the one before, unless it is given
            plmns.append(plmn if "mcc" in plmn else {**plmn, "mcc": plmns[-1]["mcc"]})
        return [_identity(plmn, area, cell_id) for plmn in plmns], {}
    priorities: dict[str, int] = {}
    if kind == "systemInformation":
        _, information = content["criticalExtensions"]
        for name, block in information.get("sib-TypeAndInfo", ()):
            if name == "sib3":
                serving = block["cellReselectionServingFreqInfo"]
                priorities["LTE"] = serving["cellReselectionPriority"]
            elif name in _CARRIERS:
                others = [
                    one.get("commonInfo", one).get("cellReselectionPriority", -1)
                    for carriers in _CARRIERS[name]
                    for one in block.get(carriers, ())
                ]
                if max(others, default=-1) >= 0:
                    priorities[name.upper()] = max(others)
    return [], priorities


def _identity(plmn: Mapping[str, Any], area: int, cell_id: int) -> Identity:
    mcc, mnc = ("".join(map(str, plmn[part])) for part in ("mcc", "mnc"))
    return Identity(mcc, mnc, area, cell_id)


def _reported_dbm(result: Mapping[str, int]) -> float | None:
    """A level in steps of 1 dB; None for the first and the last step, which have one limit."""
    step = result.get("rsrpResult", 0)
    return step + _REPORT_0_DBM if 0 < step < 97 else None


# --- the file ---

_CHUNK = 1 << 20


def read(source: Path) -> Iterator[Row]:
    """A row for each second and cell, or signal; then what was not read; raises `RunFileError`."""
    frames, decoder, messages = FrameReader(ALLOWED_CODES | CODES), Decoder(), Messages()
    records = (record for chunk in _chunks(source) for record in frames.feed(chunk))
    yield from rows_of(_read_all(records, decoder, messages))
    frames.end()
    yield from _not_read(frames, decoder, messages)


def _read_all(
    records: Iterable[LogRecord], decoder: Decoder, messages: Messages
) -> Iterator[Observation | Signal]:
    for record in records:
        yield from map(messages.with_first_name, decoder.feed(record))
        yield from messages.feed(record)
    yield from messages.end()


def rows_of(heard: Iterable[Observation | Signal]) -> Iterator[Row]:
    """Readings of each second, without a position, and signals; numbered by the second."""
    seconds = Seconds()
    number = 0
    for one in heard:
        if isinstance(one, Signal):
            yield Remark(number, one.time_ns, one.text, CODE)
            continue
        for second in seconds.feed(one):
            number += 1
            yield from _sightings(number, second)
    for second in seconds.end():
        number += 1
        yield from _sightings(number, second)


def _sightings(number: int, second: Second) -> Iterator[Sighting]:
    t_ns = second.time_ns
    fix = Fix(False, utc_ns=t_ns if t_ns >= CLOCK_SET_NS else None)
    for reading in second.readings:
        yield Sighting(number, t_ns, fix, reading, second.radio_id)


def _chunks(source: Path) -> Iterator[bytes]:
    n_chunks = -(-source.stat().st_size // _CHUNK)
    try:
        with open_regular(source) as file:
            chunks = iter(lambda: file.read(_CHUNK), b"")
            yield from with_progress(chunks, f"{source.name}: MB", n_chunks)
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror or error}") from error


def _not_read(frames: FrameReader, decoder: Decoder, messages: Messages) -> Iterator[NoCell]:
    for why, n in sorted(frames.damaged.items()):
        yield NoCell(0, f"damaged frames, {why}", n)
    for (code, version), n in sorted((decoder.unknown + messages.unknown).items()):
        yield NoCell(0, f"0x{code:04X} version {version}", n)
    for code, n in sorted((decoder.refused + messages.refused).items()):
        yield NoCell(0, f"0x{code:04X} with a length or a value that cannot be", n)
    if messages.n_unnamed:
        yield NoCell(0, "reported neighbours on a carrier that is not named", messages.n_unnamed)
    if messages.n_undecoded:
        yield NoCell(0, NO_PYCRATE, messages.n_undecoded)
    if n := frames.skipped.total() + frames.n_other:
        yield NoCell(0, "frames without levels", n)


IMPORTS = (
    Format(
        "Qualcomm DIAG",
        read,
        "the modem's clock",
        lambda seen: seen.kind == "diag",
        has_scans=True,
        unrepeated=True,
        capture=True,
    ),
)
