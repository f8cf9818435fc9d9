"""Reads the description of a ROS 2 bag that is a folder, and unpacks its files where they are compressed as a whole."""

from collections.abc import Callable
from pathlib import Path, PurePath

from np_drake.files.yaml_text import read_yaml
from np_drake.logs.formats.bags.budget import zstd

NAME = "metadata.yaml"
LONGEST = 10**6  # characters of a value; the quality of service of many publishers is one text
PIECE = 1 << 20  # [byte]


def described(folder: Path) -> tuple[list[Path], str]:
    """Return the files of a bag and how they are compressed: `file`, `message` or empty.

    Raises: ValueError: if the description does not serve; OSError: if it or a file is not there.
    """
    try:
        about = read_yaml(folder / NAME, longest=LONGEST)["rosbag2_bagfile_information"]
        names = [PurePath(name).name for name in about["relative_file_paths"]]
        mode = str(about.get("compression_mode") or "").lower()
        kind = about.get("compression_format")
    except (TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"it says nothing of {error}") from error
    if mode not in ("", "none") and (mode not in ("file", "message") or kind != "zstd"):
        raise ValueError(f"the compression {kind!r} of every {mode!r} is not known")
    missing = [name for name in names if not (folder / name).is_file()]
    if missing or not names:
        raise FileNotFoundError(f"the file {missing[0]} is missing" if missing else "it names no file")
    return [folder / name for name in names], "" if mode == "none" else mode


def unpack(file: Path, folder: Path, take: Callable[[int], None]) -> Path:
    """Decompress a file into a folder, as far as `take` allows, and return the result.

    Raises: ValueError: if it is damaged; LogError: beyond the budget.
    """
    target = folder / file.stem
    module = zstd()
    try:
        with file.open("rb") as raw, module.open(raw, "rb") as packed, target.open("wb") as plain:
            while piece := packed.read(PIECE):
                take(len(piece))
                plain.write(piece)
    except (module.ZstdError, EOFError) as error:
        raise ValueError(f"{file.name} is damaged ({error})") from error
    return target
