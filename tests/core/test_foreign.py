import os
import resource

import msgspec
import pytest

from logger.core.foreign import decode_json, open_regular, read_regular
from tests.kit import foreign_files


class Known(msgspec.Struct):
    state: str
    now_ns: int = 0


@pytest.mark.parametrize("follow", [False, True])
@pytest.mark.parametrize("kind", foreign_files.KINDS)
def test_what_is_no_file_of_that_size_is_refused_at_once(tmp_path, kind, follow):
    path = tmp_path / "a"
    foreign_files.make(path, kind)
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    error = foreign_files.attempt(lambda: read_regular(path, 1000, follow_links=follow), OSError)
    assert isinstance(error, OSError)
    assert error.strerror
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < before_kb + 20_000


def test_a_link_is_followed_only_where_it_may(tmp_path):
    (tmp_path / "a").write_bytes(b"content")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    assert read_regular(tmp_path / "b", 7, follow_links=True) == b"content"
    with pytest.raises(OSError):
        read_regular(tmp_path / "b", 7, follow_links=False)
    with pytest.raises(OSError, match="longer than 6 bytes"):
        read_regular(tmp_path / "a", 6)


def test_a_name_that_is_none_is_an_error_like_others(tmp_path):
    with pytest.raises(OSError, match="is no path"):
        open_regular(tmp_path / "a\0b")
    assert len(os.listdir("/proc/self/fd")) < 200


@pytest.mark.parametrize("name", foreign_files.TEXTS)
def test_json_has_one_kind_of_error(name):
    text = foreign_files.TEXTS[name]
    for kind in (Known, dict[str, Known], tuple[Known, ...]):
        with pytest.raises(msgspec.DecodeError):
            decode_json(text, kind)
    value = foreign_files.attempt(lambda: decode_json(text, object), msgspec.DecodeError)
    assert value is not None


def test_json_of_the_right_kind_is_read():
    assert decode_json(b'{"state":"a","now_ns":1}', Known) == Known("a", 1)
    assert decode_json(b'\xef\xbb\xbf{"state":"a","now_ns":1}', Known) == Known("a", 1)
