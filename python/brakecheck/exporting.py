"""A trained ado as files that other programs read: weights, observation, ONNX."""

from __future__ import annotations

import json
import os
import shutil
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from brakecheck.results import Ado


def export_ado(ado: Ado, directory: str) -> list[str]:
    """Writes the files of `Ado.export`."""
    os.makedirs(directory, exist_ok=True)
    weights = os.path.join(directory, "policy.safetensors")
    shutil.copyfile(os.path.join(ado.run.path, "policy.safetensors"), weights)
    spec = os.path.join(directory, "observation.json")
    manifest = ado.run.manifest
    described = {
        "world": manifest["world"],
        "scaled": "(value - (low + high) / 2) / ((high - low) / 2)",
        "observation": ado.observation,
        "told": manifest.get("told", []),
        "actions": ado.actions,
        "decision_s": ado.world.about["decision_s"],
        "policy_sha256": manifest["policy_sha256"],
    }
    with open(spec, "w", encoding="utf-8") as file:
        json.dump(described, file, indent=2, ensure_ascii=False)
        file.write("\n")
    return [weights, spec]
