"""Damaged results files, and what each command makes of them.

A small finished campaign is written once; a copy of it is damaged and given to ``verify``,
``status``, the averages of ``report``, ``merge`` and a resuming ``run``, all in this process. A
damaged copy is

- *refused*: every command ends in one sentence;
- *named*: ``verify`` names rows, and every other command gives what it gives for a file in which
  these rows are pending; ``run`` computes them again, after which the file is the undamaged one;
- *pending*: rows count as pending though nothing is named, else as before (a status byte became 0);
- *harmless*: every command gives what it gives for the undamaged file;
- *WRONG*: anything else, with what was wrong.
"""

import contextlib
import io
import json
import shutil
import warnings
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from adhesis.ensemble.aggregate.average import aggregate
from adhesis.ensemble.aggregate.status import read_status
from adhesis.ensemble.campaign.file import load_campaign
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.results.layout import merge
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import PENDING, ROW_DATASETS
from adhesis.ensemble.results.write import Writer
from adhesis.ensemble.run.session import Options, run_campaign
from tests.support.campaign_support import adhesis_here, differences, write_campaign
from tests.support.fake_run import fake_engine


class Damage:
    """A finished campaign whose copies are damaged; its files are in ``folder``."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        toml = write_campaign(folder, realisations="2", load_steps="10")
        self.campaign = load_campaign(toml)
        self.sound = folder / "sound.h5"
        self._run(self.sound)
        with h5py.File(self.sound) as file:
            self.row_ranges = [
                (file[d.name].id.get_offset(), file[d.name].id.get_storage_size())
                for d in ROW_DATASETS
            ]
        self.content = self.sound.read_bytes()
        self.answer = cache(self._answer)

    def _run(self, path: Path) -> None:
        engine = fake_engine("fail=0.8:0.04:1")
        with contextlib.redirect_stderr(io.StringIO()):
            run_campaign(self.campaign, path, options=Options(patience=0.0), engine=engine)

    def places(self, *, of_rows: bool) -> np.ndarray:
        """Return the bytes of the file that rows hold, or all others."""
        inside = np.zeros(len(self.content), bool)
        for first, size in self.row_ranges:
            inside[first : first + size] = True
        return np.flatnonzero(inside if of_rows else ~inside)

    def flipped(self, place: int, mask: int) -> bytes:
        """Return the file with some bits of one byte inverted."""
        content = bytearray(self.content)
        content[place] ^= mask
        return bytes(content)

    def judge(self, content: bytes, name: str = "case") -> tuple[str, str]:
        """Give a damaged file to every command; returns what it is, and the reason."""
        path = self.folder / f"{name}.h5"
        path.write_bytes(content)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", RuntimeWarning)
                return self._judge(path)
        except Wrong as error:
            return "WRONG", str(error)
        except Exception as error:  # whatever it is: no command may end in it
            return "WRONG", f"{type(error).__name__}: {error}"
        finally:
            for file in self.folder.glob(f"{name}*"):
                file.unlink()

    def _judge(self, path: Path) -> tuple[str, str]:
        verified = adhesis_here("verify", path, "--json")
        code, err = verified.returncode, verified.stderr
        commands: dict[str, Callable[[], Any]] = {
            "status": lambda: _status(path),
            "averages": lambda: _averages(path),
            "merge": lambda: self._merged(path, self.sound),
            "run": lambda: self._resumed(path),
        }
        if code == 2:
            for command, call in commands.items():
                try:
                    call()
                except InputError as error:
                    _sentence(str(error))
                else:
                    raise Wrong(f"{command} takes what verify refuses: {err}")
            return "refused", _sentence(err)
        reported = json.loads(verified.stdout)
        named = tuple(d["row"] for d in reported["damaged"])
        if bool(named) != (code == 1):
            raise Wrong(f"verify ends with {code} and names {named}")
        with Results(path) as results:
            status = results.status()
        pending = tuple(np.flatnonzero(status == 0).tolist())
        expected = self.answer(tuple(sorted((*named, *pending))))
        wrong = [c for c in ("status", "averages") if commands[c]() != expected[c]]
        wrong += ["merge"] if self._merged(path, expected["path"]) else []
        wrong += ["run"] if self._resumed(path) else []
        if wrong:
            raise Wrong(f"{', '.join(wrong)} differ; named {named}, pending {pending}")
        if named:
            return "named", f"rows {named}"
        return ("pending", f"rows {pending}") if pending else ("harmless", "")

    def _answer(self, without: tuple[int, ...]) -> dict[str, Any]:
        """Return what the commands give for the sound file with some rows pending."""
        path = self.folder / f"answer{'-'.join(map(str, without))}.h5"
        marked = path.with_suffix(".marked.h5")
        shutil.copy(self.sound, marked)
        with Writer(marked) as writer:
            writer.mark(without, PENDING)
        merge([marked], path)  # in which pending rows hold nothing
        source = path if without else self.sound
        return {"status": _status(source), "averages": _averages(source), "path": path}

    def _merged(self, path: Path, expected: Path) -> list[str]:
        """Merge the file into a new one; returns the datasets that are not those expected."""
        out = path.with_name(f"{path.stem}.merged.h5")
        merge([path], out)
        return differences(out, expected)

    def _resumed(self, path: Path) -> list[str]:
        """Resume the file; returns the datasets that then differ from the undamaged ones."""
        copy = path.with_name(f"{path.stem}.resumed.h5")
        shutil.copy(path, copy)
        self._run(copy)
        with Results(copy) as results:
            unsound = [f"row {row} is damaged" for row in results.damaged().tolist()]
        return unsound + differences(copy, self.sound)


class Wrong(Exception):
    """What a command does with a damaged file is wrong."""


def _sentence(text: str) -> str:
    if "\n" in text.strip() or "Traceback" in text or not text.strip():
        raise Wrong(f"not one sentence: {text}")
    return text.strip()


def _status(path: Path) -> str:
    """Return the numbers of the status; whether a row without a result is damaged is left out."""
    status = read_status(path)
    for group in status["groups"]:
        del group["pending"]
    for name in ("file", "last_row", "pending", "damaged"):
        del status[name]
    return json.dumps(status, sort_keys=True)


def _averages(path: Path) -> str:
    """Return every number that a report is made of, or why there is none."""
    data = aggregate(path)
    return _plain([data.cells, data.paired, data.failures])


def _plain(value: Any) -> str:
    """Return a text that is equal where all numbers are, whatever holds them."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{value.shape}{value.tobytes().hex()}"
    if is_dataclass(value):
        names = (f.name for f in fields(value) if f.name not in ("campaign", "pending"))
        return f"{{{','.join(_plain(getattr(value, name)) for name in names)}}}"
    if isinstance(value, dict):
        return f"{{{','.join(f'{k}:{_plain(v)}' for k, v in value.items())}}}"
    if isinstance(value, (list, tuple)):
        return f"[{','.join(map(_plain, value))}]"
    return repr(value)
