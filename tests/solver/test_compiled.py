"""Compiled functions are cached by the sources of the whole package."""

from __future__ import annotations

from solver import compiled as module


def double(x):
    return 2 * x


def test_the_cache_lies_in_a_folder_named_after_the_sources(tmp_path, monkeypatch):
    """A changed module means another folder, so that no caller keeps old code."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    sources = tmp_path / "package"
    sources.mkdir()
    (sources / "one.py").write_text("a = 1\n")
    monkeypatch.setattr(module, "__file__", str(sources / "compiled.py"))
    before = module._cache_folder.__wrapped__()
    assert module._cache_folder.__wrapped__() == before
    (sources / "one.py").write_text("a = 2\n")
    assert module._cache_folder.__wrapped__() != before


def test_without_a_place_to_write_functions_still_compile(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    assert module._cache_folder.__wrapped__() is None
    monkeypatch.setattr(module, "_cache_folder", lambda: None)
    assert module.compiled(double)(21) == 42
