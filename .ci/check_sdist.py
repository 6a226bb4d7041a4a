"""Check the source distribution in a folder: `check_sdist.py dist`."""

import sys
import tarfile
from pathlib import Path, PurePosixPath

WANTED = {
    *("LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff", "PKG-INFO"),
    *("pyproject.toml", "requirements.lock", "Makefile", "acl_gym/py.typed"),
}
PICTURES = {".gif", ".jpg", ".mp4", ".pdf", ".png", ".svg"}
LARGEST = 100_000  # bytes; logs, results and recorded data do not belong in it
LARGEST_ARCHIVE = 3_000_000

(path,) = Path(sys.argv[1]).glob("*.tar.gz")
with tarfile.open(path) as archive:
    files = {
        PurePosixPath(*PurePosixPath(member.name).parts[1:]): member.size
        for member in archive
        if member.isfile()
    }

if missing := WANTED - {str(file) for file in files}:
    sys.exit(f"{path.name} lacks {sorted(missing)}")
for file, size in files.items():
    if file.suffix in PICTURES or size > LARGEST:
        sys.exit(f"{file} ({size} bytes) does not belong in {path.name}")
if path.stat().st_size > LARGEST_ARCHIVE:
    sys.exit(
        f"{path.name} has {path.stat().st_size} bytes, expected at most "
        f"{LARGEST_ARCHIVE}; see what was added to it"
    )
print(f"{path.name}: {len(files)} files, {path.stat().st_size / 1e6:.1f} MB")
