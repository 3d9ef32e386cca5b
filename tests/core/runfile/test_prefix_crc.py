"""Many overlapping checksums at once are what zlib says of each."""

from zlib import crc32

from hypothesis import given
from hypothesis import strategies as st

from logger.core.runfile.prefix_crc import crc32_of_each


@given(
    st.binary(max_size=300),
    st.lists(st.tuples(st.integers(0, 300), st.integers(0, 300)), max_size=20),
)
def test_each_is_that_of_zlib(data, pairs):
    spans = [sorted(min(place, len(data)) for place in pair) for pair in pairs]
    found = crc32_of_each(data, [start for start, _ in spans], [end for _, end in spans])
    assert found.tolist() == [crc32(data[start:end]) for start, end in spans]
