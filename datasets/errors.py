"""Say what is wrong with a scene, a file or a folder: one family, one line a message."""


class DatasetError(ValueError):
    r"""Report anything wrong with what a user gave as a data set; the base of the family.

    The message is one line: a line break in it, as the name of a file may have, is written as ``\n``.
    """

    def __init__(self, message: str) -> None:
        super().__init__("\\n".join(message.splitlines()))


class MissingFileError(DatasetError, FileNotFoundError):
    """Report a file or folder that is not there or cannot be opened."""


class ImageError(DatasetError):
    """Report an image that cannot be read without loss, or at all."""


class PfmError(DatasetError):
    """Report a PFM file that breaks the format, or an array that PFM cannot hold."""


class Png16Error(DatasetError):
    """Report a file that is no KITTI disparity PNG, or an array that one cannot hold."""


class CalibrationError(DatasetError):
    """Report a ``calib.txt`` with a missing or invalid entry."""


class LayoutError(DatasetError):
    """Report a folder that does not follow the layout its publisher uses."""


class SceneNotFound(DatasetError, LookupError):  # noqa: N818 - it reads as the LookupError that it is
    """Report a scene name that a data set does not have."""


class ArchiveError(DatasetError):
    """Report an archive that is damaged, or holds what is not unpacked."""


class FetchError(DatasetError):
    """Report a file of a benchmark that cannot be fetched, or has changed since it was first fetched."""


class UnknownDatasetError(DatasetError, LookupError):
    """Report a data set specification whose name is not known."""
