"""Registration of the shipped worlds in Gymnasium.

After `import brakecheck` you can call `gymnasium.make("brakecheck/acc-v0")`. Versions
of Gymnasium that search for entry points find the worlds without this import.
"""

from __future__ import annotations

from brakecheck._brakecheck import RawWorld


def register_in_namespace(prefix: str = "") -> None:
    """Registers every shipped world, in the namespace of the caller."""
    from gymnasium.envs.registration import register, registry

    for world in RawWorld.shipped():
        if f"brakecheck/{world}-v0" not in registry:
            register(
                id=f"{prefix}{world}-v0",
                entry_point="brakecheck.envs:Env",
                vector_entry_point="brakecheck.vector:VectorEnv",
                kwargs={"world": world},
            )


def register_all() -> None:
    """Registers every shipped world as `brakecheck/WORLD-v0`."""
    register_in_namespace("brakecheck/")
