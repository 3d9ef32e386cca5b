"""Recovery: HDF5 files of interrupted runs, with a report of what was lost."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from logger.core.errors import RunFileError
from logger.core.runfile.finish import finish, unfinished_journals
from logger.core.runfile.meta import Damage
from logger.core.runfile.run_names import is_hdf5

_NONE = Damage()


@dataclass(frozen=True, slots=True)
class Recovered:
    """What became of one journal: its HDF5 file and what it lacks, or why there is none."""

    journal: Path
    run: Path | None = None
    damage: Damage = _NONE
    digest: str = ""
    error: str = ""

    @property
    def loss(self) -> str:
        """One line on what was lost, empty where nothing was."""
        if self.error:
            return self.error
        return f"{self.journal}: {self.damage}" if self.damage else ""

    def as_dict(self) -> dict[str, str | None]:
        """For machines: paths, digest and loss."""
        run = str(self.run) if self.run else None
        return {"journal": str(self.journal), "run": run, "digest": self.digest, "loss": self.loss}

    def __str__(self) -> str:
        return f"{self.run}  digest {self.digest}" if self.run else f"{self.journal}: not recovered"


def recover(path: Path) -> Iterator[Recovered]:
    """Recover one journal, or all in a folder that have no HDF5 file yet.

    In a folder, one that cannot be read does not keep the others. Raises `RunFileError` for a
    single one.
    """
    if not path.is_dir():
        if path.is_file() and is_hdf5(path):
            raise RunFileError(f"{path} is a finished run, no journal")
        yield _recover_one(path)
        return
    for journal in unfinished_journals(path):
        try:
            yield _recover_one(journal)
        except RunFileError as error:
            yield Recovered(journal, error=str(error))


def _recover_one(journal: Path) -> Recovered:
    done = finish(journal)
    return Recovered(journal, done.run, done.damage, done.digest)
