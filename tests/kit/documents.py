"""How a document differs from its golden form."""

from math import isclose

RELATIVE = 1e-6
"""Other processors round otherwise, and least squares stops within 1e-8 of its optimum."""
_ROUND = 1e-3
"""An ellipse whose axes differ by less has no azimuth."""


def differences(expected, found, where="", **how):
    """Where `found` lacks something of `expected` or has another value.

    Fields that were added do not count, nor the values of those that `how` names as `free`. Texts
    are compared by what its `text` makes of them. An integer that has become a float is another
    value unless it says `floats`.
    """
    if isinstance(expected, dict) and isinstance(found, dict):
        axes_m = expected.get("semi_major_m"), expected.get("semi_minor_m")
        if None not in axes_m and isclose(*axes_m, rel_tol=_ROUND):
            expected = {**expected, "azimuth_deg": found.get("azimuth_deg")}
        for key, value in expected.items():
            if key not in found:
                yield f"{where}.{key} is missing"
            elif key not in how.get("free", ()):
                yield from differences(value, found[key], f"{where}.{key}", **how)
    elif isinstance(expected, list) and isinstance(found, list):
        if len(expected) != len(found):
            yield f"{where} has {len(found)} items and not {len(expected)}"
        for i, (one, other) in enumerate(zip(expected, found, strict=False)):
            yield from differences(one, other, f"{where}[{i}]", **how)
    elif not _are_equal(expected, found, **how):
        yield f"{where} is {found!r} and not {expected!r}"


def _are_equal(expected, found, text=str, floats=False, **_):
    kinds = {type(expected), type(found)}
    if float in kinds and kinds <= {int, float} and (floats or type(expected) is float):
        return isclose(expected, found, rel_tol=RELATIVE, abs_tol=1e-12)
    if kinds == {str}:
        return text(expected) == text(found)
    return len(kinds) == 1 and expected == found
