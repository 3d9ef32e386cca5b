"""The AT framer with a command that is sent or has expired, and a reply of a SIM800."""

from logger.drivers.protocols.at import AtFramer
from tests.kit.framers import check_framer

CENG_LINES = ("+CENG: 1,1", '+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"')

CENG_REPLY = (
    b'\r\n+CENG: 1,1\r\n\r\n+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"\r\n\r\nOK\r\n'
)


def framer_after(command):
    def make():
        framer = AtFramer()
        framer.send(command)
        return framer

    return make


def framer_after_expiry(command, then):
    """A framer on which `command` has expired and `then` is pending."""

    def make():
        framer = framer_after(command)()
        framer.expire()
        framer.send(then)
        return framer

    return make


def check(make, data, expected):
    check_framer(make, data, expected, trailing=b'+CENG: 3,"0038')
