"""Write what other doors take from the one description of inputs: python integrations/write_inputs.py [--check]

From src/anyprobe/inputs/inputs.schema.json, read by inputs.description: types and options of the npm package,
web/types/inputs.d.ts and web/src/options.js, and the texts and bounds of the Blender extension, inputs.json. --check
writes nothing and fails if a file is not fresh.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from anyprobe.inputs.description import Hint
from anyprobe.inputs.hints import HINTS
from anyprobe.inputs.settings import SETTINGS

ROOT = Path(__file__).resolve().parents[1]
TYPES = ROOT / "web" / "types" / "inputs.d.ts"
OPTIONS = ROOT / "web" / "src" / "options.js"
BLENDER = ROOT / "integrations" / "blender" / "light_from_photo" / "inputs.json"

WRITTEN = "/** Written by integrations/write_inputs.py from the description of inputs in src/anyprobe/inputs. */"
OWN_TYPES = {"mask": "GivenMask", "normals": "Float32Array", "material": "GivenMaterial"}
"""Types of what a browser holds otherwise than Python."""
INTERFACES = {"Hints": ("place",), "LightOptions": ("camera", "light")}
"""Names of TypeScript's interfaces, and what their inputs are about."""
APART = ("mask", "normals", "longFovDeg")
"""Inputs of other interfaces: not every method takes them, or they are one of several ways to say the same."""


def for_web() -> dict[str, tuple[Hint, str]]:
    """Return the inputs that the npm package takes under names of its own, each with its TypeScript type."""
    found = {}
    for hint in (*HINTS.values(), *SETTINGS.values()):
        if not hint.in_web or hint.in_web in found:  # albedo and roughness stand within the material
            continue
        pair = f"readonly [{', '.join(['number'] * max(hint.numbers, default=1))}]"
        kind = OWN_TYPES.get(hint.in_web) or ("number" if hint.numbers == (1,) else pair)
        if hint.words and hint.in_web not in OWN_TYPES:
            kind = " | ".join([*(json.dumps(word) for word in hint.words), "boolean"])
        found[hint.in_web] = hint, f"{kind} | readonly ({kind})[]" if hint.repeated else kind
    return found


def types() -> str:
    """Return TypeScript's interfaces of the inputs that the npm package takes."""
    lines = [WRITTEN, "", 'import type { GivenMaterial } from "./index.js";']
    for title, about in INTERFACES.items():
        lines += ["", f"export interface {title} {{"]
        for name, (hint, kind) in for_web().items():
            if hint.about not in about or name in APART:
                continue
            bounds = f" {hint.least:g} to {hint.most:g}." if hint.least is not None and hint.most is not None else ""
            lines += [
                f"  /** {hint.help}{bounds} */",
                f"  {name}?: {kind}{' | null' if hint.about == 'place' else ''};",
            ]
        lines += ["}"]
    return "\n".join(lines) + "\n"


def options() -> str:
    """Return the JavaScript module of what the npm package checks of each input."""
    lines = [WRITTEN, "", "export const INPUTS = {"]
    for name, (hint, _) in for_web().items():
        kept = {"about": hint.about, "unit": hint.unit or None, "least": hint.least, "most": hint.most}
        kept |= {"numbers": max(hint.numbers, default=None), "repeated": hint.repeated or None}
        kept |= {"words": None if name in OWN_TYPES else list(hint.words) or None}
        said = ", ".join(f"{key}: {json.dumps(value)}" for key, value in kept.items() if value is not None)
        lines += [f"  {name}: {{ {said} }},"]
    return "\n".join([*lines, "};"]) + "\n"


def for_blender() -> dict[str, Any]:
    """Return texts and bounds by form field."""
    return {
        hint.name: {"help": hint.help, "least": hint.least, "most": hint.most}
        for hint in HINTS.values()
        if hint.about != "setting"
    }


def files() -> dict[Path, str]:
    """Return what each file should hold."""
    return {TYPES: types(), OPTIONS: options(), BLENDER: json.dumps(for_blender(), indent=1) + "\n"}


def main() -> None:
    """Write the files, or check them."""
    stale = [path for path, text in files().items() if not path.exists() or path.read_text(encoding="utf-8") != text]
    if "--check" in sys.argv[1:]:
        sys.exit("\n".join(f"{path}: not fresh; run python integrations/write_inputs.py" for path in stale) or 0)
    for path in stale:
        path.write_text(files()[path], encoding="utf-8")
        print(path.relative_to(ROOT))


if __name__ == "__main__":
    main()
