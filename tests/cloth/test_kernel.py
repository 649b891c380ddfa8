"""Machine code is kept by the source it was made from."""

from pathlib import Path

from medor_cloth import kernel
from medor_cloth.grasp import nearest_within_reach
from medor_cloth.kernel import cache_for


def test_any_change_of_any_module_is_another_cache(tmp_path: Path) -> None:
    (tmp_path / "caller.py").write_text("a = 1\n")
    (tmp_path / "callee.py").write_text("b = 1\n")
    before = cache_for(tmp_path)
    assert cache_for(tmp_path) == before
    (tmp_path / "callee.py").write_text("b = 2\n")
    assert cache_for(tmp_path) != before


def test_kernels_are_cached_by_the_source_of_the_package() -> None:
    package = Path(kernel.__file__).parent
    assert Path(nearest_within_reach.stats.cache_path).is_relative_to(cache_for(package))  # type: ignore[attr-defined]
