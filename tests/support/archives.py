"""Contents of FMUs and other archives."""

from zipfile import ZipFile


def read_archive(file):
    """Return the content of every file in an archive, by its path."""
    with ZipFile(file) as archive:
        return {path: archive.read(path) for path in archive.namelist()}
