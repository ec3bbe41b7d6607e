"""ComfyUI nodes: HDR light from one photo, as a map, as a file, and on an inserted object."""

from .nodes import AnyprobeExtension, comfy_entrypoint

__all__ = ["AnyprobeExtension", "comfy_entrypoint"]
