"""Writing of OpenEXR files channel by channel."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from anyprobe.core.color import REC709_CHROMATICITIES
from anyprobe.errors import OutputError


def write_channels(
    path: Path,
    channels: Mapping[str, np.ndarray],
    attributes: Mapping[str, Any],
    *,
    latlong: bool = True,
    target: str | os.PathLike[str] = "",
) -> None:
    """Write channels [H, W] with ZIP compression; in Rec. 709 unless the attributes have other chromaticities.

    Args:
        attributes: of the header.
        latlong: whether the header says that they are a latitude-longitude map.
        target: path that errors name, where `path` is a temporary file.
    Raises:
        OutputError: it cannot be written.
    """
    target = target or path
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "chromaticities": REC709_CHROMATICITIES,
        **({"envmap": OpenEXR.ENVMAP_LATLONG} if latlong else {}),
        **attributes,
    }
    try:
        OpenEXR.File(header, dict(channels)).write(os.fspath(path))
    except RuntimeError as error:  # its only report of a full disk or a closed folder
        reason = " ".join(str(error).replace(str(path), str(target)).split())
        advice = "choose another folder or free some space"
        raise OutputError(f"cannot be written ({reason}); {advice}", source=target) from error
