"""`fieldlogger doctor`: tests of the machine, the service, the modem and the receiver."""
