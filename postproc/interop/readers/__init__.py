"""Formats of `postproc import`: modules with `IMPORTS`, which `postproc.interop.formats` finds."""
