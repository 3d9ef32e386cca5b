"""Formats of `postproc import`: modules with `IMPORTS`, found by `postproc.interop.importing`."""
